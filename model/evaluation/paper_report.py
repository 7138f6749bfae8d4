"""The paper's table as text, CSV and LaTeX, with the rows that the paper published."""

import csv
import io
import math
from pathlib import Path

from ..common.files.atomic_write import write_atomic
from .paper_table import NO_NETWORK

PUBLISHED = (
    ("paper", 1920, 1440, 16.10, 0.34, 0.74, 13.63), ("paper", 960, 720, 16.29, 0.34, 0.71, 49.71),
    ("Pointersect (paper)", 1920, 1440, 14.94, 0.49, 0.60, 0.006), ("Pointersect (paper)", 960, 720, 14.97, 0.48, 0.55, 0.021),
)
"""Rows of the paper: method, width, height, PSNR, LPIPS as published, SSIM, frames/s on an RTX 4090; 55 scenes of ScanNet++ v2,
all points."""
NOTE = "published rows: RTX 4090, 55 scenes of ScanNet++ v2, which may differ from the places above"
_FIGURES = ("psnr", "ssim", "lpips_published", "lpips", "squeeze", "known")
_SPECIAL = {"\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
            "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}


def ordered(rows: list[dict]) -> list[dict]:
    """Large pictures first, then all points, then hole filling, then by name."""
    return sorted(rows, key=lambda r: (-r["width"], -r["density"], r["method"] != NO_NETWORK, r["method"]))


def _figure(value: float | None, digits: int) -> str:
    return "-" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def _rate(seconds: float | None) -> str:
    """Frames per second; "-" where nothing was measured, or there is no network."""
    return f"{1 / seconds:.2f}" if seconds else "-"


def format_paper_table(result: dict) -> str:
    """The result as text: means of all places, of each place where there are several, and the published rows."""
    points = ", ".join(f"{n / 1e6:.2f}M" for n in result["points"][:5]) + (", ..." if len(result["points"]) > 5 else "")
    lines = [
        f"{len(result['places'])} places ({points} points); only pixels the scan covers count (their share: column known)",
        f"frames/s: reference implementation in torch, projection to picture; network/s: the network alone; "
        f"{result['device']}, {result['precision']}",
        f"LPIPS: {result['lpips']}" + (f" ({result['lpips_missing']})" if result["lpips_missing"] else "")
        + "; [0,1] as in the published code, [-1,1] as defined",
    ]
    if result["skipped"]:
        lines.append(f"{result['skipped']} pictures left out, as the scan covers none of their pixels")
    wide = max([24, *(len(row["method"]) for row in result["rows"])])
    lines.append(f"{'method':{wide}} {'size':>10} {'points':>7} {'PSNR':>6} {'LPIPS[0,1]':>13} {'LPIPS[-1,1]':>13} "
                 f"{'SqueezeNet':>13} {'SSIM':>6} {'frames/s':>9} {'network/s':>9} {'known':>6}")
    lines += [_line(row, result, wide) for row in ordered(result["rows"])]
    for name, width, height, psnr, lpips, similar, rate in PUBLISHED:
        lines.append(f"{name:{wide}} {width:>5}x{height:<4} {'100%':>7} {psnr:>6.2f} {lpips:>13.2f} {'-':>13} {'-':>13} "
                     f"{similar:>6.2f} {rate:>9.4g} {'-':>9} {'-':>6}")
    lines.append(NOTE)
    if len(result["places"]) > 1:
        lines += ["", "places, PSNR / SSIM:"]
        lines += [f"{row['place'][:24]:24} {row['method']:{wide}} {row['width']:>5}x{row['height']:<4} {row['density']:>7.0%} "
                  f"{_figure(row['psnr'], 2)} / {_figure(row['ssim'], 3)}" for row in result["scenes"]]
    return "\n".join(lines)


def _line(row: dict, result: dict, wide: int) -> str:
    def distance(name: str, absent: bool) -> str:
        return "not available" if absent else _figure(row[name], 3)

    no_lpips, no_squeeze = result["lpips"] == "not available", not result["squeeze"]
    return (f"{row['method']:{wide}} {row['width']:>5}x{row['height']:<4} {row['density']:>7.0%} {_figure(row['psnr'], 2):>6} "
            f"{distance('lpips_published', no_lpips):>13} {distance('lpips', no_lpips):>13} "
            f"{distance('squeeze', no_squeeze):>13} {_figure(row['ssim'], 3):>6} {_rate(row['frame_s']):>9} "
            f"{_rate(row['network_s']):>9} {row['known']:>6.0%}")


def write_csv(result: dict, path: Path) -> None:
    """A row for each picture of each method; a figure that is not available is empty.  Raises OSError."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["place", "view", "method", "width", "height", "density", *_FIGURES])
    for row in result["pictures"]:
        named = [row[name] for name in ("place", "view", "method", "width", "height", "density")]
        writer.writerow([*named, *("" if math.isnan(row[name]) else repr(row[name]) for name in _FIGURES)])
    write_atomic(path, lambda partial: partial.write_text(text.getvalue(), encoding="utf-8"))


def write_latex(result: dict, path: Path) -> None:
    """The table of all places for a paper: ``\\usepackage{booktabs}``.  Raises OSError."""
    lines = [
        f"% pointglass {result['version']}, seed {result['seed']}, {len(result['places'])} places, {result['device']}",
        r"\begin{tabular}{llrrrrr}", r"\toprule",
        r"Method & Size & Points & PSNR $\uparrow$ & LPIPS $\downarrow$ & SSIM $\uparrow$ & Frames/s $\uparrow$ \\",
        r"\midrule",
    ]
    for row in ordered(result["rows"]):
        lines.append(_cells(row["method"], row["width"], row["height"], row["density"], _figure(row["psnr"], 2),
                            _figure(row["lpips_published"], 3), _figure(row["ssim"], 3), _rate(row["frame_s"])))
    lines.append(r"\midrule")
    lines += [_cells(name, width, height, 1.0, f"{psnr:.2f}", f"{lpips:.2f}", f"{similar:.2f}", f"{rate:.4g}")
              for name, width, height, psnr, lpips, similar, rate in PUBLISHED]
    lines += [r"\bottomrule", r"\end{tabular}", f"% {NOTE}"]
    write_atomic(path, lambda partial: partial.write_text("\n".join(lines) + "\n", encoding="utf-8"))


def _cells(method: str, width: int, height: int, density: float, *figures: str) -> str:
    name = "".join(_SPECIAL.get(letter, letter) for letter in method)
    return " & ".join((name, rf"${width}\times{height}$", rf"{density:.0%}".replace("%", r"\%"),
                       *("--" if figure == "-" else figure for figure in figures))) + r" \\"
