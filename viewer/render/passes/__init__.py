"""The passes after the rasteriser: depth filter, fill, hole test, noise level, development."""
