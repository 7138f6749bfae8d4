"""Frame times that a person records (F9): a row a frame, as a table and as a plot."""

import csv
import io

import numpy as np

from ...render.frame import FrameCost

STAGES = ("cull", "raster", "filter", "fill", "network", "present")
"""Columns of the recording, milliseconds; a stage that a view does not need stays empty."""
_COLUMNS = (
    "frame", "seconds", "interval_ms", "total_ms", *(f"{stage}_ms" for stage in STAGES),
    "points_drawn", "cells_drawn", "width", "height", "views", "raster", "network",
)  # fmt: skip


class FrameTimes:
    """Records the stage times of every frame drawn, and gives them as a table and as a plot."""

    def __init__(self) -> None:
        self._rows: list[dict] = []
        self._start: float | None = None
        self._last = 0.0

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, now: float, cost: FrameCost, size: tuple[int, int], views: tuple[str, ...]) -> None:
        """One frame.  now: seconds on any steady clock.  size: pixels."""
        first = self._start is None
        start = self._start = now if self._start is None else self._start
        row = {
            "frame": len(self._rows), "seconds": f"{now - start:.6f}",
            "interval_ms": "" if first else f"{(now - self._last) * 1e3:.3f}", "total_ms": f"{cost.total_ms:.3f}",
            "points_drawn": cost.points_drawn, "cells_drawn": cost.facts.cells_drawn,
            "width": size[0], "height": size[1], "views": "+".join(views), "raster": cost.facts.raster,
            "network": cost.facts.network or "",
        }  # fmt: skip
        row |= {f"{stage}_ms": f"{cost.stages[stage]:.3f}" for stage in STAGES if stage in cost.stages}
        self._rows.append(row)
        self._last = now

    def plot(self) -> bytes:
        """A PNG: the milliseconds of each frame by stage, stacked, over the seconds."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        seconds = np.array([float(row["seconds"]) for row in self._rows])
        parts = {stage: np.array([float(row.get(f"{stage}_ms") or 0.0) for row in self._rows]) for stage in STAGES}
        parts = {stage: values for stage, values in parts.items() if values.any()}
        total = np.array([float(row["total_ms"]) for row in self._rows])
        figure = Figure(figsize=(9.6, 4.8), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        if parts:
            axes.stackplot(seconds, *parts.values(), labels=list(parts), step="mid", alpha=0.85)
        axes.step(seconds, total, where="mid", color="black", linewidth=0.8, label="total")
        middle, slow = np.percentile(total, [50, 95])
        axes.set(xlabel="seconds", ylabel="milliseconds a frame", ylim=(0, None),
                 title=f"{len(total)} frames, median {middle:.1f} ms, 95 % below {slow:.1f} ms")
        axes.legend(loc="upper right", ncols=4, fontsize=8, frameon=False)
        axes.spines[["top", "right"]].set_visible(False)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png")
        return buffer.getvalue()

    def csv(self) -> bytes:
        """The table, a row a frame."""
        text = io.StringIO()
        writer = csv.DictWriter(text, _COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(self._rows)
        return text.getvalue().encode()
