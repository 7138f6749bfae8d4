"""Runs all claims of ``pointglass bench stability``.

These are the measurements of ``tests/stability`` over wider ranges: rows (name, value, limit, ok), curves over scale and
origin, a table of the networks' precision, and a plot of both.
"""

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ....model.common.system import available_memory
from ...common.progress import progress
from ...grid.open_scene import scene_from_arrays
from . import frame_claims, point_claims, station_claims
from .exact_claims import depth_faults
from .network_claims import network_rows
from .scenes import axis_camera

LARGEST = (16384, 16384)
"""Largest picture size that OpenGL 4.3 guarantees, pixels."""
_LARGEST_NEEDS = 10 << 30
"""Memory for a picture of that size, bytes: colour and depth, their copies when read back, and a factor of two."""


def largest_picture(renderers: frame_claims.Renderers, seed: int, size: tuple[int, int] = LARGEST) -> list[dict]:
    """The raw view at the largest size; a row with ``skipped``, the reason, if there is too little memory."""
    name = f"pixels wrong at {size[0]}x{size[1]}, raw"
    free = available_memory() or 0
    if free < _LARGEST_NEEDS:
        why = f"{free / 2**30:.1f} GiB free, {_LARGEST_NEEDS / 2**30:.0f} needed"
        return [{**frame_claims.row(name, 0, 0), "skipped": why}]
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-1, 1, (200_000, 3)) + [0, 2, 0]
    scene = scene_from_arrays(xyz, np.full(xyz.shape, 255, np.uint8))
    camera = axis_camera(size)
    return [frame_claims.row(name, depth_faults(renderers.depth(scene, camera), xyz, camera, scene), 0)]


def run_stability(size: tuple[int, int] = (320, 240), seed: int = 1, plot: Path | None = None) -> dict:
    """Runs all claims.  size: of most pictures, pixels.  plot: file for the plot.

    Returns rows, failed (their names), curves, network (table), opengl, size, seed.
    """
    from ....model.network.qualities import trainable
    from ....model.network.weights_folder import shipped, weights_name
    from ...render.device.context import create_context, describe_device

    context, other = create_context(), create_context()
    renderers = frame_claims.Renderers(context)
    rows: list[dict] = []
    curves: list[dict] = []
    table: list[dict] = []

    def along_curves() -> list[dict]:
        found, made = frame_claims.curves(renderers, seed, size)
        curves.extend(made)
        return found

    def networks() -> list[dict]:
        found = []
        for quality, filtered in itertools.product(trainable(), (True, False)):
            if (name := weights_name(quality, filtered=filtered)) in shipped():
                more, made = network_rows(seed, (112, 80), quality, filtered=filtered)
                found += more
                table.extend({"network": name, **entry} for entry in made)
        return found

    sections: dict[str, Callable[[], list[dict]]] = {
        "scale and origin": along_curves,
        "exact": lambda: frame_claims.exactness(renderers, seed, size),
        "range": lambda: frame_claims.wide_range(renderers, seed, size),
        "lens": lambda: frame_claims.lenses(renderers, seed, size) + frame_claims.rolled(renderers, seed),
        "cell faces": lambda: frame_claims.cell_faces(renderers, seed, size),
        "camera plane": lambda: frame_claims.camera_plane(renderers, seed),
        "size": lambda: frame_claims.sizes(renderers, seed) + largest_picture(renderers, seed),
        "points": lambda: [
            *point_claims.crowded_pixel(renderers, seed), *point_claims.crowded_pixel(renderers, seed, 2_000_000, 255),
            *point_claims.isolated_points(renderers, seed), *point_claims.doubles(renderers, seed),
            *point_claims.no_numbers(renderers, seed, size), *point_claims.levels(renderers, seed),
        ],
        "scanners": lambda: [
            *station_claims.anywhere(renderers, seed, size, frame_claims.SCALES, frame_claims.ORIGINS),
            *station_claims.exactness(renderers, seed, size), *station_claims.hard_places(renderers, seed, size),
            *station_claims.heavy(renderers, seed),
        ],
        "network": networks,
        "the same again": lambda: point_claims.repeats(renderers, other, seed, size),
    }
    try:
        context.__enter__()  # the other context, created last, is current
        with progress(len(sections), "stability", "section") as meter:
            for group, measure in sections.items():
                rows += [{"group": group, **row} for row in measure()]
                meter.update(1)
        opengl = describe_device(context).renderer
    finally:
        other.release()
        context.release()
    if plot is not None:
        _plot(curves, table, plot)
    return {"opengl": opengl, "size": list(size), "seed": seed, "rows": rows,
            "failed": [row["name"] for row in rows if not row["ok"]], "curves": curves, "network": table}


def _plot(curves: list[dict], table: list[dict], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    from ....model.common.files.atomic_write import write_atomic

    labels = {"depth_99": "depth error, 99th percentile, point spacings", "mask": "keep-masks that differ, share of pixels",
              "filled": "filled picture, PSNR in dB"}
    figure, axes = plt.subplots(2, 2, figsize=(11, 8), layout="constrained")
    for (name, label), axis in zip(labels.items(), axes.flat, strict=False):
        for away in dict.fromkeys(entry["origin"] for entry in curves):
            mine = [entry for entry in curves if entry["origin"] == away and name in entry]
            axis.plot([e["scale"] for e in mine], [e[name] for e in mine], ".-", label=f"origin {away:g}")
        axis.axhline(frame_claims.LIMITS[name], color="black", linestyle="--", linewidth=1, label="limit")
        axis.set(xscale="log", xlabel="scale", ylabel=label)
        if name != "filled":
            axis.set_yscale("log")
    axes.flat[0].legend(fontsize="x-small", ncols=2)
    axis = axes.flat[3]
    kinds = list(dict.fromkeys(entry["kind"] for entry in table))
    for precision in dict.fromkeys(entry["precision"] for entry in table):
        worst = [max(e["mean"] for e in table if (e["precision"], e["kind"]) == (precision, kind)) for kind in kinds]
        axis.plot(np.maximum(worst, 1e-6), range(len(kinds)), ".", label=precision)
    if table:
        axis.set_yticks(range(len(kinds)), kinds, fontsize=6)
        axis.set(xscale="log", xlim=(1e-6, 1e-2), xlabel="mean difference from float64, worst of all networks")
        axis.legend(fontsize="x-small")
    write_atomic(path, lambda p: figure.savefig(p, format=path.suffix.lstrip(".") or "png", dpi=150))
    plt.close(figure)
