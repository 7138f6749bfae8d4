"""Numerical limits of this machine's pictures: a place scaled, shifted and drawn again, and depths from 1 cm to 100 km.

Each claim needs no reference: scaling by powers of two and shifts by whole cells change no byte, rasterisers agree, and the
depth of a plane is known.  The claims that need a reference in float64, and those about networks, are tests (tests/stability).
Frame: a place is defined in place units (a room of 8 x 6 x 4 with a corner at the origin); its file coordinates are
``place * scale + origin``.  Place coordinates are multiples of 2**-20, so that scaling by powers of two and shifts by whole
cells are exact.  Everything is random, float64, and depends only on the seed.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...grid.open_scene import scene_from_arrays
from ...grid.scene import Scene
from ...picture.camera import Camera, from_fov, look_at
from ...picture.settings import Settings
from ...render.renderer import Renderer

if TYPE_CHECKING:
    import moderngl

VIEWS = ("raw", "filtered", "filled")
"""Views that are rendered."""
ROOM = np.array([8.0, 6.0, 4.0])
"""Size of the room, place units."""
GRAIN = 2.0**20
"""Steps of coordinates per place unit."""
_NOISE = 24
"""Largest noise added to a colour channel, 0 to 255, so that neighbours differ as in a scan."""
DECADES = 7
"""Number of panels of :func:`panels` behind the first, each ten times farther than the previous one."""


def row(name: str, value: float, limit: float, *, least: bool = False, **more: object) -> dict:
    """A row of the table.  ok: value <= limit, or >= if ``least``; False for NaN.  more: further entries."""
    ok = bool(value >= limit if least else value <= limit)
    return {"name": name, "value": float(value), "limit": float(limit), "least": least, "ok": ok, **more}


class Renderers:
    """Renders scenes in one OpenGL context."""

    def __init__(self, context: "moderngl.Context"):
        self.context = context

    @contextmanager
    def renderer(self, scene: Scene) -> Iterator[Renderer]:
        made = Renderer(self.context, scene, device="cpu")
        try:
            yield made
        finally:
            made.release()

    def depth(self, scene: Scene, camera: Camera, settings: Settings | None = None) -> np.ndarray:
        """(H, W) float32 of the raw view."""
        with self.renderer(scene) as renderer:
            return renderer.render(camera, settings or Settings(), views=("raw",)).depth()

    def pictures(self, scene: Scene, camera: Camera, settings: Settings | None = None) -> dict[str, np.ndarray]:
        """Views, mask and depth by name."""
        with self.renderer(scene) as renderer:
            return arrays_of(renderer, camera, settings or Settings())


def arrays_of(renderer: Renderer, camera: Camera, settings: Settings) -> dict[str, np.ndarray]:
    """Copies of the views, mask and depth of one frame, by name."""
    frame = renderer.render(camera, settings, views=VIEWS)
    return {**{view: frame.image(view) for view in VIEWS}, "mask": frame.mask(), "depth": frame.depth()}


def different(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> int:
    """Number of bytes that differ between two frames, over all pictures."""
    return sum(int((x.reshape(-1).view(np.uint8) != y.reshape(-1).view(np.uint8)).sum()) for x, y in
               ((a[key], b[key]) for key in a))


# Scenes and cameras


def walls(seed: int, points: int = 40_000) -> tuple[np.ndarray, np.ndarray]:
    """A closed room with five boxes in it: xyz (N, 3) float64 in place units, rgb (N, 3) uint8."""
    rng = np.random.default_rng(seed)
    corners = [(np.zeros(3), ROOM)]
    for _ in range(5):
        low = np.append(rng.uniform(0.5, (6.0, 4.0)), 0.0)
        corners.append((low, low + rng.uniform(0.4, 1.5, 3)))
    shares = np.array([0.6, *[0.08] * 5])
    parts = []
    for (low, high), count in zip(corners, (shares * points).astype(int), strict=True):
        xyz = rng.uniform(low, high, (count, 3))
        sides = np.array([(high - low)[[1, 2, 0]] * (high - low)[[2, 0, 1]]]).ravel()
        axis = rng.choice(3, count, p=sides / sides.sum())
        xyz[np.arange(count), axis] = np.where(rng.random(count) < 0.5, low[axis], high[axis])
        parts.append(xyz)
    xyz = np.round(np.concatenate(parts) * GRAIN) / GRAIN
    return xyz, _painted(rng, xyz)


def _painted(rng: np.random.Generator, xyz: np.ndarray) -> np.ndarray:
    """(N, 3) uint8: smooth waves with noise, so that a shift by a pixel is a small error, and another surface a large one."""
    waves = rng.normal(0, 2.0, (3, 3))
    colour = 128 + 70 * np.sin(xyz @ waves.T + rng.uniform(0, 6, 3)) + rng.uniform(-_NOISE, _NOISE, xyz.shape)
    return np.clip(np.rint(colour), 0, 255).astype(np.uint8)


def panels(seed: int, size: tuple[int, int], near: float = 0.01, points: int = 24_000) -> tuple[np.ndarray, np.ndarray, Camera]:
    """Panels at depths ``near`` times 1, 10, ... 10**DECADES, each in a column of the picture.

    points: number of the nearest panel; each farther panel has half as many, at least 1000, as the density of scans falls with
    distance.  Returns xyz (N, 3), rgb (N, 3) and the camera at the origin, which looks along +x with +z up.
    """
    rng = np.random.default_rng(seed)
    camera = from_fov(*size, 50.0, look_at((0, 0, 0), (1, 0, 0)))
    half = size[1] / 2 / camera.fy
    width = 2 * size[0] / 2 / camera.fx / (DECADES + 1)
    parts = []
    for number in range(DECADES + 1):
        left = -size[0] / 2 / camera.fx + number * width
        count = max(points >> number, 1000)
        across = rng.uniform(left + 0.1 * width, left + 0.9 * width, count)
        parts.append(near * 10.0**number * np.stack([np.ones(count), -across, rng.uniform(-half, half, count)], 1))
    xyz = np.concatenate(parts)
    return xyz, rng.integers(0, 256, (len(xyz), 3)).astype(np.uint8), camera


def view_inside(seed: int, size: tuple[int, int], fov: float | None = None) -> Camera:
    """A random camera in the room, place units; its position is a multiple of 2**-20.  fov: vertical, degrees; None: random."""
    rng = np.random.default_rng(seed)
    eye, target = (np.round(rng.uniform((0.1, 0.1, low), 0.9) * ROOM * GRAIN) / GRAIN for low in (0.5, 0.1))
    return from_fov(*size, fov or rng.uniform(40, 100), look_at(eye, target), f"view{seed}")


def placed(camera: Camera, scale: float, origin: np.ndarray) -> Camera:
    """The camera in file coordinates."""
    pose = camera.camera_to_world.copy()
    pose[:3, 3] = pose[:3, 3] * scale + origin
    return camera.moved(pose)


def direction(seed: int) -> np.ndarray:
    """(3,) random direction of an origin, not along an axis, with coordinates that are not round numbers."""
    rng = np.random.default_rng(seed)
    return rng.choice([-1.0, 1.0], 3) * rng.uniform(0.3, 1.0, 3)


# Claims


def exactness(renderers: Renderers, seed: int, size: tuple[int, int], exponents: Sequence[int] = (-10, -3, 7, 20),
              shifts: Sequence[int] = (4, 12, 23, 30), scene_at: Callable[[float, np.ndarray], Scene] | None = None,
              what: str = "bytes changed") -> list[dict]:
    """Bytes that differ after scaling by powers of two, and after shifts by whole cells (2**n file units).

    scene_at: the place at a scale and an origin (3,); None: that of ``walls``.  what: start of the rows' names.
    """
    place, rgb = walls(seed)
    at = scene_at or (lambda factor, origin: scene_from_arrays(place * factor + origin, rgb))
    camera, zero = view_inside(seed, size), np.zeros(3)
    base = renderers.pictures(at(1.0, zero), camera)
    rows = []
    for exponent in exponents:
        factor = 2.0**exponent
        made = renderers.pictures(at(factor, zero), placed(camera, factor, zero))
        made["depth"] = made["depth"] / np.float32(factor)
        rows.append(row(f"{what} by scaling by 2^{exponent}", different(base, made), 0))
    for shift in shifts:
        origin = np.round(direction(seed + shift) * 2.0 ** (shift - 4)) * 16.0  # whole cells, which are at most 16 wide
        rows.append(row(f"{what} by a shift of about 2^{shift}",
                        different(base, renderers.pictures(at(1.0, origin), placed(camera, 1.0, origin))), 0))
    return rows


def wide_range(renderers: Renderers, seed: int, size: tuple[int, int] = (320, 240)) -> list[dict]:
    """Depths from 1 cm to 100 km in one frame: error of each panel's depth, and the share of it that the filter keeps."""
    xyz, rgb, camera = panels(seed, size)
    scene = scene_from_arrays(xyz, rgb)
    made = renderers.pictures(scene, camera)
    depth, rows = made["depth"], []
    for number in range(DECADES + 1):
        columns = slice(number * size[0] // (DECADES + 1), (number + 1) * size[0] // (DECADES + 1))
        z, seen = 0.01 * 10.0**number, np.isfinite(depth[:, columns])
        gap = np.abs(depth[:, columns][seen] - z).max(initial=0.0) / (scene.step + 2.0**-22 * z) if seen.any() else np.nan
        rows.append(row(f"depth error at {z:g}, in packed steps and float32 roundings", gap, 1.0, depth=z))
        kept = (made["mask"][:, columns] & seen).sum() / max(seen.sum(), 1)
        rows.append(row(f"share kept by the filter at {z:g}", kept, 0.98, least=True))
    return rows


def repeated(renderers: Renderers, seed: int, size: tuple[int, int]) -> list[dict]:
    """Bytes that differ when a frame is repeated: after another frame, and by another renderer."""
    scene = scene_from_arrays(*walls(seed))
    camera, elsewhere = view_inside(seed, size), view_inside(seed + 1, (47, 31))
    with renderers.renderer(scene) as renderer:
        first = arrays_of(renderer, camera, Settings())
        arrays_of(renderer, elsewhere, Settings(lod=1.0))
        again = arrays_of(renderer, camera, Settings())
    return [row("bytes changed after another size, camera and level of detail", different(first, again), 0),
            row("bytes changed by another renderer", different(first, renderers.pictures(scene, camera)), 0)]


def run_stability(size: tuple[int, int] = (320, 240), seed: int = 1) -> dict:
    """Runs all claims.  size: of most pictures, pixels.  Returns rows, failed (their names), opengl, driver, size, seed."""
    from ...render.device.context import create_context, describe_device

    context = create_context()
    try:
        renderers = Renderers(context)
        rows = [*exactness(renderers, seed, size), *wide_range(renderers, seed), *repeated(renderers, seed, size)]
        device = describe_device(context)
    finally:
        context.release()
    return {"opengl": device.renderer, "driver": device.version, "size": list(size), "seed": seed, "rows": rows,
            "failed": [row["name"] for row in rows if not row["ok"]]}


def rows(result: dict) -> list[tuple[str, str]]:
    """The table."""
    return [(row["name"], f"{row['value']:.4g} ({'at least' if row['least'] else 'limit'} {row['limit']:.4g}) "
             + ("" if row["ok"] else "  BEYOND ITS LIMIT")) for row in result["rows"]]


def plot(result: dict, path: Path) -> None:
    """Depth error against depth."""
    from ..plots import INK, figure, save

    made, axes = figure(7.0, 3.5)
    found = [row for row in result["rows"] if "depth" in row]
    axes.plot([row["depth"] for row in found], [row["value"] for row in found], "o-", color=INK[0])
    axes.axhline(1.0, color="black", linestyle="--", linewidth=1)
    axes.set(xscale="log", xlabel="depth, metres", ylabel="depth error, packed steps and float32 roundings", ylim=(0, None))
    save(made, path, result)
