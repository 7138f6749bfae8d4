"""Splats of the points in sight: the points are gathered, sorted into an octree, and a budget of its cells become splats.

Frame: file coordinates relative to ``Splats.origin``, file units.  Colours are those of the scene: after exposure
compensation, and without those that are missing.
"""

from dataclasses import dataclass

import numpy as np

from ...common.errors import InputError
from ...common.progress import progress
from ..comparing.cloud_scale import scale_of
from ..selecting.empty_selection import empty_selection
from ..selection import Selection
from .splat_budget import NEAR, centres_of, choose, distances, errors_of
from .splat_cells import Level, levels_of
from .splat_cloud import Splats
from .splat_shapes import shapes_of
from .view_colours import CELL, view_colours

MOST_POINTS = 24_000_000
"""Points that are held at a time: 1.5 GB of memory with their order.  Of more a random part is used."""
CELLS_PER_SPLAT = 4
"""Cells of the finest level for each splat of the budget: those a picture needs are chosen among them."""
CLOSE = 1000.0
"""Coordinates up to which files keep those of the scan: float32 then has 0.06 mm, of metres."""
_GREY = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True, eq=False)
class Gathered:
    """xyz: (n, 3) float64 file coordinates.  coloured: (n, 4) uint8, sRGB and 1 where the point has a colour.  station:
    (n,) uint8, rows of Scene.station_places.  share: of the points in sight, 0..1."""

    xyz: np.ndarray
    coloured: np.ndarray
    station: np.ndarray
    share: float


def gather(selection: Selection, most: int = MOST_POINTS) -> Gathered:
    """The points in sight, at random where there are more than ``most``: the same ones each time."""
    rng = np.random.default_rng(0)
    places: list[np.ndarray] = []
    tints: list[np.ndarray] = []
    stands: list[np.ndarray] = []
    ranks: list[np.ndarray] = []
    share, held = 1.0, 0
    for block in selection.blocks("reading"):
        rank = rng.random(len(block.xyz), np.float32)
        kept = rank < share
        tint = np.empty((int(kept.sum()), 4), np.uint8)
        tint[:, :3] = block.rgb[kept]
        tint[:, 3] = tint[:, :3].any(axis=1) if selection.scene.unlit else 1
        places.append(block.xyz[kept])
        tints.append(tint)
        stands.append(block.station[kept])
        ranks.append(rank[kept])
        held += len(tint)
        while held > most:
            share /= 2
            for number, rank in enumerate(ranks):
                keep = rank < share
                places[number], tints[number], ranks[number] = places[number][keep], tints[number][keep], rank[keep]
                stands[number] = stands[number][keep]
            held = sum(len(rank) for rank in ranks)
    if not held:
        raise empty_selection(selection)
    return Gathered(np.concatenate(places), np.concatenate(tints), np.concatenate(stands), share)


def splats_of(selection: Selection, budget: int) -> tuple[Splats, Gathered]:
    """At most ``budget`` splats of the points in sight, and these points.

    Raises InputError where there are none, or where coordinates are degrees.
    """
    scene = selection.scene
    if scene.meta.in_degrees:
        raise InputError("splats need coordinates with a unit of length, these are degrees", file=scene.meta.title,
                         remedy="export the scan with --reproject auto first, and splats from that file")
    points = gather(selection)
    stations, noise = scene.station_places, scene.noise
    found = splats_of_points(points.xyz, points.coloured, budget, stations,
                             None if noise is None or not noise.neighbourhoods else noise.at, station=points.station)
    return found, points


def splats_of_points(xyz: np.ndarray, coloured: np.ndarray, budget: int, viewpoints: np.ndarray, colour_noise=None, *,
                     station: np.ndarray | None = None) -> Splats:  # fmt: skip
    """At most ``budget`` splats of points.

    xyz: (n, 3) float64, n >= 1.  coloured: (n, 4) uint8, sRGB and 1 where the point has a colour.  viewpoints: (s, 3), where
    scanners stood, NaN where unknown.  station: (n,) their rows, by which colours change with the direction of view; None: they
    do not.  colour_noise: gives the (k,) standard deviations of luma at places (k, 3) for points of luma (k,), as
    NoiseModel.at; None: colours have no noise.
    """
    low, high = xyz.min(axis=0), xyz.max(axis=0)
    local = xyz - low
    scale = scale_of(local)
    side = scale.fine or scale.spacing or float((high - low).max()) / 1024 or 1e-3
    with progress(0, "sorting", "point"):
        levels = levels_of(local, coloured, side, CELLS_PER_SPLAT * budget)
    noises = [np.zeros(len(level)) if colour_noise is None else _noise_of(level, low, colour_noise) for level in levels]
    stands = viewpoints[np.isfinite(viewpoints).all(axis=1)] - low
    reach = 1.0
    if len(stands):
        reach = max(NEAR * float(np.median(distances(centres_of(levels[0]), stands))), 1e-9)
    errors = [errors_of(level, stands, reach, scale.noise, noise) for level, noise in zip(levels, noises)]
    chosen = choose(levels, errors, budget)
    origin = np.zeros(3) if max(np.abs(low).max(), np.abs(high).max()) <= CLOSE else np.round((low + high) / 2)
    parts = []
    with progress(sum(len(some.cells) for some in chosen), "splats", "splat") as meter:
        for some in chosen:
            level = levels[some.level]
            made = shapes_of(levels, some, scale.noise, noises[some.level][some.cells], scale.spacing or side, meter)
            parts.append((made.centre + (low - origin), made.deviations, _quaternions(made.axes), made.rgb, made.opacity,
                          level.places[some.cells, 0]))
    centre, deviations, rotation, rgb, opacity, counts = (np.concatenate(column) for column in zip(*parts))
    turning = None
    if station is not None:
        with progress(0, "view dependence", "splat"):
            turning = view_colours(xyz, coloured, station, viewpoints, CELL * (scale.spacing or side), centre + origin)
    if turning is not None:
        rgb = rgb - turning.offset
    return Splats(centre, np.maximum(deviations, 1e-9).astype(np.float32), rotation.astype(np.float32), rgb.astype(np.float32),
                  opacity.astype(np.float32), counts.astype(np.uint32), origin, None if turning is None else turning.slope)


def _noise_of(level: Level, low: np.ndarray, colour_noise) -> np.ndarray:
    return np.asarray(colour_noise(centres_of(level) + low, level.colours[:, 4:7] @ _GREY), np.float64)


def _quaternions(axes: np.ndarray) -> np.ndarray:
    """(k, 4) w, x, y, z of rotation matrices (k, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(axes).as_quat()[:, [3, 0, 1, 2]]
