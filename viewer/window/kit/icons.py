"""Icons of the interface, as letters of the typeface Font Awesome 6 Free Solid (SIL Open Font License 1.1).

imgui-bundle ships the typeface; :class:`Theme` adds it to both fonts of the interface, so that an icon stands in any text.
"""

FLY, INSPECT, MEASURE, CLIP = "\uf1d8", "\uf05b", "\uf545", "\uf1b2"
SECTION, COLOURS, STATIONS, PROVENANCE = "\uf568", "\uf53f", "\uf21d", "\uf058"
FILM, SCENE, NOTE, ALIGN, SELECT, COMPARE, MESH = "\uf008", "\uf013", "\uf249", "\uf0b2", "\uf5ee", "\uf1da", "\uf1ad"
"""Of the tools."""
HOME, FRAME, SIDES, ORTHOGRAPHIC = "\uf015", "\uf065", "\uf1b3", "\uf00a"
"""Of viewpoints: the start, the whole scene, from a side, parallel rays."""
SHOWN, HIDDEN, REMOVE, ADD = "\uf06e", "\uf070", "\uf00d", "\uf067"
"""Of what the outliner lists."""
OUTLINER, INSPECTOR, OPEN, HELP, PROFILER = "\uf0ca", "\uf1de", "\uf07c", "\uf059", "\uf624"
FOLD_LEFT, FOLD_RIGHT, EXPORT, NOTICE = "\uf100", "\uf101", "\uf56e", "\uf071"
PHOTOGRAPH, VIEWPOINT, STATION = "\uf03e", "\uf02e", "\uf21d"
REGION, CLASS = "\uf5ee", "\uf02b"
"""Of panels and rows."""

USED = "".join(text for name, texts in list(globals().items()) if name.isupper() for text in texts)
"""Every icon above; a test looks for each in the typeface."""
