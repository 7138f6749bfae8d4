"""What the parts of the window are drawn with: theme, widgets, overlays, textures, workers.  Knows no scan."""
