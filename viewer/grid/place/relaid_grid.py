"""Lays the points of a grid again, in cells of another size, so that grids made by ``convert`` can be opened as one place.

What is read is the grid, not its scan, which may be gone: layers, colours, attributes and running numbers stay, and a point
moves by half a step of the new cells at most.  The result is kept in the cache.  Frame: file coordinates; ``step`` numbers are
whole packed steps from the origin of coordinates.
"""

import logging
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.paths import cache_dir
from ...common.progress import progress
from ...readers.grid_folder import META
from .. import cache as stored
from ..building.grid_threads import processors
from ..cell_boxes import SHARE_BITS, SHARES, boxes_of
from ..density_layers import PART_EXTRA, PART_OF, PARTS, morton_order
from ..projected_coverage import projected_coverage
from ..records.point_records import PointRecords, allocated
from ..scene import STEPS, Scene

_log = logging.getLogger(__name__)
_BATCH = 1 << 20
"""Points that are laid together, about: 150 MB."""
_BITS = STEPS.bit_length() - 1


def with_cells(scene: Scene, folder: Path, size: float) -> tuple[Scene, Path]:
    """The grid in ``folder``, read as ``scene``, with cells of ``size``, and the folder that has it: ``folder`` where it has
    such cells already.  Raises InputError where its points are damaged, or an earlier version made it, which kept no running
    numbers."""
    if scene.records is None or scene.checksums is None:
        raise InputError("was made by an earlier version and cannot be part of a scene of several grids", file=folder,
                         remedy="convert the scan again")
    if scene.cell_size == size and scene.parts == PARTS:
        return scene, folder
    source, kept = folder / META, stored.folder_of([folder / META])
    kept = cache_dir() / f"{kept.name}-c{round(math.log2(size))}"
    found = stored.load(kept, [source])
    if found is None:
        _log.warning("%s: has cells of %g, and is laid again in cells of %g; its points move by at most %.2g",
                     folder, scene.cell_size, size, size / STEPS / 2)
        if not np.array_equal(stored.checksums(scene.points)[0], scene.checksums):
            raise InputError("damaged grid (its points do not match their checksums)", file=folder,
                             remedy="convert the scan again")
        found = stored.build_into(kept, [source], lambda _, allocate, folder: _laid(scene, size, allocate), keep_old=False)
    return found, kept


@dataclass(frozen=True, eq=False)
class _Batch:
    """Points of whole cells of the new grid, which no other batch has points of.  index: (n,) in the scene.  layer: (n,).
    cell: (n,) index into ``cells`` (c, 3), numbers of new cells from the origin of coordinates.  within: (n, 3) uint32
    packed positions in them."""

    index: np.ndarray
    layer: np.ndarray
    cell: np.ndarray
    cells: np.ndarray
    within: np.ndarray


def _laid(scene: Scene, size: float, allocate: Callable[..., np.ndarray]) -> Scene:
    shift, layers = round(math.log2(size / scene.cell_size)), scene.layers
    groups = _groups(scene, max(shift, 0))
    cells, sizes = [], []
    with progress(2 * scene.count, "laying the grid again", " points") as meter:
        for batch in _batches(scene, shift, groups):
            counts = np.bincount(batch.layer * len(batch.cells) + batch.cell, minlength=layers * len(batch.cells))
            cells.append(batch.cells)
            sizes.append(counts.reshape(layers, -1))
            meter.update(len(batch.index))
        every = np.concatenate(cells)
        base = every.min(axis=0)
        if (every - base).max() >= 1 << 31:
            raise InputError(f"is too wide for cells of {size:g}, which the other grids have", remedy="open it by itself")
        order = morton_order(every - base)
        offsets = np.concatenate([[0], np.concatenate(sizes, axis=1)[:, order].reshape(-1).cumsum()])
        number = np.empty(len(order), np.int64)  # of the cells, as they come in the batches
        number[order] = np.arange(len(order))
        assert scene.records is not None
        records = allocated(allocate, scene.count, int(scene.records.first[-1]), len(scene.records.first) - 1)
        points, marks = allocate("points", (scene.count, 3), np.uint32), np.zeros(len(order), np.int64)
        done = 0
        for batch in _batches(scene, shift, groups):
            _place(scene, batch, number[done : done + len(batch.cells)], offsets, points, records, marks)
            done += len(batch.cells)
            meter.update(len(batch.index))
    records = replace(records, first=scene.records.first, scans=scene.records.scans)
    with ThreadPoolExecutor(processors(), "grid") as pool:
        faces = projected_coverage(points, offsets, layers, pool)
    return replace(
        scene, points=points, cell_coords=(every[order] - base).astype(np.int32), offsets=offsets, origin=base * size,
        cell_size=size, checksums=None, parts=PARTS, faces=faces, boxes=boxes_of(marks[None]), records=records,
    )  # fmt: skip


def _groups(scene: Scene, merged: int) -> list[np.ndarray]:
    """Cells of the scene, in groups of about _BATCH points; those in one cell of 2**merged times the side are
    together."""
    coords = (scene.cell_coords + np.rint(scene.origin / scene.cell_size).astype(np.int64)) >> merged
    order = np.lexsort(coords.T)
    sizes = np.diff(scene.offsets).reshape(scene.layers, -1).sum(axis=0)[order]
    new = np.r_[True, (coords[order[1:]] != coords[order[:-1]]).any(axis=1)]
    starts = np.flatnonzero(new)
    before = np.r_[0, sizes.cumsum()][starts] // _BATCH
    return np.split(order, starts[1:][np.diff(before) > 0])


def _batches(scene: Scene, shift: int, groups: list[np.ndarray]) -> Iterator[_Batch]:
    """The points of the groups.  shift: the new side of a cell is 2**shift times that of the scene."""
    base, count = np.rint(scene.origin / scene.cell_size).astype(np.int64), len(scene.cell_coords)
    for rows in groups:
        runs = (np.arange(scene.layers)[:, None] * count + rows).reshape(-1)
        sizes = scene.offsets[runs + 1] - scene.offsets[runs]
        ends = np.r_[0, sizes.cumsum()]
        index = np.repeat(scene.offsets[runs] - ends[:-1], sizes) + np.arange(ends[-1])
        words = scene.points[index]
        at = np.tile(scene.cell_coords[rows] + base, (scene.layers, 1)).repeat(sizes, axis=0) << _BITS
        at |= np.stack([words[:, 0] & 0xFFFF, words[:, 0] >> 16, words[:, 1] & 0xFFFF], axis=1)
        # the middle of a step: with smaller cells it lies between two steps, and the upper one is taken
        at = at >> shift if shift >= 0 else (at << -shift) + (1 << (-shift - 1))
        cells, cell = _distinct(at >> _BITS)
        layer = np.repeat(np.arange(scene.layers), len(rows)).repeat(sizes)
        yield _Batch(index, layer, cell, cells, (at & (STEPS - 1)).astype(np.uint32))


def _distinct(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The different rows of (n, 3) int64, and the number among them of each."""
    low = cells.min(axis=0)
    spans = np.ptp(cells, axis=0) + 1
    if math.prod(spans.tolist()) >= 1 << 62:
        found, number = np.unique(cells, axis=0, return_inverse=True)
        return found, number.reshape(-1)
    relative = cells - low
    _, first, number = np.unique((relative[:, 0] * spans[1] + relative[:, 1]) * spans[2] + relative[:, 2], return_index=True,
                                 return_inverse=True)
    return cells[first], number


def _place(scene: Scene, batch: _Batch, number: np.ndarray, offsets: np.ndarray, points: np.ndarray, records: PointRecords,
           marks: np.ndarray) -> None:
    """Writes the points of a batch to their places, in the order of viewer.grid.density_layers.  number: (c,) of its cells."""
    assert scene.records is not None
    count = (len(offsets) - 1) // scene.layers
    running, run = scene.records.numbers(batch.index), batch.layer * count + number[batch.cell]
    order = np.lexsort((running, run))
    run, running = run[order], running[order]
    first = np.r_[True, run[1:] != run[:-1]]
    rank = np.arange(len(run)) - np.flatnonzero(first)[first.cumsum() - 1]
    size, part = offsets[run + 1] - offsets[run], PART_OF[rank % PARTS]
    place = offsets[run] + size // PARTS * part + PART_EXTRA[size % PARTS, part] + rank // PARTS
    words, within = scene.points[batch.index[order]], batch.within[order]
    words[:, 0] = within[:, 0] | within[:, 1] << np.uint32(16)
    words[:, 1] = within[:, 2] | words[:, 1] & np.uint32(0xFFFF0000)
    points[place] = words
    records.low[place] = (running & 0xFFFFFFFF).astype(np.uint32)
    if records.high is not None:
        records.high[place] = (running >> 32).astype(np.uint8)
    sixteenth = (within >> np.uint32(_BITS - SHARE_BITS)).astype(np.int64)
    bits = sum(np.int64(1) << sixteenth[:, axis] + SHARES * axis for axis in range(3))
    np.bitwise_or.at(marks, number[batch.cell[order]], bits)
