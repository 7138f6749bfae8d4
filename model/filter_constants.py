"""Constants of the depth filter, shared by its shaders and model/depth_filter.py; imports no torch."""

LEVELS = {"auto": 5, "paper-code": 4, "paper-text": 4, "npbg++": 3}
"""Pyramid levels above the picture, by preset."""

TOLERANCE = 0.01  # of inverse depth: nearer than this is "clearly nearer"
SLOPE = 0.5  # of a block's slope, both axes summed, allowed on top
SAME_SURFACE = 0.02  # of inverse depth: children this close belong to the block's front surface
TWIST = 0.015  # of inverse depth: four children this close to a plane may differ by that plane's slope
SUPPORT = 1.75  # expected points in a finer block above which that block's emptiness is no chance
SUPPORT_SHARED = 2.5  # the same for blocks that hold the nearer surface themselves: no opening shows there
MIRRORED = (2, 3)
"""Levels at which the picture goes on mirrored beyond its border.  Of the points in its outer 4 pixels 34 % were judged
otherwise than in the middle of a larger picture, all kept that should not be, and 1.2 % are now (demo; studio 13 and 2.2 %,
plant room 1.7 and 1.1 %).  At levels 0 and 1 it would cost up to 6 % that should stay, at 4 and 5 as much as it brings."""

EMPTY = 1e30  # what the published code reads as depth where there is none
PARENT_RATIO = 0.025
EDGE = 0.03
NPBG_DEPTH = 0.05
