"""``distances.png``: maps of the change from above and from two sides, the histogram, and what a reader needs to judge them."""

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...common.fonts import families, in_order
from ...common.progress import progress
from ...common.text import counted
from ...work.comparing.compare import Distances
from ...work.comparing.distance_statistics import NO_COUNTERPART, Statistics
from ...work.comparing.facing import TEXTS
from ...work.comparing.model_distances import METHOD
from .change_map import VIEWS, change_map
from .distance_histogram import draw_histogram, shown_unit
from .read_cloud import Cloud

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "distances.png"
_SIZE, _DPI = (16.0, 10.0), 120
"""Inches, and pixels an inch: 1920 x 1200."""
_MOST_LABELS, _APART = 6, 6.0
"""Intervals between the labels of an axis at most, and pixels between two labels at least."""
_INK, _QUIET = "#16191d", "#6a7078"
_METHODS = {METHOD: "Each point to the nearest triangle of the model",
            "m3c2": "M3C2: means of both scans in a cylinder along the local normal",
            "c2c": "cloud to cloud: each point to the local plane of the scan before"}  # fmt: skip


def write_picture(path: Path, before: Cloud, after: Cloud, distances: Distances, found: Statistics, unit: str) -> None:
    """unit: of both scans, a name."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE, dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    factor, shown = shown_unit(found.limit, unit)
    with progress(len(VIEWS) + 1, f"drawing {NAME}") as meter:
        _maps(figure, after, distances, found, meter)
        of = "distance from the model" if distances.method == METHOD else "distance after - before"
        draw_histogram(figure.add_axes((0.69, 0.49, 0.285, 0.36)), found, factor, f"{of}, {shown}")
        meter.update(1)
    _texts(figure, before, after, distances, found, factor, shown)
    figure.savefig(path, format="png", dpi=_DPI)


def _maps(figure: "Figure", after: Cloud, distances: Distances, found: Statistics, meter: Any) -> None:
    """The maps with one scale between them where they fit: that from above is the largest."""
    places = {"from above": (0.045, 0.40, 0.60, 0.50), "front (looking along y)": (0.045, 0.06, 0.29, 0.28),
              "side (looking along x)": (0.365, 0.06, 0.29, 0.28)}  # fmt: skip
    for title, axes in VIEWS.items():
        made = change_map(after.xyz, distances.distance, distances.uncertainty, axes, distances.after.spacing, found.limit)
        page = figure.add_axes(places[title])
        page.imshow(made.rgb, extent=(made.left, made.right, made.bottom, made.top), interpolation="nearest", aspect="equal")
        page.set_title(title, fontsize=10, color=_INK, loc="left")
        page.tick_params(labelsize=7, colors=_QUIET)
        page.ticklabel_format(useOffset=False, style="plain")
        _space_labels(page)
        for spine in page.spines.values():
            spine.set_color("#c9cdd2")
        meter.update(1)


def _space_labels(page: Any) -> None:
    """Labels both axes of a map as densely as its size on the page allows, each at one place at least."""
    from matplotlib.ticker import FixedLocator

    page.apply_aspect()  # its final size, which the equal scale of both axes gives it
    renderer = page.figure.canvas.get_renderer()
    for axis, side in ((page.xaxis, 0), (page.yaxis, 1)):
        low, high = sorted(axis.get_view_interval())
        at = np.zeros(0)
        for most in range(_MOST_LABELS, 0, -1):
            page.locator_params(axis.axis_name, nbins=most)
            at = axis.get_majorticklocs()
            at = at[(at >= low) & (at <= high)]
            axis.get_tightbbox(renderer)  # updates the labels
            boxes = [tick.label1.get_window_extent(renderer) for tick in axis.get_major_ticks()]
            ends = sorted((box.min[side], box.max[side]) for box in boxes if box.width > 0)
            if len(at) and all(after[0] - before[1] >= _APART for before, after in pairwise(ends)):
                break
        else:
            axis.set_major_locator(FixedLocator([float(at[0]) if len(at) else (low + high) / 2]))


def _texts(figure: "Figure", before: Cloud, after: Cloud, distances: Distances, found: Statistics, factor: float,
           unit: str) -> None:  # fmt: skip
    def length(value: float) -> str:
        return f"{value * factor:.3g} {unit}" if np.isfinite(value) else "-"

    def share(part: int, whole: int) -> str:
        return f"{100 * part / whole:.3g} %" if whole else "-"

    figure.text(0.045, 0.955, in_order(f"{after.name}  compared with  {before.name}"), fontsize=15, color=_INK, weight="bold",
                parse_math=False, fontfamily=families(after.name + before.name))  # fmt: skip
    figure.text(0.045, 0.93, _METHODS[distances.method], fontsize=10, color=_QUIET)
    beyond = int(found.bins[0] + found.bins[-1])
    rows = [
        ("median", length(found.median)), ("mean", length(found.mean)), ("standard deviation", length(found.sd)),
        ("5 % to 95 % of the points", f"{length(found.quantiles[1])} to {length(found.quantiles[5])}"),
        ("median uncertainty, 95 % (dashed)", f"± {length(found.uncertainty)}"),
        ("changed by more than their uncertainty", share(found.changed, found.known)),
        ("beyond the ends of the colours", share(beyond, found.known)),
        ("no counterpart (grey)", share(found.count - found.known, found.count)),
        ("points", f"{found.count:,}"),
        ("registration error included", length(distances.registration) if distances.registration else "none was stated"),
    ]  # fmt: skip
    for row, (name, text) in enumerate(rows):
        y = 0.325 - 0.0225 * row
        figure.text(0.69, y, name, fontsize=9.5, color=_QUIET)
        figure.text(0.975, y, text, fontsize=9.5, color=_INK, ha="right")
    notes = [f"Positive (red): {TEXTS[distances.rule]}.",
             "A map looks through the scan; a pixel shows the most certain change.",
             "Pale: an uncertainty of more than half the range. Coordinates are the file's."]  # fmt: skip
    for row, note in enumerate(notes):
        figure.text(0.69, 0.085 - 0.02 * row, note, fontsize=8.5, color=_QUIET)
    figure.patches.append(_swatch(figure))
    figure.text(0.69, 0.88, f"{counted(found.known, 'distance')}, colours to ± {length(found.limit)}", fontsize=11, color=_INK)


def _swatch(figure: "Figure") -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((0.678, 0.1675), 0.007, 0.011, transform=figure.transFigure, color=np.array(NO_COUNTERPART) / 255)
