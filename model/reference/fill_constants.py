"""Constants of the pull-push fill, shared by its shaders and model/reference/pull_push.py; imports no torch."""

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


def wider_ramp(level: float, footprint: float | None = None) -> tuple[float, float]:
    """Factor and offset that make the ramp of WIDER of a depth feature.  footprint: of an orthographic picture the feature that
    stands for the size of all pixels, whatever their depth; None: a pixel's own feature says it."""
    return (WIDER_SCALE, wider_offset(level)) if footprint is None else (0.0, footprint * WIDER_SCALE + wider_offset(level))


def wider_offset(level: float) -> float:
    """Offset of the ramp of WIDER at a level whose pixels have a side of 2^level."""
    return (level - WIDER[0]) / (WIDER[1] - WIDER[0])
