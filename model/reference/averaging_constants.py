"""Constants of averaging in sparse places, shared by its shader and model/reference/averaging.py; imports no torch.

Chosen by PSNR at withheld points of street_corner.laz at all, one in ten and one in fifty points, and judged on four rooms at
one in fifty points with colour noise of 0.1, two views each.
"""

from math import log2

LEAST = 0.05
"""Noise of a scan, standard deviation of luma with full brightness = 1, from which on it is averaged.  street_corner.laz has
0.064.  Below, nothing changes to the byte: studio.laz, with 0.023, would gain 0.05 dB at one in ten points; atrium at one in
twenty, with 0.044, would lose 0.4 dB in one view of two, at columns near the camera that few points hit."""
UNIT = 0.03
AVERAGED = 1.0
"""A pixel whose colour has a standard deviation of UNIT counts as a mean of 1 + AVERAGED points.  3 in place of 1 gains 0.3 dB
more on the street corner at one in fifty points, and loses another 0.5 dB in that view of atrium."""
DENSE, SPARSE = 4.0, 8.0
"""Distance between points, pixels, up to which nothing is averaged, and from which all is.  From 3 on the network's picture of
all points of the street corner loses 0.1 dB."""
BLOCK = 16
"""Side, pixels, of the blocks in which measured pixels are counted."""


def averages(overall: float) -> bool:
    """Whether the points of a scan of this noise are averaged.  overall: standard deviation, full brightness = 1."""
    return overall >= LEAST


def widening(overall: float) -> float:
    """Doublings by which the point spacing of surfaces counts as wider in the fill of a scan of this noise."""
    return 0.5 * log2(1.0 + AVERAGED * (overall / UNIT) ** 2) if averages(overall) else 0.0
