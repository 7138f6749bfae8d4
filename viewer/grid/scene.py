"""A scan for the renderer: packed points in a uniform grid, in density layers.

Frame: file coordinates (float64) are ``origin + cell_coords * cell_size`` for a cell's lower corner, plus 16-bit
fractions of the cell for a point.  The cell size is a power of two, so every one of these products is exact.

Packed point, 12 bytes: word 0 = qx | qy << 16;  word 1 = qz | attributes << 16;
word 2 = r | g << 8 | b << 16 | scan << 24.
attributes, 16 bits: intensity, or class << 8 | quantised intensity (viewer.preprocess.point_attributes).
A coordinate q in 0..65535 stands for ``cell_min + (q + 0.5) * step``, at most half a step from the measured one.
"""

import mmap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.appearance.noise import NoiseModel
from ...model.common.jit import compiled
from ...model.common.scanner_positions import MAX_STATIONS, station_positions_of
from ..preprocess.point_attributes import AttributeLayout
from ..preprocess.scan_description import NO_DESCRIPTION, ScanDescription
from ..readers.source import Source
from .marked_points import MarkedPoints
from .records.point_records import PointRecords

if TYPE_CHECKING:
    from ..picture.edits import Edits

STEPS = 65536
"""Positions of a coordinate inside a cell: 16 bits."""
CHUNK = 65536
"""Points of a chunk, which is read, checked and kept on the GPU as one piece (768 KiB); chosen by hand."""
_FEW = 65_536
"""Points below which positions are computed by NumPy: that takes 10 ms at most, and importing numba 250 ms."""
STATION_REACH = 20.0
"""Farthest distance of a scanner from the measured points, in extents of the scan.  From there the scan is 2.9 degrees wide; a
statue is scanned from a few of its heights away.  A pose of zeros in UTM coordinates lies at least 166 km away (the least
easting of a zone), over 1,600 extents of a scan of 100 m; half and twice separate the two as well."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Points by density layer, then by cell.

    points: (N, 3) uint32 packed points: an array, or a column of files that is read where its rows are indexed
        (viewer.grid.npy_column).
    cell_coords: (C, 3) int32, cells in Morton order, relative to ``origin``.
    offsets: (L*C + 1,) int64; layer k of cell c is ``points[offsets[k*C + c]:offsets[k*C + c + 1]]``.  Layer 0 is the
        coarsest.  The layers 0..k together are a uniform random subsample for every k.
    origin: (3,) float64 file coordinates, a whole multiple of ``cell_size``.
    cell_size: 2**n file units.
    layers: L.  count: N.
    spacing: file units, 1/sqrt(points per surface area), the median over the scan.
    bounds: (2, 3) float64 file coordinates, lowest and highest corner of the measured points.
    meta: what is known about the scan: its files, units, colours, scans.
    checksums: (ceil(N / CHUNK),) uint32, CRC-32 of each chunk of ``points`` as kept on disk; None where none is kept.
    parts: number of parts of the points of each layer and cell (viewer.grid.density_layers), of which the first few are
        spread as evenly as all; 1: the points are in no order.
    faces: (C, 3) uint8, how much of each cell its points cover along x, y and z (viewer.grid.projected_coverage); None in a
        folder of an earlier version.
    boxes: (C, 6) uint8, the sixteenths of each cell that its points lie in (viewer.grid.cell_boxes); None likewise.
    noise: standard deviation of a single point's colour by place and brightness, in file coordinates.  Code that shifts
        coordinates shifts ``noise.origin`` too.  None in a folder of an earlier version, where it is unknown.
    records: running numbers of the points (viewer.grid.records.point_records); None in a folder of an earlier version.
    live: the sources, where the scene was built from them in this process; else they are opened again when they are needed.
    marked: points that show another station number than ``points`` has, put in by :func:`packed` and by
        viewer.stream.chunk_source; None: none do.
    head_checksums: of the parts of the first chunk, as kept on disk (viewer.grid.checksum); None in a folder of an earlier
        version, or where ``points`` are not on disk.
    """

    points: np.ndarray
    cell_coords: np.ndarray
    offsets: np.ndarray
    origin: np.ndarray
    cell_size: float
    layers: int
    count: int
    spacing: float
    bounds: np.ndarray
    meta: ScanDescription = NO_DESCRIPTION
    checksums: np.ndarray | None = None
    parts: int = 1
    faces: np.ndarray | None = None
    boxes: np.ndarray | None = None
    noise: NoiseModel | None = None
    records: PointRecords | None = None
    live: tuple[Source, ...] = ()
    marked: MarkedPoints | None = None
    head_checksums: tuple[int, ...] | None = None

    @property
    def step(self) -> float:
        """File units between two neighbouring positions of a packed coordinate."""
        return self.cell_size / STEPS

    @property
    def station_places(self) -> np.ndarray:
        """(S, 3) float64: the first of :attr:`scan_places`, those of the scan numbers in packed points.  S is at most 255:
        later scans share a number."""
        return self.scan_places[:MAX_STATIONS]

    @property
    def scan_places(self) -> np.ndarray:
        """(K, 3) float64 file coordinates: the scanner position of each scan; NaN where it is unknown, or impossible: farther
        outside the measured points than STATION_REACH times their extent."""
        places = station_positions_of((scan.position for scan in self.meta.scans), most=None)
        reach = STATION_REACH * np.ptp(self.bounds, axis=0).max()
        with np.errstate(invalid="ignore"):
            away = (places < self.bounds[0] - reach) | (places > self.bounds[1] + reach)
        return np.where(away.any(axis=1)[:, None], np.nan, places)

    @property
    def attributes(self) -> AttributeLayout:
        """The attributes of the points besides colour and station, and the layout of their bits."""
        return self.meta.attributes

    @property
    def unlit(self) -> bool:
        """Whether black is treated as missing colour (viewer.preprocess.point_colour)."""
        return self.meta.treats_black_as_missing

    @property
    def matched(self) -> bool:
        """Whether colours differ from those in the files: by exposure compensation, or because black is treated as missing."""
        return self.unlit or self.meta.stations_matched or self.meta.runs_matched

    def hidden_stations(self, edits: "Edits") -> frozenset[int]:
        """Numbers of the stations that edits do not draw; that of the marked ghosts among them where those are hidden."""
        ghosts = {self.marked.station} if self.marked is not None and edits.ghosts == "hidden" else set()
        return frozenset(edits.hidden_stations) | ghosts

    @property
    def cell_min(self) -> np.ndarray:
        """(C, 3) float64 file coordinates of each cell's lower corner."""
        return self.origin + self.cell_coords * self.cell_size

    @property
    def layer_ends(self) -> np.ndarray:
        """(L,) int64: for each k the number of points of the layers 0 to k, which are the first ones; (0,) without a cell."""
        cells = max(len(self.cell_coords), 1)
        return np.asarray(self.offsets)[cells::cells]

    def coarse_points(self, wanted: float) -> int:
        """How many of the first points make up the fewest coarse layers that hold ``wanted`` points, or all: an even sample."""
        ends = self.layer_ends
        return int(ends[min(int(np.searchsorted(ends, wanted)), len(ends) - 1)]) if len(ends) else 0

    def coarse_points_within(self, most: float) -> int:
        """The same of as many layers as hold ``most`` points at most, and of the coarsest layer in any case."""
        ends = self.layer_ends
        return int(ends[max(int(np.searchsorted(ends, most, side="right")) - 1, 0)]) if len(ends) else 0

    def cell_of_points(self, start: int = 0, stop: int | None = None) -> np.ndarray:
        """(stop - start,) int32: the cell of each point from ``start`` to ``stop``, by default of all points."""
        edges = np.clip(self.offsets, start, self.count if stop is None else stop)
        cells = np.tile(np.arange(len(self.cell_coords), dtype=np.int32), self.layers)
        return np.repeat(cells, np.diff(edges))


def unpack(scene: Scene, index: Any = slice(None)) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Unpacks points.  index: anything that indexes a one-dimensional array of N points.

    Returns xyz (n, 3) float64 file coordinates, rgb (n, 3) uint8, intensity (n,) uint16, scan (n,) uint8.  ``attributes_of``
    gives the other attributes.
    """
    words = packed(scene, index)
    return positions(scene, words, index), colours(words), intensities(scene, words), scan_numbers(words)


@dataclass(frozen=True, eq=False)
class PointAttributes:
    """station: (n,) uint8, index into ``meta.scans``, 255 for all later ones.  classification: (n,) uint8 codes, as in ASPRS
    LAS, or None where the scan has none.  intensity: (n,) uint16 in the file's values, at most half a
    ``Scene.attributes.step`` off, or None where the scan has none."""

    station: np.ndarray
    classification: np.ndarray | None
    intensity: np.ndarray | None


def attributes_of(scene: Scene, index: Any = slice(None)) -> PointAttributes:
    """The attributes of the points at ``index``, as for ``unpack``."""
    words, layout = packed(scene, index), scene.attributes
    return PointAttributes(
        scan_numbers(words),
        layout.class_of(words[:, 1] >> 16) if layout.has_classes else None,
        intensities(scene, words) if layout.low is not None else None,
    )


def let_go(*arrays: np.ndarray | None) -> None:
    """Drops the pages of memory maps from this process's memory; their files keep them.  Mapped are large scans outside the
    cache, in a file without a name, which no other program can truncate."""
    for array in arrays:
        mapped: Any = getattr(array, "_mmap", None)
        if mapped is not None and array.mode != "c" and hasattr(mmap, "MADV_DONTNEED"):  # type: ignore[union-attr]
            mapped.madvise(mmap.MADV_DONTNEED)


def packed(scene: Scene, index: Any = slice(None)) -> np.ndarray:
    """(n, 3) uint32: the packed points at ``index``, as for ``unpack``.  Raises InputError where a file of the grid cannot
    be read, or has become shorter."""
    words = np.atleast_2d(np.asarray(scene.points[index]))
    if scene.marked is None:
        return words
    return scene.marked.marked(words, np.arange(*index.indices(scene.count)) if isinstance(index, slice)
                               else _places(scene.count, index))


def positions(scene: Scene, words: np.ndarray, index: Any = slice(None)) -> np.ndarray:
    """(n, 3) float64 file coordinates of the packed points ``words`` at ``index``."""
    if isinstance(index, slice) and index.indices(scene.count)[2] == 1:
        start, stop, _ = index.indices(scene.count)
        cells = scene.cell_of_points(start, max(start, stop))
    else:
        places = np.arange(*index.indices(scene.count)) if isinstance(index, slice) else _places(scene.count, index)
        cells = (np.searchsorted(scene.offsets, places, side="right") - 1) % len(scene.cell_coords)
    if len(words) < _FEW:
        low = (words & 0xFFFF).astype(np.float64)
        q = np.stack([low[:, 0], (words[:, 0] >> 16).astype(np.float64), low[:, 1]], axis=1)
        return scene.cell_min[cells] + (q + 0.5) * scene.step
    found = np.empty((len(words), 3))
    _fill_positions(np.ascontiguousarray(words), cells, np.ascontiguousarray(scene.cell_coords, np.int64),
                    np.asarray(scene.origin, np.float64), float(scene.cell_size), float(scene.step), found)
    return found


@compiled(nogil=True)
def _fill_positions(words, cells, coords, origin, size, step, found):
    """found: (n, 3) float64, receives the file coordinates of packed points ``words`` (n, 3) in ``cells`` (n,)."""
    for i in range(words.shape[0]):
        cell = cells[i]
        for axis in range(3):
            packed_step = (words[i, axis >> 1] >> np.uint32(16 * (axis & 1))) & np.uint32(0xFFFF)
            low = origin[axis] + coords[cell, axis] * size
            found[i, axis] = low + (np.float64(packed_step) + 0.5) * step


def colours(words: np.ndarray) -> np.ndarray:
    """(n, 3) uint8 sRGB of packed points."""
    return np.stack([words[:, 2] >> shift & 0xFF for shift in (0, 8, 16)], axis=1).astype(np.uint8)


def intensities(scene: Scene, words: np.ndarray) -> np.ndarray:
    """(n,) uint16 intensities of packed points, in the file's values; 0 where the scan has none."""
    return scene.attributes.intensity_of(words[:, 1] >> 16)


def scan_numbers(words: np.ndarray) -> np.ndarray:
    """(n,) uint8 scan numbers of packed points."""
    return (words[:, 2] >> 24).astype(np.uint8)


def _places(count: int, index) -> np.ndarray:
    """The point numbers that ``index`` selects; for an array of numbers without making a list of all points."""
    array = np.atleast_1d(np.asarray(index))
    if array.dtype.kind in "iu":
        return np.where(array < 0, array + count, array)
    return np.arange(count)[index]
