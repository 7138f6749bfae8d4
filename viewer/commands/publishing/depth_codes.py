"""Depth of a cube's faces as 16-bit codes in a compressed stream, which the page decodes without a canvas.

A code is the logarithm of the view-space depth z of a pixel: ``z = near * exp((code - 1) * step)``; 0: nothing is
there.  So the relative error is the same at every distance: at most :attr:`DepthScale.error`.  Codes are predicted from
their left, upper and upper left neighbours, which leaves little of a plane; the residuals are deflated (zlib).  A bit for
each pixel says whether it was measured.
"""

import zlib
from dataclasses import dataclass

import numpy as np

STEP = 1e-4
"""Relative step between two codes, at least: 0.5 mm at 5 m either way, below the range noise of terrestrial scanners (1 to
5 mm)."""
_CODES = 65534
"""Steps between the nearest and the farthest depth: 1 to 65535; 0 is no depth."""


@dataclass(frozen=True)
class DepthScale:
    """near: the depth of code 1, file units, > 0.  step: of the logarithm of depth between two codes."""

    near: float
    step: float

    @property
    def error(self) -> float:
        """The largest relative error of a decoded depth."""
        return float(np.expm1(self.step / 2))

    @staticmethod
    def of(depth: np.ndarray) -> "DepthScale":
        """The finest scale, not below STEP, that holds all depths above 0."""
        there = depth[depth > 0]
        if len(there) == 0:
            return DepthScale(1.0, STEP)
        near, far = float(there.min()), float(there.max())
        return DepthScale(near, max(STEP, float(np.log(far / near)) / _CODES))

    def codes(self, depth: np.ndarray) -> np.ndarray:
        """uint16 codes of view-space depths of any shape; 0 where the depth is 0."""
        with np.errstate(divide="ignore"):
            steps = np.rint(np.log(depth.astype(np.float64) / self.near) / self.step)
        return np.where(depth > 0, np.clip(steps, 0, _CODES) + 1, 0).astype(np.uint16)

    def depths(self, codes: np.ndarray) -> np.ndarray:
        """float64 view-space depths of codes; 0 where the code is 0."""
        return np.where(codes > 0, self.near * np.exp((codes.astype(np.float64) - 1) * self.step), 0.0)


def packed_depth(codes: np.ndarray, measured: np.ndarray) -> bytes:
    """The stream of faces.  codes: (F, S, S) uint16.  measured: (F, S, S) bool.  S is a multiple of 8.

    Deflated: the high bytes of all residuals, the low bytes, and the bits of ``measured``, most significant first.
    """
    c = codes.astype(np.int32)
    left, up, corner = np.zeros_like(c), np.zeros_like(c), np.zeros_like(c)
    left[:, :, 1:], up[:, 1:], corner[:, 1:, 1:] = c[:, :, :-1], c[:, :-1], c[:, :-1, :-1]
    difference = (c - left - up + corner).astype(np.int16).astype(np.int32)  # modulo 2**16
    zigzag = ((difference << 1) ^ (difference >> 31)).astype(np.uint16)
    parts = (zigzag >> 8).astype(np.uint8), (zigzag & 255).astype(np.uint8), np.packbits(measured.reshape(-1))
    return zlib.compress(b"".join(part.tobytes() for part in parts), 9)


def unpacked_depth(data: bytes, faces: int, side: int) -> tuple[np.ndarray, np.ndarray]:
    """(codes, measured) of :func:`packed_depth`: the reference implementation of what the page does."""
    raw = np.frombuffer(zlib.decompress(data), np.uint8)
    count = faces * side * side
    zigzag = (raw[:count].astype(np.int32) << 8) | raw[count : 2 * count]
    difference = ((zigzag >> 1) ^ -(zigzag & 1)).reshape(faces, side, side)
    codes = np.cumsum(np.cumsum(difference, axis=1), axis=2) & 0xFFFF
    measured = np.unpackbits(raw[2 * count :])[:count].astype(bool).reshape(faces, side, side)
    return codes.astype(np.uint16), measured
