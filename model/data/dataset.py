"""The interface of training data: places with a scan and true pictures (ground truth) of it.

World frame: the source's own, in metres.  Camera frames are OpenGL's (x right, y up, -z forward); pinhole, square pixels, a
pixel spans [i, i + 1], row 0 at the top.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

FAR = 1e9
"""Metres from the origin beyond which a coordinate is invalid: 25 times round the Earth, beyond any projected coordinate."""
MAX_FOCAL = 1e6
"""Pixels beyond which a focal length or another lens parameter is invalid: a picture 10,000 pixels wide would show 0.6
degrees."""
MIN_CROP = 32
"""Shortest side of a training crop, pixels: twice the 16 pixels to which the compact network pads a picture (four halvings),
and the least for which augmentation has a texture."""
_LONGEST_REASON = 300  # characters of a library's error in a message: three rows of a terminal 100 columns wide


def reason(error: Exception) -> str:
    """An error in a few words for a message: its text, with its class where the text alone tells little (KeyError)."""
    text = str(error) if isinstance(error, (OSError, ValueError)) else repr(error)
    return text if len(text) <= _LONGEST_REASON else f"{text[:_LONGEST_REASON]}..."


@dataclass(frozen=True)
class MergedScan:
    """A merged, coloured scan.

    xyz: (N, 3) float64 metres.  rgb: (N, 3) uint8 sRGB.  station: (N,) uint8.  places: (S, 3) float64 scanner positions, None
    where they are unknown.
    """

    xyz: np.ndarray
    rgb: np.ndarray
    station: np.ndarray
    places: np.ndarray | None = None


class TruePicture(Protocol):
    """A true picture.  name: of its file, without the ending; "" where it has none.  fl: focal length, pixels.  cx, cy:
    principal point, pixels.  camera_to_world: (4, 4) float64."""

    @property
    def name(self) -> str: ...

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
        """(H, W) float32 covered share of each pixel, 0 in the background and open sky; None: 1 everywhere."""
        ...

    def known(self) -> np.ndarray | None:
        """(H, W) bool, pixels whose colours are valid for this scan; None: all."""
        ...


class TruePlace(Protocol):
    """A place: true pictures of it, and its scan, degraded differently for every seed."""

    @property
    def name(self) -> str: ...

    @property
    def views(self) -> Sequence[TruePicture]: ...

    def scan(self, seed: int) -> MergedScan: ...


@dataclass(frozen=True, eq=False)
class MemoryPicture:
    """A TruePicture in memory.  Where coverage is below 1, ``colour`` is the colour of the covered share."""

    colour: np.ndarray
    fl: float
    camera_to_world: np.ndarray
    z: np.ndarray | None = None
    covered: np.ndarray | None = None
    usable: np.ndarray | None = None
    centre: tuple[float, float] | None = None
    name: str = ""

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
