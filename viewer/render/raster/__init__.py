"""The rasterisers: a draw list to colour, depth and evidence."""
