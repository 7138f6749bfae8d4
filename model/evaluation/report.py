"""Results of an evaluation as text, JSON and plot.  All files are written with an atomic write."""

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..common.errors import DataError
from ..common.files.atomic_write import passes_through, write_atomic
from .worse import format_summary

PLOT_SUFFIXES = (".png", ".svg", ".pdf")
"""File types of a plot."""


@dataclass(frozen=True)
class Column:
    """A column of a table: heading, key in the row, format string of the value."""

    heading: str
    key: str
    form: str


PICTURES = (
    Column("points", "density", "{:.4g}%"), Column("exposure", "exposure", "{}"), Column("PSNR", "psnr", "{:.2f}"),
    Column("gain", "psnr_gain", "{:.2f}"), Column("SSIM", "ssim", "{:.3f}"), Column("distance", "distance", "{:.3f}"),
    Column("FLIP", "flip", "{:.3f}"), Column("invented", "invented", "{:.3f}"), Column("inv.PSNR", "invented_psnr", "{:.2f}"),
    Column("inv.err", "invented_error", "{:.4f}"), Column("inv.dist", "invented_distance", "{:.3f}"),
    Column("kept", "kept", "{:.3f}"), Column("leaked", "leaked", "{:.3f}"), Column("ms", "ms", "{:.0f}"),
    Column("net ms", "network_ms", "{:.0f}"), Column("MAC/px", "mac", "{:.0f}"),
)
MOVES = (
    Column("points", "density", "{:.4g}%"), Column("exposure", "exposure", "{}"), Column("flicker", "flicker", "{:.2f}"),
    Column("gradient", "gradient", "{:.3f}"), Column("change", "change", "{:.4f}"), Column("compared", "valid", "{:.3f}"),
)


def _cell(row: dict, column: Column) -> str:
    value = row.get(column.key)
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return column.form.format(100 * value if column.key == "density" else value)


def table(rows: list[dict], columns: tuple[Column, ...]) -> list[str]:
    """Lines of text: the method's name, then right-aligned values, a dash for a missing one.  Empty columns are omitted."""
    columns = tuple(column for column in columns if any(_cell(row, column) != "-" for row in rows))
    cells = [[str(row["method"]), *(_cell(row, column) for column in columns)] for row in rows]
    head = ["picture", *(column.heading for column in columns)]
    widths = [max(map(len, column)) for column in zip(head, *cells, strict=True)]
    return ["  ".join([line[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True))])
            for line in (head, *cells)]


def _threads(result: dict) -> str:
    return "one CPU thread" if result["threads"] == 1 else f"{result['threads']} CPU threads"


def format_table(result: dict) -> str:
    """The result as text, the worst first within each density and exposure."""
    lines = [
        f"{result['scene']}, {result['views']} views, {result['points']:,} points; distance: {result['distance']}"
        + (f"; ms: torch, {_threads(result)}, from the points in view to the picture" if any(r["ms"] for r in result["rows"])
           else ""),
        "invented (inv.): pixels outside the mask of our filter, the same for all methods",
    ]
    rows = sorted(result["rows"], key=lambda r: (-r["density"], r["exposure"], r["psnr"]))
    lines += table(rows, PICTURES)
    for row in sorted((r for r in rows if r["against_filled"]), key=lambda r: -r["against_filled"]["ratio"]):
        found = row["against_filled"]
        lines.append(f"{row['method']}, {100 * row['density']:.4g}%, {row['exposure']}: {format_summary(found)}; error ratio "
                     f"{found['ratio']:.3f}, worst view {found['worst_view']} {found['worst_ratio']:.3f}")
    if any(row["against_filled"] for row in rows):
        lines.append("error ratio: neural / filled; geometric mean over root mean square error, 1 - SSIM, distance and FLIP")
    lines += [f"not in the table: {name}: {reason}" for name, reason in result["absent"].items()]
    if result["exposures"]:
        gains = zip(result["exposures"]["gains"], result["exposures"]["matched"], strict=True)
        lines.append("matched: stations' gains " + "; ".join(
            " ".join(f"{g:.3f}" for g in gain) + ("" if matched else " (not matched)") for gain, matched in gains))
    if result["flicker"]:
        lines += ["", f"along {result['frames']} frames of the path: change between successive frames (flicker) and gradient "
                      "energy, 1 = as the true pictures"]
        lines += table(sorted(result["flicker"], key=lambda r: (-r["density"], -r["flicker"])), MOVES)
    return "\n".join(lines)


def save_picture(picture: np.ndarray, path: Path) -> None:
    """Writes (H, W, 3) uint8 as PNG."""
    from PIL import Image

    write_atomic(path, lambda partial: Image.fromarray(picture).save(partial, format="PNG"))


def check_output(path: Path, suffixes: tuple[str, ...] = ()) -> None:
    """Raises DataError if a file of this name cannot be written; to be called before long work.

    suffixes: allowed file types; all if empty.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise DataError(f"the name must end in {', '.join(suffixes)}", file=path)
    if passes_through(path):
        return
    if path.is_dir() or not path.absolute().parent.is_dir() or not os.access(path.absolute().parent, os.W_OK):
        raise DataError("cannot be written; its folder must exist and be writable, and the path must not be a folder",
                        file=path)


def plot(result: dict, path: Path) -> None:
    """Plots PSNR and perceptual distance against milliseconds, with a column of panels for each density.

    Filled marks: with exposure compensation; hollow: as scanned; dashed lines: methods of unknown duration.  Raises DataError
    if the file cannot be written or has none of PLOT_SUFFIXES.
    """
    check_output(path, PLOT_SUFFIXES)
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter

    rows = result["rows"]
    densities = sorted({row["density"] for row in rows}, reverse=True)
    measures = [("psnr", "PSNR, dB")]
    if any(math.isfinite(row["distance"]) for row in rows):
        measures.append(("distance", result["distance"]))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    colours = {name: f"C{k % 10}" for k, name in enumerate(methods)}
    marks = {name: "osD^v"[k // 10 % 5] for k, name in enumerate(methods)}
    figure = Figure(figsize=(5.2 * len(densities) + 3.4, 3.8 * len(measures)), layout="constrained")
    panels = figure.subplots(len(measures), len(densities), squeeze=False, sharex="col")
    for line, (key, label) in zip(panels, measures, strict=True):
        for panel, density in zip(line, densities, strict=True):
            for row in rows:
                name = row["method"]
                if row["density"] != density or not math.isfinite(row[key]):
                    continue
                if row["ms"] is None:
                    panel.axhline(row[key], color=colours[name], linestyle="--", linewidth=1)
                else:
                    face = "none" if row["exposure"] == "scanned" else colours[name]
                    panel.plot(row["ms"], row[key], marks[name], color=colours[name], markerfacecolor=face)
            panel.set_xscale("log")
            panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5)))
            panel.xaxis.set_major_formatter("{x:g}")
            panel.xaxis.set_minor_formatter(NullFormatter())
            panel.set_ylabel(label)
            panel.grid(alpha=0.3)
            panel.set_title(f"{100 * density:g} % of the points" if key == "psnr" else "")
    for panel in panels[-1]:
        panel.set_xlabel(f"ms, torch, {_threads(result)}")
    for name in methods:
        panels[0][-1].plot([], [], marks[name], color=colours[name], label=name)
    figure.legend(loc="outside right center", fontsize="small", title="filled: matched\nhollow: as scanned")
    figure.suptitle(f"{result['scene']}, {result['views']} views")
    write_atomic(path, lambda partial: figure.savefig(partial, format=path.suffix[1:].lower(), dpi=130))
