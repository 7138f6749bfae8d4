"""Which points of a scene a person selects, and the sets that come of it.

A selection is made of the grid's points, which are in sight, and kept as records of the files (viewer.picture.point_sets).
Frame: file coordinates, float64; outlines in pixels of the picture of a camera.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import in_rows
from ...common.progress import progress
from ...grid.gathered_rows import points_of
from ...grid.records.point_marks import file_keys, marks_of
from ...grid.scene import packed, positions, scan_numbers
from ...picture.clip import Box, normals
from ...picture.edits import Edits
from ...picture.point_sets import PointSet
from ..places.pick import surface_end
from ..selection import Selection

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera

HOW = {"new": "these points alone are selected", "add": "they are selected too (hold Shift)",
       "subtract": "they are selected no more (hold Ctrl)"}  # fmt: skip
"""What becomes of the selection there is."""
TILE = 8.0
"""Pixels: side of the tiles of a picture that are inside or outside an outline as a whole."""
_PIECE = 1 << 22
"""Points between two reports of progress: about 40 ms of a processor."""
_BLOCK = 1 << 20


@dataclass(frozen=True, eq=False)
class Selected:
    """A selection and what is known of it.  bounds: (2, 3) lowest and highest corner, as the grid has its points; None where it
    is empty."""

    points: PointSet
    bounds: np.ndarray | None


def inside_outline(pixels: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(n,) bool: which pixels lie in an outline, by the even-odd rule.  pixels: (n, 2).  corners: (k, 2), in order.

    The reference implementation of select_kernels.in_outline."""
    (u, v), inside = pixels.T, np.zeros(len(pixels), bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        crosses = (y0 > v) != (y1 > v)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= crosses & (u > x0 + (v - y0) / (y1 - y0) * (x1 - x0))
    return inside


def by_outline(scene: "Scene", camera: "Camera", corners: np.ndarray) -> np.ndarray:
    """(N,) bool: the points whose pixel lies in an outline, near or far.  corners: (k, 2) pixels of the camera's picture."""
    from .select_kernels import in_outline

    corners = np.asarray(corners, np.float64)
    tiles, corner = _tiles(corners)
    edges = np.ascontiguousarray(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    return _run(scene, in_outline, scene.origin - camera.position, np.ascontiguousarray(camera.view_rotation), lens,
                camera.orthographic or 0.0, _possible(scene, camera, corners), corner, TILE, tiles, edges)


def not_covered(scene: "Scene", camera: "Camera", hits: np.ndarray, depth: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(N,) bool: those of ``hits`` that a picture shows; changes ``hits``.

    camera: at the size of the picture.  depth: (h, w) float32 view-space depth of its pixels.  mask: (h, w) bool, where the
    filter kept them.  A point is shown where its pixel was kept and its depth is that of the pixel, as far behind as points of
    one surface may be."""
    height, width = depth.shape
    with progress(scene.count, "Looking at what is covered", "point") as meter:
        for start in range(0, scene.count, _BLOCK):
            index = start + np.flatnonzero(hits[start : start + _BLOCK])
            pixels, away = camera.project(positions(scene, packed(scene, index), index))
            inside = (away > 0) & (pixels >= 0).all(axis=1) & (pixels < (width, height)).all(axis=1)
            column, row = np.where(inside[:, None], pixels, 0.0).astype(int).T
            front = depth[row, column]
            hits[index] = inside & mask[row, column] & (away <= surface_end(front, camera, scene.spacing))
            meter.update(min(_BLOCK, scene.count - start))
    return hits


def in_box(scene: "Scene", box: Box) -> np.ndarray:
    """(N,) bool: the points inside a box; its faces are inside."""
    from .select_kernels import between_planes

    return _run(scene, between_planes, scene.origin - np.array(box.centre), normals(box), -np.ones(3), np.ones(3))


def beside_plane(scene: "Scene", place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(N,) bool: the points on the side of a plane to which its normal points, and in it."""
    from .select_kernels import between_planes

    rows = np.ascontiguousarray(normal, np.float64)[None]
    return _run(scene, between_planes, scene.origin - place, rows, np.zeros(1), np.full(1, np.inf))


def in_sight(sight: Selection, hits: np.ndarray) -> np.ndarray:
    """(N,) bool: those of ``hits`` that are drawn; changes ``hits``."""
    if sight.everything:
        return hits
    scene = sight.scene
    with progress(scene.count, "Looking at what is hidden", "point") as meter:
        for start in range(0, scene.count, _BLOCK):
            index = start + np.flatnonzero(hits[start : start + _BLOCK])
            if len(index):
                words = packed(scene, index)
                hits[index] = sight.keeps(positions(scene, words, index), scan_numbers(words), index)
            meter.update(min(_BLOCK, scene.count - start))
    return hits


def combined(scene: "Scene", edits: Edits, hits: np.ndarray, how: str) -> Selected:
    """The selection of ``edits`` with the points of ``hits``, (N,) bool, as a key of HOW says.  Raises InputError where the
    grid does not tell which records its points are."""
    files = file_keys(scene)
    assert scene.records is not None
    mask = np.zeros(int(scene.records.first[-1]), bool)
    for start in range(0, scene.count, _BLOCK):
        some = slice(start, min(start + _BLOCK, scene.count))
        mask[scene.records.numbers(some)] = hits[some]
    if how != "new":
        before = edits.selection.mask(files)
        mask = before | mask if how == "add" else before & ~mask
    return described(scene, edits, PointSet.of(mask, files), mask)


def described(scene: "Scene", edits: Edits, points: PointSet, mask: np.ndarray | None = None) -> Selected:
    """A set with its bounds.  The marks of a picture in which it is selected are made as well, so that drawing need not wait
    for them.  mask: of the set, by record."""
    from .select_kernels import lowest_and_highest

    records = scene.records
    mask = points.mask(file_keys(scene)) if mask is None else mask
    assert records is not None
    if not points:
        return Selected(points, None)
    chosen = np.empty(scene.count, bool)
    for start in range(0, scene.count, _BLOCK):
        some = slice(start, min(start + _BLOCK, scene.count))
        chosen[some] = mask[records.numbers(some)]
    ends = np.array([np.inf] * 3 + [-np.inf] * 3)
    coords = np.asarray(scene.cell_coords)
    for base, stop, some, offsets in pieces(scene):
        words = points_of(scene, some.start, some.stop)
        lowest_and_highest(words, offsets, coords, scene.cell_size, chosen[some], ends, base, 0, stop - base)
    marks_of(scene, replace(edits, selection=points))
    return Selected(points, scene.origin + ends.reshape(2, 3) if np.isfinite(ends).all() else None)


def _run(scene: "Scene", kernel, shift: np.ndarray, *arguments) -> np.ndarray:
    """The hits of a kernel, with progress; on all processors."""
    coords, hits, shift = np.asarray(scene.cell_coords), np.zeros(scene.count, bool), np.asarray(shift, np.float64)
    with progress(scene.count, "Selecting", "point") as meter:
        for base, stop, some, offsets in pieces(scene):
            in_rows(stop - base, 64, kernel, points_of(scene, some.start, some.stop), offsets, coords, scene.cell_size, shift,
                    *arguments, hits[some], base)  # fmt: skip
            meter.update(some.stop - some.start)
    return hits


def pieces(scene: "Scene") -> Iterator[tuple[int, int, slice, np.ndarray]]:
    """(first run, run after the last, the numbers of its points, offsets from its first point) of pieces of _PIECE points."""
    offsets = np.asarray(scene.offsets)
    base, runs = 0, len(offsets) - 1
    while base < runs:
        stop = min(max(int(np.searchsorted(offsets, offsets[base] + _PIECE, side="right")) - 1, base + 1), runs)
        yield base, stop, slice(int(offsets[base]), int(offsets[stop])), offsets - offsets[base]
        base = stop


def _tiles(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) uint8 of the tiles around an outline, and (2,) the corner of the first."""
    from .select_kernels import EDGE, INSIDE, OUTSIDE

    corner = np.floor(corners.min(axis=0) / TILE) * TILE - TILE
    columns, rows = (np.floor((corners.max(axis=0) - corner) / TILE) + 2).astype(int)
    middles = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    tiles = np.where(inside_outline(corner + (middles + 0.5) * TILE, corners), INSIDE, OUTSIDE).astype(np.uint8)
    tiles = tiles.reshape(rows, columns)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = np.linspace(0.0, 1.0, int(np.ceil(np.linalg.norm(b - a) / (TILE / 2))) + 2)[:, None]
        at = np.floor((a + along * (b - a) - corner) / TILE).astype(int)
        for x in (-1, 0, 1):
            for y in (-1, 0, 1):
                tiles[np.clip(at[:, 1] + y, 0, rows - 1), np.clip(at[:, 0] + x, 0, columns - 1)] = EDGE
    return tiles, corner


def _possible(scene: "Scene", camera: "Camera", corners: np.ndarray) -> np.ndarray:
    """(C,) bool: cells of which some point may lie in an outline; those that reach behind the camera may."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    lowest, highest = np.full((len(scene.cell_coords), 2), np.inf), np.full((len(scene.cell_coords), 2), -np.inf)
    behind, ahead = np.zeros(len(lowest), bool), np.zeros(len(lowest), bool)
    for corner in range(8):
        pixels, depth = camera.project(scene.cell_min + scene.cell_size * np.array([corner >> k & 1 for k in range(3)]))
        behind |= ~(depth > 0)
        ahead |= depth > 0
        lowest, highest = np.fmin(lowest, pixels), np.fmax(highest, pixels)
    apart = (highest < low - 1).any(axis=1) | (lowest > high + 1).any(axis=1)
    return ahead & (behind | ~apart)
