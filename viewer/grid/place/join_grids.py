"""Joins grids into one scene: one table of cells, points and running numbers read from each grid's files.

All grids have cells of one size, on one lattice (each origin is a whole multiple of the cell size), so a packed position
means the same everywhere and no coordinate is rounded again.  Layers are counted from the finest: a layer holds the same
share of the points of each grid.  Frame: file coordinates, which the files are taken to share.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import InputError
from ...preprocess.point_attributes import AttributeLayout
from ...preprocess.scan_table import MOST_NUMBERS
from ..checksum import checked_parts
from ..density_layers import PARTS
from ..scene import Scene
from .joined_facts import attribute_tables, joined_facts
from .joined_noise import joined_noise
from .joined_points import JoinedPoints, PieceTable, PointChange
from .joined_records import JoinedRecords

_REACH = 1 << 30
"""Farthest cell from the first, so that cell numbers fit int32."""


def joined(scenes: Sequence[Scene], folders: Sequence[Path | None],
           gains: Sequence[np.ndarray | None] | None = None, missing_black: Sequence[bool] | None = None) -> Scene:
    """One scene of the grids in ``folders``, read as ``scenes``.  None in place of a folder: the grid is in memory only.

    gains: for each grid (S, 3) factors of the sRGB values of its stations, None where
    they are 1; None: of all grids.  missing_black: for each grid whether black
    is no colour; None: as the grid has decided.  Raises InputError where the grids have cells of different sizes, or lie too
    far apart.
    """
    size = scenes[0].cell_size
    places = [folder or Path(scene.meta.title) for scene, folder in zip(scenes, folders)]
    for scene, place in zip(scenes, places):
        if scene.cell_size != size:
            raise InputError(f"has cells of {scene.cell_size:g}, and {places[0].name} of {size:g}: they cannot be one scene",
                             file=place, remedy="convert their scans together, or give the scans themselves")
        if scene.records is None or scene.checksums is None or scene.parts != PARTS:
            raise InputError("was made by an earlier version and cannot be part of a scene of several grids", file=place,
                             remedy="convert the scan again")
    bases = np.array([np.rint(scene.origin / size) for scene in scenes])
    base = bases.min(axis=0)
    if (bases - base).max() > _REACH:
        far = int((bases - base).max(axis=1).argmax())
        raise InputError(f"lies too far from {places[0].name} to be in one scene", file=places[far],
                         remedy="open each place by itself")
    layers = max(scene.layers for scene in scenes)
    offsets = [np.concatenate([np.zeros((layers - scene.layers) * len(scene.cell_coords), np.int64), scene.offsets])
               for scene in scenes]
    edges = np.stack([of_grid[:: (len(of_grid) - 1) // layers] for of_grid in offsets], axis=1)
    table = PieceTable(edges, [len(scene.cell_coords) for scene in scenes])
    sizes = [np.diff(of_grid).reshape(layers, -1) for of_grid in offsets]
    ends = np.concatenate([[0], np.cumsum(np.concatenate(sizes, axis=1).reshape(-1))])
    meta, first_stations = joined_facts(scenes)
    points: Any = JoinedPoints(
        table, [folder / "points.npy" if folder else scene.points for scene, folder in zip(scenes, folders)],
        [checked_parts(scene) for scene in scenes],
        point_changes([scene.attributes for scene in scenes], first_stations, gains,
                      missing_black or [scene.unlit for scene in scenes]),
        first_stations,
    )  # fmt: skip
    records = JoinedRecords(
        table, [scene.records for scene in scenes if scene.records is not None],
        [record_files(folder) if folder else _record_columns(scene) for scene, folder in zip(scenes, folders)],
    )  # fmt: skip
    coords = np.concatenate([scene.cell_coords + (own - base).astype(np.int32) for scene, own in zip(scenes, bases)])
    corners = np.stack([scene.bounds for scene in scenes])
    bounds = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
    return Scene(
        points, np.ascontiguousarray(coords, np.int32), ends, base * size, size, layers, int(ends[-1]), _spacing(scenes),
        bounds, meta, None, PARTS, _rows([scene.faces for scene in scenes]), _rows([scene.boxes for scene in scenes]),
        joined_noise([scene.noise for scene in scenes], [scene.count for scene in scenes], bounds), records,
    )  # fmt: skip


def record_files(folder: Path) -> tuple[Any, Any]:
    """Of the running numbers of a grid: the lower 32 bits and those above."""
    return folder / "records.npy", folder / "records_high.npy"


def _record_columns(scene: Scene) -> tuple[Any, Any]:
    """The same of a grid in memory."""
    assert scene.records is not None
    return scene.records.low, scene.records.high


def point_changes(layouts: Sequence[AttributeLayout], first_stations: Sequence[int],
                  gains: Sequence[np.ndarray | None] | None, black: Sequence[bool]) -> list[PointChange]:
    """What makes the points of each grid those of the place.  layouts: of the grids' attributes.  Others as for
    :func:`joined`."""
    bits = attribute_tables(layouts)
    return [
        PointChange(min(first_stations[k], MOST_NUMBERS - 1), bits[k], _colour_table(gains[k] if gains else None),
                    any(black) and not black[k])
        for k in range(len(layouts))
    ]  # fmt: skip


def _colour_table(gains: np.ndarray | None) -> np.ndarray | None:
    """(S, 3, 256) uint32 colours by gains (S, 3); black and white stay what they are: missing and clipped colours."""
    if gains is None:
        return None
    scaled = np.rint(np.arange(256) * gains[:, :, None].astype(np.float32))
    scaled[:, :, 1:] = np.clip(scaled[:, :, 1:], 1, 255)  # a dark colour does not become a missing one
    return scaled.astype(np.uint32)


def _rows(columns: Sequence[np.ndarray | None]) -> np.ndarray | None:
    known = [column for column in columns if column is not None]
    return np.concatenate(known) if len(known) == len(columns) else None


def _spacing(scenes: Sequence[Scene]) -> float:
    """The median of the grids' spacings, each counted by its points."""
    spacing, count = (np.array(values) for values in zip(*((scene.spacing, scene.count) for scene in scenes)))
    order = np.argsort(spacing)
    total = np.cumsum(count[order])
    return float(spacing[order][np.searchsorted(total, total[-1] / 2)])
