"""Difficult points: many in one pixel, one in a million pixels, duplicates, NaN and infinity, all colour levels; and repeated
frames.

Rows as in :mod:`frame_claims`.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from frame_claims import place_at
from scenes import axis_camera
from station_claims import scanned

from pointglass.model.common.linear_light import TO_LINEAR, TO_SRGB
from pointglass.viewer.bench.cases.stability import Renderers, arrays_of, different, direction, placed, row, view_inside, walls
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import Scene
from pointglass.viewer.picture.settings import FILTERS, Settings
from pointglass.viewer.render.renderer import RASTERISERS

if TYPE_CHECKING:
    import moderngl

DOUBLES = 0.0035
"""Limit of the share of pixels that change when points are duplicated: two of about 640 pixels with points.  None changed in
tens of seeds, but a point may lie on a pixel border."""


def mean_level(rgb: np.ndarray) -> np.ndarray:
    """(3,) uint8: mean in linear light, in integers rounded half up, of sRGB levels (N, 3)."""
    sums = TO_LINEAR[rgb].astype(np.int64).sum(axis=0)
    return TO_SRGB[(2 * sums + len(rgb)) // (2 * len(rgb))].astype(np.uint8)


def crowded_pixel(renderers: Renderers, seed: int, points: int = 1_000_000, colour: int | None = None) -> list[dict]:
    """Largest colour error of many points in one pixel, by rasteriser.  colour: level of all points; None: random."""
    rng = np.random.default_rng(seed)
    rgb = rng.integers(0, 256, (points, 3)).astype(np.uint8) if colour is None else np.full((points, 3), colour, np.uint8)
    spread = np.round(rng.uniform(-1, 1, (points, 3)) * 2**20) * 2.0**-30
    scene = scene_from_arrays(np.array([0.0, 5.0, 0.0]) + spread, rgb)
    expected = mean_level(rgb).astype(int)
    rows = []
    with renderers.renderer(scene) as renderer:
        for kind in RASTERISERS:
            frame = renderer.render(axis_camera((3, 3)), Settings(raster=kind), views=("raw",))
            error = np.abs(frame.image("raw")[1, 1, :3].astype(int) - expected).max()
            alone = int(np.isfinite(frame.depth()).sum() != 1)
            what = "random colours" if colour is None else f"colour {colour}"
            rows.append(row(f"colour error of {points:,} points of {what} in one pixel, {kind}", error + 255 * alone, 0))
    return rows


def isolated_points(renderers: Renderers, seed: int, size: tuple[int, int] = (1000, 1000)) -> list[dict]:
    """Wrong pixels, over all views, of one point in a million pixels."""
    rng = np.random.default_rng(seed)
    column, line = (int(rng.integers(1, side - 1)) for side in size)
    colour = rng.integers(0, 256, 3).astype(np.uint8)
    camera = axis_camera(size)
    y = 2.0 ** int(rng.integers(-3, 8))
    point = [(column + 0.5 - camera.cx) / camera.fx * y, y, -(line + 0.5 - camera.cy) / camera.fy * y]
    made = renderers.pictures(scene_from_arrays(np.array([point]), colour[None]), camera)
    expected = np.zeros((size[1], size[0], 4), np.uint8)
    expected[line, column] = [*colour, 255]
    wrong = sum(int((made[view] != expected).any(axis=2).sum()) for view in ("raw", "filtered"))
    wrong += int((made["mask"] != (expected[..., 3] > 0)).sum())
    wrong += int((made["filled"][line, column] != expected[line, column]).any())
    shown = made["filled"][made["filled"][..., 3] > 0]
    wrong += int((shown[:, :3] != colour).any(axis=1).sum())  # filled pixels have the colour of the only point
    return [row(f"pixels wrong of one point in {size[0]}x{size[1]}", wrong, 0)]


def doubles(renderers: Renderers, seed: int, size=(64, 48)) -> list[dict]:
    """Changed pixels with each point duplicated a thousand times, and errors with one point a thousand times.

    The soft z-buffer ``auto`` depends on the point spacing, whose estimate differs with duplicates; both are rendered with the
    spacing of the scan without duplicates.
    """
    rng = np.random.default_rng(seed)
    camera = axis_camera(size)
    xyz = np.round(rng.uniform(-1, 1, (2000, 3)) * 2**10) / 2**10 + [0, 3, 0]
    rgb = rng.integers(0, 256, xyz.shape).astype(np.uint8)
    plain = scene_from_arrays(xyz, rgb)
    often = replace(scene_from_arrays(np.tile(xyz, (1000, 1)), np.tile(rgb, (1000, 1))), spacing=plain.spacing)
    rows = []
    for soft in ("auto", "paper-code"):
        once, many = (renderers.pictures(scene, camera, Settings(soft_z=soft)) for scene in (plain, often))
        held = np.isfinite(once["depth"]) | np.isfinite(many["depth"])
        moved = (once["raw"] != many["raw"]).any(axis=-1) | (once["mask"] != many["mask"])
        rows.append(row(f"share of pixels that hold points changed by drawing each 1000 times, soft depth {soft}",
                        moved.sum() / held.sum(), DOUBLES))
    same = scene_from_arrays(np.tile(xyz[:1], (1000, 1)), np.tile(rgb[:1], (1000, 1)))
    made = renderers.pictures(same, camera)
    hit = np.isfinite(made["depth"])
    wrong = int(hit.sum() != 1) + int((made["raw"][hit][:, :3] != rgb[0]).any())
    return [*rows, row("pixels wrong where all points are one", wrong, 0)]


def no_numbers(renderers: Renderers, seed: int, size: tuple[int, int]) -> list[dict]:
    """Bytes changed by coordinates that are not finite, or outliers, which are dropped; and errors in their count."""
    rng = np.random.default_rng(seed)
    xyz, rgb = walls(seed)
    bad = rng.choice([np.nan, np.inf, -np.inf], (500, 3))
    partly = xyz[:500].copy()
    partly[np.arange(500), rng.integers(0, 3, 500)] = rng.choice([np.nan, np.inf, -np.inf], 500)
    wild = rng.choice([-1.0, 1.0], (20, 3)) * 10.0 ** rng.uniform(12, 307, (20, 3))  # outlier points far outside the place
    camera = view_inside(seed, size)
    clean = renderers.pictures(scene_from_arrays(xyz, rgb), camera)
    scene = scene_from_arrays(np.concatenate([xyz, bad, partly, wild]), np.concatenate([rgb, rgb[:1020]]))
    lost = scene.meta.dropped
    return [
        row("bytes changed by coordinates that are not finite", different(clean, renderers.pictures(scene, camera)), 0),
        row("bad coordinates not counted as dropped", abs(lost.nan - 1000) + abs(lost.stray - 20), 0),
    ]


def levels(renderers: Renderers, seed: int) -> list[dict]:
    """Largest error of the 256 colour levels, each in a pixel of its own with many points."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(256)
    camera = axis_camera((16, 16))
    pixel = np.tile(np.arange(256), 40)
    y = 4.0 + rng.uniform(0, 0.01, len(pixel))
    u = pixel % 16 + rng.uniform(0.1, 0.9, len(pixel))
    v = pixel // 16 + rng.uniform(0.1, 0.9, len(pixel))
    xyz = np.stack([(u - camera.cx) / camera.fx * y, y, -(v - camera.cy) / camera.fy * y], axis=1)
    rgb = np.stack([order[pixel], 255 - order[pixel], order[::-1][pixel]], axis=1).astype(np.uint8)
    expected = np.stack([order, 255 - order, order[::-1]], axis=1).reshape(16, 16, 3)
    rows = []
    with renderers.renderer(scene_from_arrays(xyz, rgb)) as renderer:
        for soft in ("auto", "paper-text"):  # paper-code shifts by half a pixel, which would mix levels
            made = arrays_of(renderer, camera, Settings(soft_z=soft, filter="off"))
            error = max(int(np.abs(made[view][..., :3].astype(int) - expected).max()) for view in ("raw", "filtered", "filled"))
            rows.append(row(f"largest error of any of 256 levels, soft depth {soft}", error, 0))
    return rows


def repeats(renderers: Renderers, other: "moderngl.Context", seed: int, size: tuple[int, int]) -> list[dict]:
    """Repeated frames: of the place with each filter, and of a place with scanner positions."""
    xyz, rgb, _ = place_at(seed, 1.0, 1e5)
    weighted = scanned(seed, 1.0, 1e5).scene
    return [*_repeats(renderers, other, seed, size, scene_from_arrays(xyz, rgb), {name: f"filter {name}" for name in FILTERS}),
            *_repeats(renderers, other, seed, size, weighted, {"auto": "view-dependent blending"})]


def _repeats(renderers: Renderers, other: "moderngl.Context", seed: int, size: tuple[int, int], scene: Scene,
             filters: dict[str, str]) -> list[dict]:
    """Bytes that differ when a frame is repeated: twice, after another frame, by another renderer, rasteriser or context.

    filters: filter -> its text in the rows.
    """
    origin = direction(seed) * 1e5
    camera, elsewhere = (placed(view_inside(seed + n, size), 1.0, origin) for n in (0, 1))
    rows = []
    for name, how in filters.items():
        settings = Settings(filter=name)
        with renderers.renderer(scene) as renderer:
            first = arrays_of(renderer, camera, settings)
            changed = {"twice": different(first, arrays_of(renderer, camera, settings))}
            arrays_of(renderer, elsewhere.resized(31, 47), Settings(filter="auto", lod=1.0))
            changed["after another size, camera and level of detail"] = different(first, arrays_of(renderer, camera, settings))
        changed["by another renderer"] = different(first, renderers.pictures(scene, camera, settings))
        for kind in RASTERISERS:
            changed[f"by {kind}"] = different(first, renderers.pictures(scene, camera, Settings(filter=name, raster=kind)))
        other.__enter__()  # makes it current; leaving it would make none current
        try:
            changed["in another context"] = different(first, Renderers(other).pictures(scene, camera, settings))
        finally:
            renderers.context.__enter__()
        rows += [row(f"bytes changed, {what}, {how}", count, 0) for what, count in changed.items()]
    return rows
