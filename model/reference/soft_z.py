"""Depth tolerance of the soft z-buffer: the points that a pixel averages (paper, "Point Cloud Projection").

Shared by the shaders' host code and the torch reference implementation (model/reference/projection.py); imports no torch.
"""

from dataclasses import dataclass, replace

SOFT_RELATIVE = 1.0 / 128.0
"""Tolerance of ``auto`` as a share of depth; SOFT_SPACINGS is its lower limit.  Half of it changes the filled picture by -0.21
to +0.02 dB, twice by -0.06 to +0.04 (model/reference/filter_constants.py says of what)."""
SOFT_SPACINGS = 1.0
"""Lower limit of the tolerance of ``auto``, in point spacings of the scan.  It counts
nearer than 128 spacings; half and twice of it change nothing in six rooms (below 0.002 dB)."""
PAPER_SOFT_METRES = 0.02
"""The tolerance of the paper, in metres."""
MAX_AVERAGED = 255
"""Largest count of averaged points: it is stored in 8 bits, and the noise level divides by the root of at most this number."""


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

    def at_distance(self, distance: float | None) -> "SoftZ":
        """The tolerance for an orthographic camera that has the scale of a pinhole at ``distance`` (file units): it does not
        grow with depth.  None: a pinhole's, unchanged."""
        return self if distance is None else replace(self, relative=0.0, absolute=max(self.relative * distance, self.absolute))

    @staticmethod
    def preset(name: str, spacing: float, metre: float, *, unlit: bool = False) -> "SoftZ":
        """The tolerance of a key of viewer.picture.settings.SOFT_Z: ``auto``, ``paper-code`` or ``paper-text``.

        spacing: point spacing, file units.  metre: file units in a metre.  unlit: ignored by the paper's presets.
        """
        if name == "auto":
            return SoftZ(SOFT_RELATIVE, SOFT_SPACINGS * spacing, linear=True, unlit=unlit)
        return SoftZ(0.0, PAPER_SOFT_METRES * metre, rounded=name == "paper-code")
