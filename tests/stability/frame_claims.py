"""Measurements of frames at extreme scales, origins, lenses, sizes and camera positions, each with a limit.

Each function takes a :class:`Renderers` and a seed and returns rows (see ``row``), which tests assert.  The limit of a row is a
claim about the renderer.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from exact_claims import Agreement, agreement, depth_faults, exact_picture
from scenes import axis_camera

from pointglass.viewer.bench.cases.stability import Renderers, arrays_of, direction, placed, row, view_inside, walls
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.renderer import Renderer

if TYPE_CHECKING:
    from pointglass.viewer.picture.camera import Camera

SCALES = (1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
"""File units per place unit."""
ORIGINS = (0.0, 1.0, 1e3, 1e5, 1e6, 1e7, 1e9)
"""Distances of a place from zero, file units."""
FOVS = (1.0, 2.0, 5.0, 20.0, 60.0, 90.0, 120.0, 150.0, 170.0)
"""Vertical fields of view, degrees."""
SIZES = ((4, 4), (5, 4), (4, 7), (7, 7), (13, 31), (101, 97), (211, 3), (3, 211), (16384, 16), (16, 16384))
"""Picture sizes, pixels."""
LIMITS = {"depth": 0.005, "depth_99": 0.01, "moved": 0.005, "mask": 0.005, "filled": 40.0, "background": 0.04}
"""Limits of :class:`Agreement` at any scale and origin; that of ``filled`` is a minimum, dB.

Packing moves a point by about 1/1000 of the spacing, so that one pixel in a thousand shows another point.  The depth filter
decides for blocks of pixels: at a threshold, a single pixel can change up to 1 % of a picture, therefore medians over views are
compared.  The room is closed, but whether viewer.render.culling.enclosed_directions detects this depends on the points of its
sample: near a wall, a few degrees may remain open."""

HELD, LOST = 8.0, 2.0
"""Point spacings in steps of float64 (2**-52 of the largest coordinate).  A scan with at least HELD must be rendered, one with
at most LOST refused.  In between both are allowed, as the spacing itself is measured from rounded positions.  Chosen by
hand."""


def place_at(seed: int, scale: float, away: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """xyz, rgb and origin of the place in file coordinates.  away: distance of the origin from zero, file units."""
    place, rgb = walls(seed)
    origin = direction(seed) * away
    return place * scale + origin, rgb, origin


def agree_at(renderers: Renderers, seed: int, scale: float, away: float, size=(160, 120), views: int = 4) -> Agreement | str:
    """Median agreement over views (background: mean), or the error message if the scan is refused."""
    xyz, rgb, origin = place_at(seed, scale, away)
    try:
        scene = scene_from_arrays(xyz, rgb)
    except InputError as error:
        return str(error)
    found = []
    with renderers.renderer(scene) as renderer:
        for number in range(views):
            camera = placed(view_inside(seed + number, size), scale, origin)
            made = arrays_of(renderer, camera, Settings())
            truth = exact_picture(xyz, rgb, camera, scene.spacing)
            found.append(agreement(made["depth"], made["mask"], made["filled"], truth, scene.spacing))
    over = {name: np.mean if name == "background" else np.median for name in LIMITS}
    return Agreement(**{name: float(over[name]([getattr(one, name) for one in found])) for name in LIMITS})


def curves(renderers: Renderers, seed: int, size: tuple[int, int], scales: Sequence[float] = SCALES,
           origins: Sequence[float] = ORIGINS) -> tuple[list[dict], list[dict]]:
    """Rows, the worst over all scales for each origin, and the curves: scale, origin, and Agreement or ``refused``."""
    points, rows = [], []
    unit = scene_from_arrays(*walls(seed)).spacing
    for away in origins:
        found = [(scale, agree_at(renderers, seed, scale, away, size)) for scale in scales]
        good = [made for _, made in found if isinstance(made, Agreement)]
        points += [{"scale": s, "origin": away, **({"refused": m} if isinstance(m, str) else vars(m))} for s, m in found]
        for name, limit in LIMITS.items() if good else ():
            least = name == "filled"
            worst = (min if least else max)(getattr(made, name) for made in good)
            rows.append(row(f"{name}, scales {min(scales):g} to {max(scales):g}, origin {away:g}", worst, limit, least=least))
        resolution = float(np.abs(direction(seed)).max() * away * 2.0**-52)
        outcomes = [(scale * unit, isinstance(made, str)) for scale, made in found]
        if away:  # the spacings at both limits
            outcomes += [(s * resolution, _is_refused(seed, s * resolution / unit, away)) for s in (HELD, LOST)]
        wrong = sum(refused if spacing >= HELD * resolution else spacing <= LOST * resolution and not refused
                    for spacing, refused in outcomes)
        rows.append(row(f"scales refused though representable in float64, or vice versa, origin {away:g}", wrong, 0))
    return rows, points


def _is_refused(seed: int, scale: float, away: float) -> bool:
    try:
        scene_from_arrays(*place_at(seed, scale, away)[:2])
    except InputError:
        return True
    return False


# Lenses, planes, sizes


def lenses(renderers: Renderers, seed: int, size: tuple[int, int], fovs: Sequence[float] = FOVS) -> list[dict]:
    """Fields of view, a principal point outside the picture, pixels that are not square."""
    xyz, rgb, origin = place_at(seed, 1.0, 1e5)
    scene = scene_from_arrays(xyz, rgb)
    rows = []
    with renderers.renderer(scene) as renderer:
        for fov in fovs:
            camera = placed(view_inside(seed, size, fov), 1.0, origin)
            rows.append(row(f"pixels wrong at a field of view of {fov:g} degrees", _faults(renderer, camera, xyz), 0))
        camera = placed(view_inside(seed, size, 60.0), 1.0, origin)
        camera = replace(camera, cx=-0.7 * size[0], cy=1.9 * size[1], fy=3.7 * camera.fy)
        rows.append(row("pixels wrong with the principal point outside and oblong pixels", _faults(renderer, camera, xyz), 0))
    return rows


def _faults(renderer: Renderer, camera: "Camera", xyz: np.ndarray) -> int:
    return depth_faults(renderer.render(camera, Settings(), views=("raw",)).depth(), xyz, camera, renderer.scene)


def cell_faces(renderers: Renderers, seed: int, size: tuple[int, int]) -> list[dict]:
    """Cameras inside a cell, on its face, edge and corner, and at the next float64 on either side of the corner."""
    xyz, rgb, _ = place_at(seed, 1.0, 1e5)
    scene = scene_from_arrays(xyz, rgb)
    rng = np.random.default_rng(seed)
    low = scene.cell_min[rng.integers(len(scene.cell_coords))]
    spots = {
        "in a cell": low + rng.random(3) * scene.cell_size,
        "on a cell's face": low + [0.0, *(rng.random(2) * scene.cell_size)],
        "on a cell's edge": low + [0.0, 0.0, rng.random() * scene.cell_size],
        "on a cell's corner": low,
        "just before a cell's corner": np.nextafter(low, low - 1),
        "just behind a cell's corner": np.nextafter(low, low + 1),
    }
    rows = []
    with renderers.renderer(scene) as renderer:
        for name, position in spots.items():
            turned = view_inside(seed, size, 90.0).camera_to_world.copy()
            turned[:3, 3] = position
            cameras = [axis_camera(size, position), view_inside(seed, size, 90.0).moved(turned)]
            rows.append(row(f"pixels wrong with the camera {name}", sum(_faults(renderer, c, xyz) for c in cameras), 0))
    return rows


def camera_plane(renderers: Renderers, seed: int, size: tuple[int, int] = (64, 48)) -> list[dict]:
    """Points in, behind and very near the camera's plane: all rendered depths are positive, and no point is missing."""
    rng = np.random.default_rng(seed)
    base = np.round(rng.uniform(-1, 1, (4000, 3)) * 2**12) / 2**12
    base[:2000, 1] = 0.5  # half of them in one plane
    rgb = rng.integers(0, 256, (len(base), 3)).astype(np.uint8)
    scene = scene_from_arrays(base, rgb)
    rows = []
    with renderers.renderer(scene) as renderer:
        plane = 0.5 + 0.5 * scene.step  # where the packed plane lies
        for power in (None, 8, 16, 24, 32, 40, 50):
            wrong = 0
            for side in (1, -1) if power else (0,):
                position = np.array([0.01, plane + side * 2.0 ** -(power or 0), 0.02])
                camera = axis_camera(size, position)
                wrong += _faults(renderer, camera, base)
            where = "in" if power is None else f"2^-{power} from"
            rows.append(row(f"pixels wrong with the camera {where} a plane of points", wrong, 0))
    flat = base[:2000]
    scene = scene_from_arrays(flat, rgb[:2000])
    position = np.array([0.01, 0.5 + 0.5 * scene.step, 0.02])
    drawn = np.isfinite(renderers.depth(scene, axis_camera(size, position))).sum()
    rows.append(row("pixels drawn of points that all lie in the camera's plane", drawn, 0))
    return rows


def sizes(renderers: Renderers, seed: int, wanted: Sequence[tuple[int, int]] = SIZES) -> list[dict]:
    """Pictures from 4x4 pixels: all views are rendered, and the depth is checked."""
    xyz, rgb, origin = place_at(seed, 1.0, 1e3)
    scene = scene_from_arrays(xyz, rgb)
    rows = []
    with renderers.renderer(scene) as renderer:
        for size in wanted:
            camera = placed(view_inside(seed, size, 60.0), 1.0, origin)
            made = arrays_of(renderer, camera, Settings())
            wrong = depth_faults(made["depth"], xyz, camera, scene)
            measured = made["mask"]
            wrong += int((made["filled"][measured] != made["raw"][measured]).any(axis=1).sum())
            rows.append(row(f"pixels wrong at {size[0]}x{size[1]}", wrong, 0))
    return rows


def rolled(renderers: Renderers, seed: int, size: tuple[int, int] = (96, 96)) -> list[dict]:
    """Share of pixels that differ from the rotated picture when the camera is rolled by quarter turns."""
    xyz, rgb, origin = place_at(seed, 1.0, 1e6)
    scene = scene_from_arrays(xyz, rgb)
    camera = placed(view_inside(seed, size, 70.0), 1.0, origin)
    rows = []
    with renderers.renderer(scene) as renderer:
        upright = renderer.render(camera, Settings(), views=("raw",)).image("raw")
        for turns, name in ((1, "rolled by 90 degrees"), (2, "upside down"), (3, "rolled by 270 degrees")):
            pose = camera.camera_to_world.copy()
            right, up = pose[:3, 0].copy(), pose[:3, 1].copy()
            pose[:3, 0], pose[:3, 1] = {1: (up, -right), 2: (-right, -up), 3: (-up, right)}[turns]
            made = renderer.render(camera.moved(pose), Settings(), views=("raw",)).image("raw")
            moved = (np.rot90(made, turns) != upright).any(-1).mean()
            rows.append(row(f"pixels changed, {name}", moved, 0.005))
    return rows

