"""What a person keeps: screenshots as PNG and frame times as CSV, written beside and renamed, never half there."""

import contextlib
import csv
import io
import itertools
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import numpy as np

from ....model.common.files.atomic_write import write_atomic
from ....model.common.files.temporary import reserved
from ...common.errors import InputError
from ...common.files import write_png

STAGES = ("cull", "raster", "filter", "fill", "network", "present")
"""Columns of the recording, milliseconds; a stage that a view does not need stays empty."""
_COLUMNS = (
    "frame", "seconds", "interval_ms", "total_ms", *(f"{stage}_ms" for stage in STAGES),
    "points_drawn", "cells_drawn", "width", "height", "views", "raster", "network",
)  # fmt: skip


@contextlib.contextmanager
def stamped(prefix: str, suffix: str, folder: Path) -> Iterator[Path]:
    """``prefix-YYYYmmdd-HHMMSS.suffix`` in ``folder``, with a number where that is taken, also by another window that saves in
    the same second: the name is reserved within the block.  Raises InputError where the folder cannot be written."""
    stem = f"{prefix}-{datetime.now():%Y%m%d-%H%M%S}"
    first = folder / f"{stem}{suffix}"
    with contextlib.ExitStack() as stack:
        try:
            path = stack.enter_context(reserved(
                first if number == 1 else folder / f"{stem}-{number}{suffix}" for number in itertools.count(1)))  # fmt: skip
        except OSError as error:
            raise _unwritable(first, error) from None
        yield path


def write_beside(path: Path, data: bytes) -> None:
    """Writes ``path`` in one step.  Raises InputError naming the file and the cause; nothing is left behind then."""
    try:
        write_atomic(path, lambda beside: beside.write_bytes(data))
    except OSError as error:
        raise _unwritable(path, error) from None


def save_png(path: Path, image: np.ndarray, text: dict[str, str] | None = None) -> None:
    """Writes (H, W, 3) or (H, W, 4) uint8, row 0 on top, with the text kept inside, the same bytes as ``render``.

    Raises InputError if it cannot be written.
    """
    try:
        write_png(path, image, text)
    except OSError as error:
        raise _unwritable(path, error) from None


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(f"{path}: cannot be written ({error.strerror or error}); "
                      "choose a folder that has room and can be written to")


class FrameTimes:
    """Records the stage times of every frame drawn, from :meth:`add` to :meth:`save`."""

    def __init__(self) -> None:
        self._rows: list[dict] = []
        self._start: float | None = None
        self._last = 0.0

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, now: float, stats: dict, size: tuple[int, int], views: tuple[str, ...]) -> None:
        """One frame.  now: seconds on any steady clock.  stats: as ``Frame.stats``.  size: pixels."""
        first = self._start is None
        start = self._start = now if self._start is None else self._start
        row = {
            "frame": len(self._rows), "seconds": f"{now - start:.6f}",
            "interval_ms": "" if first else f"{(now - self._last) * 1e3:.3f}", "total_ms": f"{stats['total_ms']:.3f}",
            "points_drawn": stats["points_drawn"], "cells_drawn": stats["cells_drawn"],
            "width": size[0], "height": size[1], "views": "+".join(views), "raster": stats["raster"],
            "network": stats["network"] or "",
        }  # fmt: skip
        row |= {f"{stage}_ms": f"{stats['stages'][stage]:.3f}" for stage in STAGES if stage in stats["stages"]}
        self._rows.append(row)
        self._last = now

    def plot(self, path: Path) -> None:
        """Writes a PNG: the milliseconds of each frame by stage, stacked, over the seconds.  Raises InputError."""
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
        write_beside(path, buffer.getvalue())

    def save(self, path: Path) -> None:
        """Writes the CSV.  Raises InputError if it cannot be written."""
        text = io.StringIO()
        writer = csv.DictWriter(text, _COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(self._rows)
        write_beside(path, text.getvalue().encode())
