"""What every source of training data offers: places with a scan to be drawn, and true pictures to be learned.

World frame: the source's own, in metres.  Camera frames are OpenGL's (x right, y up, -z forward); pinhole, square pixels, a
pixel spans [i, i + 1], row 0 at the top.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from model.common.errors import PointglassError

FAR = 1e9
"""Metres from the origin, from which on a number is no place."""
MOST_FOCAL = 1e6
"""Pixels, from which on a number is no focal length, nor anything else of a lens."""


LEAST_CROP = 32
"""Pixels: the shortest side of a training crop; the compact network halves a picture four times."""


class DataError(PointglassError):
    """Data that cannot be used; the message names the files and says what to do."""


@dataclass(frozen=True)
class Scan:
    """A merged, coloured scan.  xyz (N, 3) float64 metres; rgb (N, 3) uint8 sRGB; station (N,) uint8; places (S, 3) float64
    where the stations stood, None where the scan does not say."""

    xyz: np.ndarray
    rgb: np.ndarray
    station: np.ndarray
    places: np.ndarray | None = None


class TruePicture(Protocol):
    """A picture as it should be.  fl: pixels.  cx, cy: principal point, pixels.  camera_to_world: (4, 4) float64."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def fl(self) -> float: ...

    @property
    def camera_to_world(self) -> np.ndarray: ...

    @property
    def cx(self) -> float: ...

    @property
    def cy(self) -> float: ...

    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, sRGB."""
        ...

    def depth(self) -> np.ndarray | None:
        """(H, W) float32 z-depth in metres, +inf where nothing returned; None where unknown."""
        ...

    def coverage(self) -> np.ndarray | None:
        """(H, W) float32 share of each pixel that something covers, 0 in void and open sky; None: all of it."""
        ...

    def known(self) -> np.ndarray | None:
        """(H, W) bool, where the picture's colours are true for this scan; None: everywhere."""
        ...


class TruePlace(Protocol):
    """A place: its scan (made anew, differently spoiled, for every seed) and true pictures of it."""

    @property
    def name(self) -> str: ...

    @property
    def views(self) -> Sequence[TruePicture]: ...

    def scan(self, seed: int) -> Scan: ...


@dataclass(frozen=True, eq=False)
class MemoryPicture:
    """A TruePicture whose pixels are at hand.  Where coverage is under 1, ``colour`` is that of what covers the pixel."""

    colour: np.ndarray
    fl: float
    camera_to_world: np.ndarray
    z: np.ndarray | None = None
    covered: np.ndarray | None = None
    usable: np.ndarray | None = None
    centre: tuple[float, float] | None = None

    @property
    def width(self) -> int:
        return self.colour.shape[1]

    @property
    def height(self) -> int:
        return self.colour.shape[0]

    @property
    def cx(self) -> float:
        return self.centre[0] if self.centre else self.width / 2

    @property
    def cy(self) -> float:
        return self.centre[1] if self.centre else self.height / 2

    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, sRGB."""
        return self.colour

    def depth(self) -> np.ndarray | None:
        """(H, W) float32 or None."""
        return self.z

    def coverage(self) -> np.ndarray | None:
        """(H, W) float32 or None."""
        return self.covered

    def known(self) -> np.ndarray | None:
        """(H, W) bool or None."""
        return self.usable
