"""``pointglass export``: the measured points of a scan, or those inside clips, as a LAZ, LAS, PLY or E57 file.

    points (grid -> blocks of points left by the clips) -> formats (LAS/LAZ, PLY, E57)

``command`` is the command line's part.
"""
