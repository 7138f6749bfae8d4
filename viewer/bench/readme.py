"""The README's and the model card's figures, from what the benches left in ``out/bench``: ``python -m viewer.bench.readme``.

``make figures`` runs the benches and then this.  Text between the markers ``<!-- NAME -->`` and ``<!-- /NAME -->`` is
replaced; a bench whose file is not there leaves its block as it is, and is named.
"""

import json
import math
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from model.common.atomic_write import write_whole

SOFTWARE = ("llvmpipe", "softpipe", "swr")
"""In the names of OpenGL on the processor, for files that do not say which it was."""


def _views(run: dict[str, Any]) -> str:
    totals = (run["views"][view]["total"] for view in ("raw", "filtered", "filled", "neural"))
    return " | ".join(f"{t['p50']:.0f} / {t['p95']:.0f}" for t in totals)


def _software(found: dict[str, Any]) -> bool:
    """Whether its OpenGL ran on the processor."""
    known = found.get("software")
    return any(name in found["opengl"].lower() for name in SOFTWARE) if known is None else known


def _scan(found: dict[str, Any]) -> str:
    """out/plant_room.laz -> plant room."""
    return Path(found["scans"][0]).stem.replace("_", " ")


def _subject(found: dict[str, Any]) -> str:
    """Scan, points, size, quality and level of detail of a bench of frames."""
    quality = found.get("quality") or found["network"].split("-")[0]
    parts = [_scan(found), f"{found['points'] / 1e6:.1f} M points", "{}x{}".format(*found["runs"][0]["size"]), quality]
    return ", ".join([*parts, *(said.replace(": ", " ") for said in found["approximations"] if said.startswith("level of"))])


def frames(files: dict[str, dict]) -> str:
    """Milliseconds a frame, and what else the run-time benches measured."""
    first = files["frame-plant_room"]
    machine = first["machine"]
    along = first["runs"][0]["frames"]
    lines = [
        f"{machine['cores']} cores of an {machine['processor']}, {'software ' if _software(first) else ''}OpenGL "
        f"({first['opengl']}), torch {machine['versions']['torch']}. "
        f"Milliseconds a frame, p50 / p95, along a fixed path of {along} frames.",
        "", "| scan, size, network | raw | filtered | filled | neural |", "|---|---|---|---|---|",
    ]
    for name in ("frame-plant_room", "frame-plant_room-fast", "frame-plant_room-lod4"):
        if name in files:
            lines.append(f"| {_subject(files[name])} | {_views(files[name]['runs'][0])} |")
    if "frame-demo-sizes" in files:
        found = files["frame-demo-sizes"]
        for run in found["runs"]:
            size = "{}x{}".format(*run["size"])
            lines.append(f"| demo, {found['points'] / 1e6:.2f} M points, {size}, eight views | {_views(run)} |")
    lines.append("")
    lines += _skipped(files)
    if "open-plant_room" in files:
        found = files["open-plant_room"]
        times, size = found["milliseconds"], found.get("file_bytes")
        scan = Path(found["scans"][0])
        held = f" ({size / 1e6:.0f} MB {scan.suffix[1:].upper()})" if size else ""
        lines.append(f"- Opening the {_scan(found)}{held}: {times['from the files'] / 1e3:.1f} s from the file, "
                     f"{times['cache to first picture'] / 1e3:.2f} s from the cache to the first picture, "
                     f"{times['cache to every point in view'] / 1e3:.2f} s to every point in view, "
                     f"{times['cache to full quality'] / 1e3:.2f} s to the neural picture.")
    if "open-procedural" in files:
        found = files["open-procedural"]
        times = found["milliseconds"]
        lines.append(f"- Opening {found['points'] / 1e6:.0f} M points made on the spot, from the cache: "
                     f"{times['cache to first picture'] / 1e3:.2f} s to the first picture (coarse layers, "
                     f"{found['first_picture']:.0%} of the points in view), "
                     f"{times['cache to every point in view'] / 1e3:.2f} s to all of them.")
    if "grid" in files:
        grid = files["grid"]
        runs = ", ".join(f"{v:.1f}" for v in grid["all_ms_per_million"])
        lines.append(f"- Grid from arrays in memory: {grid['ms_per_million']:.1f} ms per 1 M points (best of {runs}).")
    return "\n".join(lines)


def _skipped(files: dict[str, dict]) -> list[str]:
    """What is not done, and saves time."""
    lines = []
    if "raster" in files:
        found = files["raster"]
        lines.append(f"- {found['points'] / 1e6:.0f} M points at random, both passes: {found['milliseconds']['compute']:.0f} "
                     f"ms by compute shaders; point primitives take {found['ratio']:.1f} times as long.")
    if "cull" in files:
        found = files["cull"]
        whole, less = found["detail"]["every point"], found["detail"]["1 point a pixel"]
        lines.append(f"- Of {found['cells'] / 1e6:.1f} M cells in {found['rooms']:,} rooms, seen from inside, the "
                     f"{whole['visible'] / 1e3:.0f} k in view are found in {whole['cells_ms']:.1f} ms on one core, and the "
                     f"points to draw listed in {whole['list_ms']:.1f} ms ({less['cells_ms']:.1f} and {less['list_ms']:.1f} ms "
                     "with a level of detail of 1 point a pixel).")
    if "void" in files:
        row = next(row for row in files["void"]["rows"] if row["group"] == "void")
        most = max(row["by_view"], key=lambda name: row["by_view"][name])
        scan = Path(files["void"]["scans"][0]).name
        lines.append(f"- Void left out by the network: without that a frame of {scan}, seen from outside, takes "
                     f"{row['time']:.2f} times as long (median of eight views; *{most}* "
                     f"{row['by_view'][most]:.1f} times) and is the same to the bit.")
    if "stations" in files:
        found = files["stations"]
        row = next(row for row in found["rows"] if row["group"] == "stations")
        lines.append("- Points weighed by where their scanners stood, pixels trusted and toned: with all points alike a filled "
                     f"frame of {Path(found['scans'][0]).stem} ({found['points'] / 1e6:.1f} M points, eight views) takes "
                     f"{row['time']:.2f} of the time, and is {row['psnr']:.1f} dB from the weighed one.")
    if "occlusion" in files:
        found = files["occlusion"]
        lines.append(f"- Hidden cells left out in flight: a walk through {found['rooms']} rooms of "
                     f"{found['points'] / 1e6:.0f} M points draws {found['points_drawn_share']:.0%} of the points in "
                     f"{found['all_time_share']:.0%} of the time; worst frame {found['wrong_worst']:.3%} of the pixels wrong, "
                     f"after a jump {found['wrong_after_jump']:.3%} ({_on(found)}).")
    return lines


def _on(found: dict) -> str:
    """The machine of a result, and whether it had other work."""
    where = found["machine"]
    busy = ", busy with other work" if (where.get("load") or 0) > where["cores"] + 1 else ""
    return f"{where['cores']} core{'s' if where['cores'] > 1 else ''} of an {where['processor']}{busy}"


def scale(files: dict[str, dict]) -> str:
    """Time and memory against size."""
    from viewer.bench.scaling import added

    found = files["scale"]
    lines = [f"On {_on(found)}: a floor of rooms made on the spot, the camera in one of them, level of detail "
             f"{found['lod']:g} points a pixel, "
             f"{found['size'][0]}x{found['size'][1]}; p50 of whole frames.", "",
             "| series | points | rooms | raw, ms | filled, ms | neural, ms | opens in, s | packed, MB | memory added, MB |",
             "|---|---|---|---|---|---|---|---|---|"]
    for row in found["rows"]:
        head = f"| by {row['series']} | {row['points'] / 1e6:,.0f} M | {row['rooms']} |"
        if row["fits"]:
            times = " | ".join(f"{row['milliseconds'][view]['p50']:.0f}" for view in ("raw", "filled", "neural"))
            lines.append(f"{head} {times} | {row['open_to_first_picture_s']:.2f} | "
                         f"{row['packed_bytes'] / 1e6:,.0f} | {added(row) / 1e6:,.0f} |")
        else:
            lines.append(f"{head} {row['why']} | | | | | |")
    how = ", frame by frame, side by side" if any(row.get("growth") for row in found["rows"]) else ""
    for series, grown in found["growth"].items():
        times = ", ".join(f"{view} {grown[view]:.2f}x" for view in ("raw", "filled", "neural"))
        lines.append(f"\nBy {series}, from {grown['from'] / 1e6:,.0f} M to {grown['to'] / 1e6:,.0f} M points: {times}{how}.")
    return "\n".join(lines)


def versus(files: dict[str, dict]) -> str:
    """Ours beside the published pipeline and Open3D."""
    lines = []
    for name in ("versus-plant_room", "versus-procedural"):
        if name not in files:
            continue
        found = files[name]
        machine = found["machine"]
        where = machine["gpu"]["name"] if machine.get("gpu") and found["device"] == "cuda" else \
            f"{machine['cores']} cores of an {machine['processor']}"
        lines += ([""] if lines else []) + [
            f"{Path(found['scans'][0]).name}, {found['points'] / 1e6:.1f} M points, {where}; {found['said']}.", "",
            "| size | pipeline | network | p50, ms | times ours |", "|---|---|---|---|---|"]
        for run in found["runs"]:
            ours = run["contenders"]["ours, balanced"]["milliseconds"]["total"]["p50"]
            for who, held in run["contenders"].items():
                total = held["milliseconds"]["total"]["p50"]
                lines.append(f"| {run['size'][0]}x{run['size'][1]} | {who} | {held['network'] or 'none'} | {total:,.0f} | "
                             f"{total / ours:.2f} |")
            fair = run["fairness"]
            lines += ["", f"The paper's network reached {fair['share_of_matmul']:.0%} of the measured matrix rate "
                      f"({fair['matmul_rate'] / 1e12:.2f} TFLOP/s in {run['precision']}): "
                      f"{'a fair opponent' if fair['fair'] else 'below the share that would make it a fair opponent'} "
                      f"(at least {fair['needed']:.0%})."]
    return "\n".join(lines)


def errors(files: dict[str, dict]) -> str:
    """Every approximation: time saved, error made."""
    from viewer.bench.errors import UNBEATEN, front

    found = files["error-demo"]
    judged = [{**row, "psnr": math.inf if row["psnr"] is None else row["psnr"]} for row in found["rows"]]
    best = {name for names in front(judged).values() for name in names}
    lines = [f"{Path(found['scans'][0]).name}, {found['size'][0]}x{found['size'][1]}, {_on(found)}, eight named views; time "
             f"as a share of the exact frame's; bold: {UNBEATEN}.", "",
             "| approximation | ms | time | PSNR, dB | largest | mask |", "|---|---|---|---|---|---|"]
    for row in found["rows"]:
        name = f"{row['group']}: {row['name']}"
        shown = "equal" if row["psnr"] is None else f"{row['psnr']:.1f}"
        mask = "" if row["mask"] is None else f"{row['mask']:.3%}"
        lines.append(f"| {f'**{name}**' if name in best else name} | {row['milliseconds']:.0f} | {row['time']:.2f} | {shown} | "
                     f"{row['largest']:.0f} | {mask} |")
    return "\n".join(lines)


def stability(files: dict[str, dict]) -> str:
    """Claims by group, and what came nearest to its limit."""
    found = files["stability"]
    claims = [row for row in found["rows"] if "skipped" not in row]
    hold = sum(row["ok"] for row in claims)
    machine = found["machine"]
    where = f"{machine['cores']} cores of an {machine['processor']}, {found['opengl']}, torch {machine['versions']['torch']}"
    lines = [f"{hold} of {len(claims)} claims hold, on fresh random scenes (seed {found['seed']}; {where}):", "",
             "| what | claims | nearest to its limit |", "|---|---|---|"]
    for group in dict.fromkeys(row["group"] for row in claims):
        mine = [row for row in claims if row["group"] == group]
        loose = [row for row in mine if row["limit"] > 0 and not row.get("least")]
        least = [row for row in mine if row.get("least")]
        if loose:
            worst = max(loose, key=lambda row: row["value"] / row["limit"])
            near = f"{worst['name']}: {worst['value']:.2g}, limit {worst['limit']:g}"
        elif least:
            worst = min(least, key=lambda row: row["value"] / row["limit"])
            near = f"{worst['name']}: {worst['value']:.3g}, at least {worst['limit']:g}"
        else:
            near = "all exact" if all(row["value"] == row["limit"] for row in mine) else \
                ", ".join(row["name"] for row in mine if not row["ok"])
        lines.append(f"| {group} | {len(mine)} | {near} |")
    return "\n".join(lines)


BLOCKS: dict[str, tuple[Callable[[dict[str, dict]], str], set[str]]] = {
    "frames": (frames, {"frame-plant_room"}),
    "scale": (scale, {"scale"}), "versus": (versus, {"versus-plant_room"}),
    "errors": (errors, {"error-demo"}), "stability": (stability, {"stability"}),
}
"""Block -> what writes it, and the files it cannot do without."""


def filled(text: str, files: dict[str, dict]) -> str:
    """``text`` with its blocks renewed from ``files`` (name of a bench file without suffix -> its contents)."""
    for name, (write, needed) in BLOCKS.items():
        if needed <= files.keys() and f"<!-- {name} -->" in text:
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
    missing = sorted(set[str]().union(*(needed for _, needed in BLOCKS.values())) - files.keys())
    print(f"figures from {folder}" + (f"; not there: {', '.join(missing)}" if missing else ""))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path("out/bench"), [Path("viewer/bench/README.md")]))
