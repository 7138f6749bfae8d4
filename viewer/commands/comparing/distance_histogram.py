"""The histogram of a comparison, with its colours as a legend: of ``distances.png`` and of reports."""

from typing import Any

import numpy as np

from ...work.comparing.distance_statistics import RAMP, Statistics

_INK, _QUIET = "#16191d", "#6a7078"


def shown_unit(limit: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which distances are shown: millimetres for metres where the limit is below 0.1 m."""
    return (1000.0, "mm") if unit == "m" and limit < 0.1 else (1.0, unit)


def draw_histogram(page: Any, found: Statistics, factor: float, title: str) -> None:
    """Bars in the colours of the distances, the share of each; dashed: the median uncertainty.

    page: axes of matplotlib, with room below for the ramp.  factor: of :func:`shown_unit`.  title: what is shown and its
    unit."""
    from matplotlib.colors import LinearSegmentedColormap

    colours = LinearSegmentedColormap.from_list("distance", RAMP / 255)
    edges, total = found.edges * factor, max(found.known, 1)
    middles = (edges[:-1] + edges[1:]) / 2
    share = 100 * found.bins[1:-1] / total
    page.bar(middles, share, width=np.diff(edges), color=colours((middles / edges[-1] + 1) / 2), edgecolor="#9aa0a6",
             linewidth=0.4)  # fmt: skip
    if np.isfinite(found.uncertainty):
        for side in (-1, 1):
            page.axvline(side * found.uncertainty * factor, color=_INK, linestyle=(0, (4, 3)), linewidth=0.9)
    page.set_xlim(edges[0], edges[-1])
    page.set_ylim(0, max(float(share.max(initial=0.0)) * 1.08, 1.0))
    page.set_xlabel(title, fontsize=9, color=_INK)
    page.set_ylabel("points with a distance, %", fontsize=9, color=_INK)
    page.tick_params(labelsize=8, colors=_QUIET)
    for side in ("top", "right"):
        page.spines[side].set_visible(False)
    bar = page.inset_axes((0, -0.29, 1, 0.05))
    bar.imshow(colours(np.linspace(0, 1, 256))[None], aspect="auto", extent=(edges[0], edges[-1], 0, 1))
    bar.set_yticks([])
    ticks = [edges[0], edges[0] / 2, 0.0, edges[-1] / 2, edges[-1]]
    bar.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    bar.tick_params(labelsize=8, colors=_QUIET)
