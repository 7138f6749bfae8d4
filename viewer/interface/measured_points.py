"""The measured points of a scan, decoded on demand."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .arguments import numbers_of

if TYPE_CHECKING:
    from ..grid.scene import Scene

Index = slice | int | Sequence[int] | npt.NDArray[np.integer[Any]] | npt.NDArray[np.bool_]


class Points:
    """The measured points of a scan, or some of them: a view that decodes an array each time one is asked for.

    ``points[index]`` takes slices, whole numbers and boolean masks, and decodes nothing; ``np.asarray(points)`` is ``xyz``.
    The order is the grid's: density layers, then place.  ``points[::100]`` thins evenly; ``points[:1000]`` is one corner.
    """

    def __init__(self, scene: "Scene", chosen: "range | np.ndarray"):
        self._scene, self._chosen = scene, chosen

    def __len__(self) -> int:
        return len(self._chosen)

    def __getitem__(self, index: Index) -> "Points":
        """Raises IndexError beyond the last point, InputError where the index is of another kind."""
        if isinstance(index, slice):
            return Points(self._scene, self._chosen[index])
        numbers = numbers_of(index, len(self))
        own = self._chosen
        return Points(self._scene, own.start + own.step * numbers if isinstance(own, range) else own[numbers])

    __iter__ = None  # a loop over single points would take hours; index with slices instead

    @property
    def xyz(self) -> npt.NDArray[np.float64]:
        """(n, 3) float64 file coordinates, each at most half a step from the measured one; a step is 1/65536 of a grid cell."""
        from ..grid.scene import packed, positions

        return positions(self._scene, packed(self._scene, self._index), self._index)

    @property
    def rgb(self) -> npt.NDArray[np.uint8]:
        """(n, 3) uint8 sRGB, after exposure compensation unless the scan was opened with exposures="as-scanned"."""
        from ..grid.scene import colours, packed

        return colours(packed(self._scene, self._index))

    @property
    def intensity(self) -> npt.NDArray[np.uint16]:
        """(n,) uint16, 0 where the file holds none."""
        from ..grid.scene import intensities, packed

        return intensities(self._scene, packed(self._scene, self._index))

    @property
    def station(self) -> npt.NDArray[np.uint8]:
        """(n,) uint8, the row of ``Scan.stations`` and the place in ``Scan.info["scans"]``."""
        from ..grid.scene import packed, scan_numbers

        return scan_numbers(packed(self._scene, self._index))

    @property
    def _index(self) -> "slice | np.ndarray":
        own = self._chosen
        if not isinstance(own, range):
            return own
        return slice(own.start, own.stop, own.step) if own.step > 0 else np.arange(own.start, own.stop, own.step)

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self.xyz, dtype)

    def __repr__(self) -> str:
        return f"<pointglass.Points: {len(self):,}>"
