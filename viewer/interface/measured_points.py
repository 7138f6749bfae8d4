"""The measured points of a scan: values of the files, read on demand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError
from .arguments import numbers_of

if TYPE_CHECKING:
    from ..grid.records.file_records import FileRecords
    from ..grid.scene import Scene

Index = slice | int | Sequence[int] | npt.NDArray[np.integer[Any]] | npt.NDArray[np.bool_]


_PIECE = 1 << 16
"""Points whose colours are decoded at a time: a few megabytes beside the result."""


class Points:
    """The measured points of a scan, or some of them: a view that reads an array each time one is asked for.

    ``points[index]`` takes slices, whole numbers and boolean masks, and reads nothing; ``np.asarray(points)`` is ``xyz``.
    ``points["gps_time"]`` is an attribute by its name, see :attr:`attributes`.
    The order is the grid's: density layers, then place.  ``points[::100]`` thins evenly; ``points[:1000]`` is one corner.

    Values are the files' own, read back from them: coordinates exact to the file's resolution, attributes in the file's type
    and scale.  Where a file is gone or has changed, they are those of the grid, and :attr:`note` says so.  Few points are read
    one by one; many are read by one pass over the files, column by column, in a quarter of a byte a point and about 15 MB
    besides the result (measured on plant_room.laz, 11.6 million points: xyz 10.5 MB beside 278.5, intensity 14.6 beside 23.2,
    classification 15.5 beside 11.6); of formats other than LAS, LAZ and E57 a piece of the file is decoded as a whole, in more.
    """

    def __init__(self, scene: Scene, chosen: range | np.ndarray):
        self._scene, self._chosen = scene, chosen

    def __len__(self) -> int:
        return len(self._chosen)

    @overload
    def __getitem__(self, index: Index) -> Points: ...

    @overload
    def __getitem__(self, index: str) -> npt.NDArray[Any]: ...

    def __getitem__(self, index: Index | str) -> Points | npt.NDArray[Any]:
        """Some of the points, or an attribute by its name.  Raises IndexError beyond the last point, InputError where the index
        is of another kind or no file has the attribute."""
        if isinstance(index, str):
            return self.attributes[index]
        if isinstance(index, slice):
            return Points(self._scene, self._chosen[index])
        numbers = numbers_of(index, len(self))
        own = self._chosen
        return Points(self._scene, own.start + own.step * numbers if isinstance(own, range) else own[numbers])

    __iter__ = None  # a loop over single points would take hours; index with slices instead

    @property
    def xyz(self) -> npt.NDArray[np.float64]:
        """(n, 3) float64 file coordinates, exact to the file's resolution."""
        found = self._column("xyz")
        return np.zeros((len(self), 3)) if found is None else found

    @property
    def rgb(self) -> npt.NDArray[np.uint8]:
        """(n, 3) uint8 sRGB as drawn: after exposure compensation unless the scan was opened with exposures="as-scanned", by
        intensity or height where the file has no colour.  ``points["rgb"]`` are the colours of the file, uint8 or uint16."""
        from ..grid.scene import colours, let_go, packed

        made = np.empty((len(self), 3), np.uint8)
        for start in range(0, len(self), _PIECE):
            part = self[start : start + _PIECE]
            made[start : start + len(part)] = colours(packed(self._scene, part._index))
            let_go(self._scene.points)
        return made

    @property
    def intensity(self) -> npt.NDArray[Any]:
        """(n,) in the file's own type and scale (uint16 in LAS, float in most E57 and PLY), 0 where the files hold none.
        NaN where some of the files hold none."""
        return self._or_zeros("intensity", np.uint16)

    @property
    def classification(self) -> npt.NDArray[Any]:
        """(n,) codes as in ASPRS LAS (2 ground, 6 building, ...) or the file's own, 0 where the files hold none."""
        return self._or_zeros("classification", np.uint8)

    @property
    def station(self) -> npt.NDArray[np.int64]:
        """(n,) int64, the row of ``Scan.stations`` and the place in ``Scan.info["scans"]``, of any number of scans."""
        return self._records.stations(self._index)

    @property
    def attributes(self) -> Attributes:
        """The attributes of the points by name, in the file's type and scale, each (n,) or (n, k), read when it is asked for:
        "rgb", "intensity", "classification", "gps_time", "return_number", "point_source_id", ... as laspy names those of LAS;
        other fields, such as extra dimensions, by their name in the file."""
        return Attributes(self._records, self._index)

    @property
    def note(self) -> str | None:
        """None where coordinates and attributes are those of the files; else why they are the grid's, and how precise."""
        return self._records.of(self._index if len(self) < 1000 else self[:: len(self) // 1000]._index).note

    def _or_zeros(self, name: str, kind: type) -> npt.NDArray[Any]:
        found = self._column(name)
        return np.zeros(len(self), kind) if found is None else found

    def _column(self, name: str) -> npt.NDArray[Any] | None:
        return self._records.column(self._index, name)[0]

    @property
    def _records(self) -> FileRecords:
        from ..grid.records.file_records import FileRecords

        return FileRecords(self._scene)

    @property
    def _index(self) -> slice | np.ndarray:
        own = self._chosen
        if not isinstance(own, range):
            return own
        return slice(own.start, own.stop, own.step) if own.step > 0 else np.arange(own.start, own.stop, own.step)

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self.xyz, dtype)

    def __repr__(self) -> str:
        return f"<pointglass.Points: {len(self):,}>"


class Attributes(Mapping[str, npt.NDArray[Any]]):
    """Attributes of points by name; each is read from the files when it is asked for."""

    def __init__(self, records: FileRecords, index: slice | np.ndarray):
        self._records, self._index, self._known = records, index, None

    @property
    def _names(self) -> list[str]:
        if self._known is None:
            self._known = self._records.names(self._index)
        return self._known

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """Raises InputError where no file has the attribute."""
        found = self._records.column(self._index, name)[0] if isinstance(name, str) and name != "xyz" else None
        if found is None:
            raise InputError(f"points[{name!r}]: no such attribute; there are {', '.join(self._names) or 'none'}")
        return found

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"<pointglass.Attributes: {', '.join(self._names)}>"
