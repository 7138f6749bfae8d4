"""Constants of the pull-push fill, shared by its shaders and model/reference/pull_push.py; imports no torch."""

from math import log2

from ..network.network_layout import DEPTH_FEATURE_SCALE

EMPTY_FEATURE = -8.0
"""Depth feature of a child without weight: nearer than any real one, so that the child hides nothing."""
FIRST_LEVEL = 2
"""The finest level that fills from the background only; at least 2, because fill_picture.comp samples level 1 without a test.
With level of detail one point per pixel is drawn however dense the scan is, and gaps of two pixels are chance.  From level 1
on, 0.01 to 0.04 dB more were measured in three rooms of six."""
NEARER = (0.1, 0.2)
"""Doublings of depth between a sample and the farthest of the four at which it starts and ends to count as nearer: 7 and 15 %.
Chosen, as WIDER, by PSNR on atrium, kitchen, dining-room, living-room-2, staircase2 and bathroom, at all points and one in
ten."""
WIDER = (1.5, 3.0)
"""Doublings of the point spacing, in pixels of a level, at which a gap starts and ends to be too wide for the surface."""
NEARER_SCALE = 1.0 / (DEPTH_FEATURE_SCALE * (NEARER[1] - NEARER[0]))
"""The ramps of NEARER and WIDER as factors and offsets of depth features: this and the three below."""
NEARER_START = NEARER[0] / (NEARER[1] - NEARER[0])
WIDER_SCALE = 1.0 / (DEPTH_FEATURE_SCALE * (WIDER[1] - WIDER[0]))

# Averaging of sparse points: chosen by PSNR at withheld points of street_corner.laz at all, one in ten and one in fifty points,
# and judged on four rooms at one in fifty points with colour noise of 0.1, two views each.
AVERAGED_FROM = 0.05
"""Noise of a scan, standard deviation of luma with full brightness = 1, from which on it is averaged.  street_corner.laz has
0.064.  Below, nothing changes to the byte: studio.laz, with 0.023, would gain 0.05 dB at one in ten points; atrium at one in
twenty, with 0.044, would lose 0.4 dB in one view of two, at columns near the camera that few points hit."""
NOISE_UNIT = 0.03
AVERAGED = 1.0
"""A pixel whose colour has a standard deviation of NOISE_UNIT counts as a mean of 1 + AVERAGED points.  3 in place of 1 gains
0.3 dB more on the street corner at one in fifty points, and loses another 0.5 dB in that view of atrium."""
DENSE, SPARSE = 4.0, 8.0
"""Distance between points, pixels, up to which nothing is averaged, and from which all is.  From 3 on the network's picture of
all points of the street corner loses 0.1 dB."""
DENSITY_BLOCK = 16
"""Side, pixels, of the blocks in which measured pixels are counted."""


def wider_ramp(level: float, footprint: float | None = None) -> tuple[float, float]:
    """Factor and offset that make the ramp of WIDER of a depth feature.  footprint: of an orthographic picture the feature that
    stands for the size of all pixels, whatever their depth; None: a pixel's own feature says it."""
    return (WIDER_SCALE, wider_offset(level)) if footprint is None else (0.0, footprint * WIDER_SCALE + wider_offset(level))


def wider_offset(level: float) -> float:
    """Offset of the ramp of WIDER at a level whose pixels have a side of 2^level."""
    return (level - WIDER[0]) / (WIDER[1] - WIDER[0])


def averages(overall: float) -> bool:
    """Whether the points of a scan of this noise are averaged.  overall: standard deviation, full brightness = 1."""
    return overall >= AVERAGED_FROM


def widening(overall: float) -> float:
    """Doublings by which the point spacing of surfaces counts as wider in the fill of a scan of this noise."""
    return 0.5 * log2(1.0 + AVERAGED * (overall / NOISE_UNIT) ** 2) if averages(overall) else 0.0
