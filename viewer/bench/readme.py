"""The README's and the model card's figures, from what the benches left in ``out/bench``: ``python -m viewer.bench.readme``.

``make figures`` runs the benches and then this.  Text between the markers ``<!-- NAME -->`` and ``<!-- /NAME -->`` is
replaced; a bench whose file is not there leaves its block as it is, and is named.
"""

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from viewer.tools.files import write_whole

METHODS = {
    "raw": "raw", "pull-push, paper's filter": "pull-push, paper's filter", "pull-push, our filter": "pull-push, our filter",
    "pull-push, NPBG++": "pull-push, NPBG++'s visibility", "pull-push, true visibility": "pull-push, true visibility",
    "Open3D, 1 px": "Open3D, points of 1 pixel", "Open3D, 5 px": "Open3D, points of 5 pixels",
}


def _views(bench: dict[str, Any]) -> str:
    totals = (bench["views"][view]["total"] for view in ("raw", "filtered", "filled", "neural"))
    return " | ".join(f"{t['p50']:.0f} / {t['p95']:.0f}" for t in totals)


def frames(files: dict[str, dict]) -> str:
    """Milliseconds a frame, and what else the run-time benches measured."""
    first = files["frame-plant_room"]
    machine = first["machine"]
    lines = [
        f"{machine['cores']} cores of an {machine['processor']}, software OpenGL ({first['opengl']}), torch "
        f"{machine['versions']['torch']}. Milliseconds a frame, p50 / p95, eight cameras turning in the middle of the scan.",
        "", "| scan, size, network | raw | filtered | filled | neural |", "|---|---|---|---|---|",
    ]
    for name, label in (
        ("frame-plant_room", "plant room, 11.6 M points, 960x720, balanced"),
        ("frame-plant_room-fast", "the same, fast"),
        ("frame-plant_room-lod4", "the same, balanced, level of detail 4 points a pixel"),
        ("frame-demo-1920", "demo, 1.35 M points, 1920x1440, balanced"),
    ):
        if name in files:
            lines.append(f"| {label} | {_views(files[name])} |")
    lines.append("")
    if {"raster-compute", "raster-points"} <= files.keys():
        fast, slow = (files[f"raster-{k}"]["views"]["raw"]["raster"]["p50"] for k in ("compute", "points"))
        lines.append(f"- Rasterising studio.laz (3.2 M points, 960x720): compute {fast:.0f} ms, primitives {slow:.0f} ms.")
    if "open-plant_room" in files:
        times = files["open-plant_room"]["milliseconds"]
        lines.append(f"- Opening the plant room (79 MB LAZ): {times['from the files'] / 1e3:.1f} s from the file, "
                     f"{times['cache to first picture'] / 1e3:.2f} s from the cache to the first picture.")
    if "grid" in files:
        grid = files["grid"]
        runs = ", ".join(f"{v:.1f}" for v in grid["all_ms_per_million"])
        lines.append(f"- Grid from arrays in memory: {grid['ms_per_million']:.1f} ms per 1 M points (best of {runs}).")
    return "\n".join(lines)


def truth(files: dict[str, dict]) -> str:
    """Pictures against registered truth."""
    found = files["evaluate"]
    lines = [f"{found['scene']}, {found['views']} views, {found['points'] / 1e6:.1f} M points; distance: "
             f"{found['distance']}.", "",
             "| picture | points | exposures | PSNR | SSIM | distance |", "|---|---|---|---|---|---|"]
    for row in sorted(found["rows"], key=lambda r: (-r["density"], r["exposure"] == "matched", r["psnr"] or 0)):
        method = row["method"]
        name = METHODS.get(method, f"**neural**, {method.removeprefix('network ')}")
        if method in METHODS or method.startswith("network"):
            lines.append(f"| {name} | {row['density']:.0%} | {row['exposure']} | {row['psnr']:.2f} | {row['ssim']:.3f} | "
                         f"{row['distance']:.3f} |")
    if found["flicker"]:
        lines += ["", f"Along {found['frames']} frames of a slow move, against the truth's own change and gradient energy:", "",
                  "| picture | points | change | gradient energy |", "|---|---|---|---|"]
        lines += [f"| {row['method'].removeprefix('network ')} | {row['density']:.0%} | {row['flicker']:.2f} | "
                  f"{row['gradient']:.2f} |" for row in found["flicker"]
                  if row["method"].startswith("network") or row["method"] == "pull-push, our filter"]
    return "\n".join(lines)


def precision(files: dict[str, dict]) -> str:
    """Half precision against fp32."""
    lines = ["| weights | numbers | unit | largest | 99.9th percentile | PSNR | NaN |", "|---|---|---|---|---|---|---|"]
    units = {1e-3: "kilometre", 1.0: "metre", 1e3: "millimetre"}
    for row in files["evaluate"].get("precision") or []:
        unit = units.get(row["scale"], row["scale"])
        lines.append(f"| {row['method']} | {row['precision']} | {unit} | {row['largest']:.4f} | {row['percentile']:.4f} | "
                     f"{row['psnr']:.2f} | {row['nan']} |")
    return "\n".join(lines)


def ablation(files: dict[str, dict]) -> str:
    """Variants of the fast network."""
    found = files["ablation"]
    lines = [f"Fast size, {found['steps']} steps of {found['batch']} crops of {found['crop']}x{found['crop']} from nothing, "
             "judged on validation pairs of mixed densities; milliseconds on a busy core:", "",
             "| variant | PSNR | distance | change | energy | MAC a pixel | ms |", "|---|---|---|---|---|---|---|"]
    lines += [f"| {r['variant']} | {r['psnr']:.2f} | {r['distance']:.3f} | {r['change']:.4f} | {r['energy']:.2f} | "
              f"{r['mac']:,.0f} | {r['milliseconds']:.0f} |" for r in found["rows"]]
    return "\n".join(lines)


BLOCKS: dict[str, tuple[Callable[[dict[str, dict]], str], str]] = {
    "frames": (frames, "frame-plant_room"), "truth": (truth, "evaluate"), "precision": (precision, "evaluate"),
    "ablation": (ablation, "ablation"),
}
"""Block -> what writes it, and the file it cannot do without."""


def filled(text: str, files: dict[str, dict]) -> str:
    """``text`` with its blocks renewed from ``files`` (name of a bench file without suffix -> its contents)."""
    for name, (write, needed) in BLOCKS.items():
        if needed in files:
            body = write(files)
            block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.S)
            text = block.sub(lambda m, b=body: f"{m[1]}{b}\n{m[2]}", text)
    return text


def main(folder: Path, documents: list[Path]) -> int:
    """Renews ``documents`` from the JSON files in ``folder``."""
    files = {path.stem: json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))}
    for document in documents:
        text = filled(document.read_text("utf-8"), files)
        write_whole(document, lambda p, t=text: p.write_text(t, "utf-8"))
    missing = sorted({needed for _, needed in BLOCKS.values()} - files.keys())
    print(f"figures from {folder}" + (f"; not there: {', '.join(missing)}" if missing else ""))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path("out/bench"), [Path("README.md"), Path("assets/weights/README.md")]))
