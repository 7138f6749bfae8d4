"""The soft z-buffer's depth tolerance: which points a pixel averages (paper, "Point Cloud Projection").

Shared by the shaders' host code and the torch reference implementation (model/projection.py); imports no torch.
"""

from dataclasses import dataclass

SOFT_RELATIVE = 1.0 / 128.0
"""Of depth.  The tolerance of ``auto``, which is at least SOFT_SPACINGS."""
SOFT_SPACINGS = 1.0
"""Of the scan's point spacing."""
PAPER_SOFT_METRES = 0.02
"""The tolerance of the paper, in metres."""
MOST_AVERAGED = 255
"""The count of points a pixel averages is stored in 8 bits; the noise level divides by at most this many."""


@dataclass(frozen=True)
class SoftZ:
    """A pixel averages the points within max(relative x zmin, absolute) behind its nearest point, at depth zmin.

    absolute: file units.  rounded: the pixel of the published code, which rounds u and v instead of truncating them.
    linear: colours are averaged in 12-bit linear light; otherwise in sRGB, as the paper's code does.
    unlit: black points have missing colour: they occlude, but are not averaged.
    """

    relative: float
    absolute: float
    rounded: bool = False
    linear: bool = False
    unlit: bool = False

    @staticmethod
    def preset(name: str, spacing: float, metre: float, *, unlit: bool = False) -> "SoftZ":
        """The tolerance of a key of viewer.settings.SOFT_Z: ``auto``, ``paper-code`` or ``paper-text``.

        spacing: point spacing, file units.  metre: file units in a metre.  unlit: ignored by the paper's presets.
        """
        if name == "auto":
            return SoftZ(SOFT_RELATIVE, SOFT_SPACINGS * spacing, linear=True, unlit=unlit)
        return SoftZ(0.0, PAPER_SOFT_METRES * metre, rounded=name == "paper-code")
