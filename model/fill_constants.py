"""Constants of the pull-push fill, shared by its shaders and model/pull_push.py; imports no torch."""

from model.network_layout import DEPTH_FEATURE_SCALE

EMPTY_FEATURE = -8.0
"""Feature of a child without weight: nearer than any, so that it hides nothing."""
FIRST_LEVEL = 2
"""The finest level that leaves anything out; at least 2, because fill_picture.comp samples level 1 plainly.  However dense the
scan, with a level of detail one point a pixel is drawn, and gaps of two pixels are chance.  From level 1 on, 0.01 to 0.04 dB
more were measured in three rooms of six."""
NEARER = (0.1, 0.2)
"""Doublings of depth between a sample and the farthest of the four at which it starts and ends to count as nearer: by
7 and 15 %."""
WIDER = (1.5, 3.0)
"""Doublings of the point spacing in a pixel of a level at which a gap starts and ends to be too wide for the surface.  Both
chosen by PSNR on atrium, kitchen, dining-room, living-room-2, staircase2 and bathroom, at all points and one in ten."""
NEARER_SCALE = 1.0 / (DEPTH_FEATURE_SCALE * (NEARER[1] - NEARER[0]))
NEARER_START = NEARER[0] / (NEARER[1] - NEARER[0])
WIDER_SCALE = 1.0 / (DEPTH_FEATURE_SCALE * (WIDER[1] - WIDER[0]))
"""Both ramps as factors and offset of depth features."""


def wider_offset(level: int) -> float:
    """Offset of the ramp of WIDER at a level: 2^level pixels a side."""
    return (level - WIDER[0]) / (WIDER[1] - WIDER[0])
