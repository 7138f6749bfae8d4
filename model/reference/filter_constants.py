"""Constants of the depth filter, shared by its shaders and model/reference/depth_filter.py; imports no torch.

How much depends on a value is given in dB of the filled picture with half and with twice the value: the least and the
largest mean change of three views in one of six registered rooms (atrium, kitchen, dining-room, living-room-2, staircase2,
bathroom), at all points and one in ten.
"""

LEVELS = {"auto": 5, "paper-code": 4, "paper-text": 4, "npbg++": 3}
"""Pyramid levels above the picture, by preset.  ``auto``: with 4 or 6 the change is at most 0.01 dB.  The others are the
publications'."""

TOLERANCE = 0.01
"""Share of inverse depth beyond which a block is "clearly nearer".  Half: -0.08 to +0.03 dB, twice: -0.03 to +0.10."""
SLOPE = 0.5
"""Share of a block's slope, both axes summed, added to the tolerance.  Half: -0.10 to +0.02 dB, twice: -0.02 to +0.11."""
SAME_SURFACE = 0.02
"""Share of inverse depth within which children belong to the block's front surface.  Half: -0.34 to +0.05 dB, twice: 0.00 to
+0.14."""
TWIST = 0.015
"""Share of inverse depth by which four children may deviate from a plane and still differ by that plane's slope.  Half: -0.10
to +0.02 dB, twice: 0.00 to +0.10."""
STEEPEST = 0.5
"""Share of inverse depth by which a plane may change within four children.  Steps of depth along a row of pixels look like
steeper planes, and rows of points on a near surface would not hide anything (atrium, filled picture: -0.2 dB)."""
SUPPORT = 1.75
"""Expected points in a finer block above which an empty one is not chance but an opening: by chance it is empty with a
probability of exp(-SUPPORT), 17 %.  Half: -0.04 to +0.16 dB, twice: -0.11 to +0.08."""
SUPPORT_SHARED = 2.5
"""The same for blocks that hold the nearer surface themselves, which show no opening.  Half: -0.12 to +0.16 dB, twice: -0.18 to
+0.11."""
CLUMPED = 2.25
"""Points of a surface in nine blocks, as a multiple of those that would occupy as many children lying at random, from which
they are clumped: thin things in front, or points of several surfaces, and not one sparse surface.  From 2 to 3 the filled
picture changes by 0.05 dB (atrium and four rooms, all points and one in ten)."""
CLUMPED_TOLERANCE = 0.2
"""Share of inverse depth added to the tolerance where points are clumped.  With infinity, columns a metre from the camera, of
which the scanner saw rows of points, no longer hide what is behind them (atrium: -1.1 dB in one view)."""
COARSE, COARSE_TOLERANCE = 4, 0.04
"""First coarse level, and share of inverse depth added to the tolerance there; it doubles from level to level.  Of the pixels
that levels 4 and 5 removed by less than that, 20,900 of 21,000 were visible in truth (seven rooms, all points; at one point in
ten 1,300 of 1,600)."""
CHILDREN = 64
"""Factor of a block's points where shaders keep them in one number with its occupied children: above the 36 of nine blocks."""
MIRRORED = (2, 3)
"""Levels at which the picture is continued by mirroring at its border.  Without it, of the points in the outer 4 pixels 34 %
were judged differently than in the middle of a larger picture, all wrongly kept; with it 1.2 % (demo; studio 13 and 2.2 %,
plant room 1.7 and 1.1 %).  At levels 0 and 1 it would remove up to 6 % wrongly, at 4 and 5 it removes as much wrongly as
rightly."""

EMPTY = 1e30
"""Depth of empty pixels in the published code."""
PARENT_RATIO = 0.025
"""Relative depth behind its parent beyond which the paper's presets drop a pixel: 1.025 in the published code."""
EDGE = 0.03
"""Laplacian that counts as an edge: 0.03 metres in the published code, and here 3 % of depth in ``paper-text``."""
NPBG_DEPTH = 0.05
"""Metres behind the nearest point of its block up to which ``npbg++`` keeps a pixel (Rakhimov et al. 2022).  The publication
sets it for each data set; this is for rooms, whose furniture is thicker."""


def hiding_limits(level: int, strength: float) -> tuple[float, float, float]:
    """Of preset auto at a level: shares of the front's inverse depth below which a point is hidden, and of its slope which is
    subtracted; and the first where points are clumped.  strength: multiplies all tolerances."""
    coarse = COARSE_TOLERANCE * 2.0 ** (level - COARSE) if level >= COARSE else 0.0
    tolerance = (TOLERANCE + coarse) * strength
    return 1.0 - tolerance, SLOPE * strength, 1.0 - (tolerance + CLUMPED_TOLERANCE * strength)
