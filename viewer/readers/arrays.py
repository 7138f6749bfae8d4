"""Points in memory with the interface of a file reader.  Frame and units: the caller's."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..common.errors import InputError
from .source import CHUNK, Chunk, Records, ScanInfo, Source


class ArraySource(Source):
    """xyz (N, 3), rgb (N, 3) uint8, intensity (N,) uint16 or None, scan and classification (N,) uint8 or None.

    Raises InputError naming the first array whose shape or type does not fit.
    """

    worth_keeping = False

    def __init__(self, xyz, rgb, intensity=None, scan=None, classification=None):
        self._xyz = np.asarray(xyz)
        n = len(self._xyz)
        if self._xyz.ndim != 2 or self._xyz.shape[1] != 3 or self._xyz.dtype.kind not in "fiu":
            raise InputError(f"xyz: expected (N, 3) numbers, got shape {self._xyz.shape} of {self._xyz.dtype}")
        self._rgb = _checked("rgb", rgb, (n, 3), np.uint8)
        self._intensity = None if intensity is None else _checked("intensity", intensity, (n,), np.uint16)
        self._scan = None if scan is None else _checked("scan", scan, (n,), np.uint8)
        self._classes = None if classification is None else _checked("classification", classification, (n,), np.uint8)
        numbers = 0 if self._scan is None or n == 0 else int(self._scan.max())
        infos = [ScanInfo(f"scan {i}") for i in range(numbers + 1)]
        super().__init__(Path("arrays"), "arrays", count=n, scans=infos)

    def chunks(self) -> Iterator[Chunk]:
        """Yields slices of the arrays, without copying where they are float64."""
        for start in range(0, len(self._xyz), CHUNK):
            rows = slice(start, start + CHUNK)
            intensity = None if self._intensity is None else self._intensity[rows]
            classes = None if self._classes is None else self._classes[rows]
            scan = 0 if self._scan is None else self._scan[rows]
            yield Chunk(self._xyz[rows], self._rgb[rows], intensity, scan, classification=classes)

    @property
    def has_quick_records(self) -> bool:
        return True

    def record_chunks(self) -> Iterator[Records]:
        """See Source."""
        for start in range(0, len(self._xyz), CHUNK):
            yield self.records(slice(start, start + CHUNK))

    def records(self, numbers: "np.ndarray | slice") -> Records:
        """See Source."""
        known = {"intensity": self._intensity, "classification": self._classes}
        columns = {name: values[numbers] for name, values in known.items() if values is not None}
        scan = 0 if self._scan is None else self._scan[numbers]
        return Records(self._xyz[numbers].astype(np.float64), self._rgb[numbers], scan, columns)


def _checked(name: str, array, shape: tuple[int, ...], dtype) -> np.ndarray:
    array = np.asarray(array)
    if array.shape != shape or array.dtype != dtype:
        raise InputError(f"{name}: expected {shape} {np.dtype(dtype).name}, got {array.shape} {array.dtype}")
    return np.ascontiguousarray(array)
