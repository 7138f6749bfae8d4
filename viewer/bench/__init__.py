"""Run time, measured and never asserted: ``pointglass bench frame | grid | open | error``.

Every result carries the machine it was had on.  Speed is shown here, not by timed tests.
"""

import argparse
import os
import platform
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viewer.settings import Settings


def machine() -> dict:
    """What a figure must be read with: processor, cores, system, versions of what does the work."""
    from importlib.metadata import PackageNotFoundError, version

    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    versions = {}
    for name in ("pointglass", "torch", "moderngl", "numpy", "numba"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"processor": processor, "cores": cores, "system": platform.platform(), "versions": versions}


def run_bench(options: argparse.Namespace, settings: "Settings") -> int:
    """Runs the bench that the command line names, prints a table, writes JSON and plot where asked."""
    from viewer.tools.demo import demo_scan
    from viewer.tools.export import parse_size
    from viewer.tools.files import write_json

    scans = options.scans or ([demo_scan()] if options.kind != "grid" else [])
    if options.kind == "grid":
        from viewer.bench.grid import run

        result = run(options.points, options.repeats)
        rows = [(name, f"{value:.2f} ms per 1M points") for name, value in result["stages_ms_per_million"].items()]
        rows.append(("total, best", f"{result['ms_per_million']:.2f} ms per 1M points"))
    elif options.kind == "open":
        from viewer.bench.opening import run_open

        result = run_open(scans, parse_size(options.size), settings)
        rows = [(name, f"{value:.0f} ms") for name, value in result["milliseconds"].items()]
    elif options.kind == "error":
        from viewer.bench.errors import run_errors

        result = run_errors(scans, parse_size(options.size), options.repeats, options.plot)
        rows = [
            (f"{row['group']}: {row['name']}", f"{row['milliseconds']:7.1f} ms  {row['time']:5.2f} of the exact frame's time"
             f"   {row['psnr']:6.2f} dB   largest {row['largest']:3.0f}"
            + (f"   mask {row['mask']:.4%}" if row["mask"] == row["mask"] else ""))
            for row in result["rows"]
        ]
    else:
        from viewer.bench.frames import run_frames

        result = run_frames(scans, parse_size(options.size), settings, options.repeats, options.plot)
        rows = [
            (f"{view}: {stage}", f"p50 {v['p50']:8.1f}   p95 {v['p95']:8.1f}   p99 {v['p99']:8.1f} ms")
            for view, stages in result["views"].items()
            for stage, v in stages.items()
        ]
    result = {"bench": options.kind, "machine": machine(), **result}
    where = result["machine"]
    print(f"{where['processor']}, {where['cores']} cores" + (f", {result['opengl']}" if "opengl" in result else ""))
    for name, text in rows:
        print(f"  {name:44} {text}")
    if options.json:
        write_json(options.json, result)
    return 0
