"""What the parts of the window share: theme, widgets, overlays, textures, workers, notices, the clipboard.  Knows no scan."""
