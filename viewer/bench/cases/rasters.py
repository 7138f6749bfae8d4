"""The rasterisers in the worst case of memory access: random points, so that successive points fall on unrelated pixels.

All draw the same picture (on a GPU within a tolerance).  The one on the processor is measured in software OpenGL only.
Frame: metres, the camera looks along +y.
"""

from pathlib import Path

import numpy as np

from ...picture.settings import Settings

KINDS = ("compute", "points", "cpu")
"""Names of the rasterisers; the last one reads the points from OpenGL's memory, which a GPU would have to copy."""


def run_rasters(count: int, size: tuple[int, int], repeats: int, seed: int = 1) -> dict:
    """Milliseconds of both passes of each rasteriser for ``count`` points within the picture."""
    from ...common.progress import progress
    from ...grid.open_scene import scene_from_arrays
    from ...picture.camera import from_fov, look_at
    from ...render.device.context import create_context
    from ...render.device.device_class import pictures_agree
    from ...render.renderer import Renderer

    rng = np.random.default_rng(seed)
    camera = from_fov(*size, 60.0, look_at(np.zeros(3), np.array([0.0, 1.0, 0.0])), "random")
    depth = rng.uniform(4.0, 8.0, count)
    u, v = rng.uniform(0.0, 1.0, (2, count)) * np.array(size)[:, None]
    xyz = np.column_stack([(u - camera.cx) / camera.fx * depth, depth, -(v - camera.cy) / camera.fy * depth])
    scene = scene_from_arrays(xyz, rng.integers(0, 256, (count, 3), dtype=np.uint8))
    context = create_context()
    renderer = Renderer(context, scene)
    software = renderer.device.software
    kinds = KINDS if software else KINDS[:2]
    times: dict[str, list[float]] = {kind: [] for kind in kinds}
    pictures = {}
    with progress((repeats + 1) * len(kinds), "rasterisers", "picture") as meter:
        for round_ in range(repeats + 1):
            for kind in kinds:
                frame = renderer.render(camera, Settings(view="raw", raster=kind), views=("raw",))
                spent = frame.stats["stages"]["raster"]
                if round_ == 0:
                    pictures[kind] = frame.image("raw").copy(), frame.depth().copy()
                else:
                    times[kind].append(spent)
                meter.update(1)
    middle = {kind: float(np.median(times[kind])) for kind in kinds}
    result = {
        "scans": [f"{count:,} random points, seed {seed}"], "points": scene.count, "size": list(size), "repeats": repeats,
        "opengl": renderer.device.renderer, "driver": renderer.device.version, "milliseconds": middle,
        "ratio": float(np.median(np.divide(times["points"], times["compute"]))),
        "ratio_cpu": float(np.median(np.divide(times["cpu"], times["compute"]))) if "cpu" in times else None,
        "software": software, "workgroup": str(renderer._passes.rasterisers["compute"].workgroup),  # type: ignore[attr-defined]
        "differing_pixels": max(int((pictures["compute"][0] != pictures[kind][0]).any(-1).sum()) for kind in kinds),
        "failed": not all(pictures_agree(made, expected, software=software) for kind in kinds
                          for made, expected in zip(pictures[kind], pictures["compute"], strict=True)),
    }
    renderer.release()
    context.release()
    return result


def rows(result: dict) -> list[tuple[str, str]]:
    """The table."""
    found = [(f"both passes, {kind}", f"{result['milliseconds'][kind]:.1f} ms") for kind in result["milliseconds"]]
    if result["ratio_cpu"] is not None:
        found.append(("cpu / compute", f"{result['ratio_cpu']:.2f} of the time"))
    return [*found, ("points / compute", f"{result['ratio']:.1f} times the time"),
            ("workgroup", f"{result['workgroup']} (lanes x batches)"),
            ("pictures", "NOT the same" if result["failed"] else "identical" if not result["differing_pixels"]
             else f"{result['differing_pixels']} pixels differ, within the tolerance for GPUs")]


def plot(result: dict, path: Path) -> None:
    """A bar for each."""
    from ..plots import INK, figure, save

    made, axes = figure(7.0, 1.8)
    axes.barh(list(result["milliseconds"]), list(result["milliseconds"].values()), color=INK[0])
    axes.invert_yaxis()
    axes.set_xlabel(f"milliseconds for both passes, {result['points']:,} random points")
    save(made, path, result)
