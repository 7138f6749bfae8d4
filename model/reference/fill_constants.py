"""Constants of the pull-push fill, shared by its shaders and model/reference/pull_push.py; imports no torch."""

from dataclasses import dataclass
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

NOISE_UNIT = 0.03
"""Standard deviation, full brightness = 1, of a pixel's colour at which it counts as a mean of two points where points are
averaged in full.  Of three and more, filled pictures of atrium at one in twenty lose up to 0.5 dB, at bricks."""
WIDENED = 0.7
"""Part of the doublings of a surface's point spacing by averaging that counts where gaps are filled from the background: 1
loses 0.1 dB more in the view of atrium below, 0.35 up to 0.7 dB in a view of the street corner."""
NEAR_SPREAD = 0.3
NEAR_DOUBLINGS = 0.1
"""A pixel nearer than the mean of its surroundings by more than NEAR_SPREAD of their standard deviation begins to keep its
weight, and keeps it in full from NEAR_DOUBLINGS of depth more: 7 %.  Else things near the camera that few points hit vanish
into what is behind them (view 0 of atrium at one in fifty points with noise of 0.1: assets/weights/README.md)."""
DENSITY_BLOCK = 16
"""Side, pixels, of the blocks in which measured pixels are counted, and their depths averaged."""


@dataclass(frozen=True)
class Averaging:
    """Averaging of the points of noisy scans where they are sparse (model/reference/pull_push.py).

    least_noise: noise of a scan, standard deviation of luma with full brightness = 1, from which on it is averaged; below,
    nothing changes to the byte.  dense, sparse: distance between points, pixels, up to which nothing is averaged, and from
    which all is.
    """

    least_noise: float
    dense: float
    sparse: float

    def applies(self, overall: float) -> bool:
        """Whether the points of a scan of this noise are averaged.  overall: standard deviation, full brightness = 1."""
        return overall >= self.least_noise

    def widening(self, overall: float) -> float:
        """Doublings by which the point spacing of surfaces counts as wider in the fill of a scan of this noise."""
        return WIDENED * 0.5 * log2(1.0 + (overall / NOISE_UNIT) ** 2) if self.applies(overall) else 0.0


# Chosen by PSNR, SSIM and distance in rooms at one in twenty and one in fifty points with colour noise of 0.03, 0.07 and 0.1,
# and at withheld points of street_corner.laz (noise 0.064) at all, one in ten and one in fifty points; the worst room decided.
FOR_PICTURE = Averaging(0.04, 1.0, 2.0)
"""Of the filled picture.  At one in twenty points with noise of 0.07: assets/weights/README.md."""
FOR_NETWORK = Averaging(0.05, 4.0, 8.0)
"""Of the network's input: the network removes noise better where points are dense.  From 3 on its picture of all points of the
street corner loses 0.1 dB."""


def wider_ramp(level: float, footprint: float | None = None) -> tuple[float, float]:
    """Factor and offset that make the ramp of WIDER of a depth feature.  footprint: of an orthographic picture the feature that
    stands for the size of all pixels, whatever their depth; None: a pixel's own feature says it."""
    return (WIDER_SCALE, wider_offset(level)) if footprint is None else (0.0, footprint * WIDER_SCALE + wider_offset(level))


def wider_offset(level: float) -> float:
    """Offset of the ramp of WIDER at a level whose pixels have a side of 2^level."""
    return (level - WIDER[0]) / (WIDER[1] - WIDER[0])
