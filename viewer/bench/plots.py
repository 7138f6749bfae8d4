"""Plots of the benches: common style, facts of the machine below, and labels that do not overlap."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .bench_input import described

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = ("#1f5fa8", "#c2571a", "#2f7d4f", "#8a3f8f", "#b3282d", "#6b6b6b", "#a08400", "#2a8c94", "#d1497f", "#455a8c")
"""Colours of the series."""
MARKS = "osD^vPX<>h"
"""Marks of the series, as matplotlib names them."""


def figure(width: float = 8.0, height: float = 5.0, rows: int = 1, columns: int = 1) -> "tuple[Figure, Any]":
    """A figure without a window, and its axes.  width, height: inches."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    return plt.subplots(rows, columns, figsize=(width, height), layout="constrained")


def save(made: "Figure", path: Path, result: dict) -> None:
    """Writes a figure with the facts of ``result`` below it, with an atomic write."""
    from matplotlib import pyplot as plt

    from ...model.common.files.atomic_write import write_atomic

    columns = int(made.get_figwidth() * 18)
    lines = [part for line in described(result).splitlines() for part in textwrap.wrap(line, columns)]
    made.supxlabel("\n".join(lines), fontsize=6, color="grey", ha="left", x=0.01)
    write_atomic(path, lambda p: made.savefig(p, format=path.suffix.lstrip(".") or "png", dpi=150))
    plt.close(made)


def label_points(axes: "Axes", at: Sequence[tuple[float, float]], texts: Sequence[str], size: float = 6.0) -> None:
    """Labels points at the first position around them that is free of labels and points; distant labels have a line.

    at: data coordinates.  size: of the font, points.
    """
    import numpy as np
    from matplotlib.transforms import Bbox

    made: Any = axes.figure
    made.canvas.draw()
    pixels = axes.transData.transform(np.asarray(at, float).reshape(-1, 2))
    dots = [Bbox.from_extents(x - 4, y - 4, x + 4, y + 4) for x, y in pixels]
    taken: list[Bbox] = []
    frame = axes.get_window_extent()
    offsets = [(reach * dx, reach * dy) for reach in (5, 10, 18, 28, 40, 54, 70, 90)
              for dx, dy in ((1, 0.4), (1, -1), (-1, 0.4), (-1, -1), (0, 1.2), (0, -1.6))]
    for number, text in enumerate(texts):
        label, line = None, None
        for dx, dy in offsets:
            if label is not None:
                label.remove()
            far = max(abs(dx), abs(dy)) > 12
            line = {"arrowstyle": "-", "linewidth": 0.3, "color": "grey"} if far else None
            label = axes.annotate(
                text, at[number], xytext=(dx, dy), textcoords="offset points", fontsize=size, arrowprops=line,
                ha="left" if dx > 0 else "right" if dx < 0 else "center", va="center",
            )
            box = label.get_window_extent()
            box = Bbox.from_extents(*box.extents) if line is None else _text_box(label)
            others = [dot for n, dot in enumerate(dots) if n != number]
            inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
            if inside and not any(box.overlaps(other) for other in (*taken, *others)):
                break
        assert label is not None
        taken.append(_text_box(label))


def _text_box(label: Any) -> Any:
    """The bounding box of an annotation's text without its line."""
    from matplotlib.text import Text

    return Text.get_window_extent(label)
