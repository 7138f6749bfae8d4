#!/usr/bin/env python3
"""Everything that needs a CUDA GPU, in one go: the doctor, the GPU tests, the tests of pictures that may differ between
drivers, and the benches.  Under nine minutes.

    python3 tests/gpu/run.py --out FOLDER            where there is a GPU
    python tests/gpu/run.py --small --out FOLDER     the plumbing alone, on the CPU with a tiny scan

Writes FOLDER/PAGE.md (each promise, its figure, pass or fail: a minute's reading), results.json (every figure), log.txt and two
plots.  PAGE.md and results.json are rewritten after each part, so that a loss of the machine costs one part.  Each part is a
process of its own with a time limit: one that fails or hangs does not end the rest.  The exit code is 1 where a part failed or
a promise is broken.  Needs no window, no open3d, no imgui; makes its scans itself.

On a bare machine that has torch but cannot reach a registry, carry the wheels (Python 3.12, Linux) and OpenGL's loaders:

    python3 -m pip download --no-deps --only-binary=:all: --python-version 3.12 --implementation cp \\
        --platform manylinux_2_28_x86_64 --platform manylinux_2_27_x86_64 --platform manylinux_2_24_x86_64 \\
        --platform manylinux_2_17_x86_64 --platform manylinux2014_x86_64 --platform manylinux1_x86_64 -d .whl \\
        moderngl glcontext laspy lazrs platformdirs
    mkdir -p .gl && (cd .gl && apt-get download libegl1 libglvnd0 libopengl0 libgl1 libglx0 libgles2)

and there, in one command (525 s of this script and what comes before it fit into 600):

    for f in .gl/*.deb; do dpkg -x "$f" /; done; ldconfig
    v=$(find /usr /etc -path '*egl_vendor.d/10_nvidia.json' | head -n 1)
    [ -z "$v" ] || export __EGL_VENDOR_LIBRARY_FILENAMES="$v"
    python3 -m pip install -q --no-index --no-deps --target /tmp/site .whl/*.whl && export PYTHONPATH=/tmp/site
    python3 tests/gpu/run.py --out "$OUT"

ldconfig is what lets glcontext find them, and the variable what lets them find NVIDIA's driver, which a container may have in
a place of its own.  numba, numpy, scipy, pillow, tqdm, matplotlib, safetensors and pytest are expected there, and cuda-core,
cuda-bindings and cuda-pathfinder: where the doctor's ``interop`` says that they are not installed or too old, add all three
above (15 MB).
This file imports nothing beyond Python's own library.
"""

import argparse
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from page import FAIL, PROMISES, page, verdicts
from plan import SMALL, Plan

ROOT = Path(__file__).resolve().parents[2]
TOTAL = 525.0
"""Seconds for everything."""
_LAST = 5.0  # seconds kept for writing the results


@dataclass(frozen=True)
class Part:
    """One process.  seconds: its limit.  command: its arguments to Python, from the plan and a folder to work in.  json:
    a file in that folder it leaves (JSON, or pytest's .xml), or None: its last line is JSON; "" : it leaves none.
    plot: a file it leaves."""

    name: str
    seconds: float
    command: Callable[[Plan, Path], list[str]]
    json: str | None = ""
    plot: str | None = None


def _bench(kind: str, plan: Plan, work: Path, name: str, *more: str) -> list[str]:
    return ["-m", "pointglass.viewer", "bench", kind, *more, "--json", str(work / f"{name}.json")]


def _frame(number: int) -> Part:
    def command(plan: Plan, work: Path) -> list[str]:
        plot = ["--plot", str(work / "frame.png")] if number == 1 else []
        return _bench("frame", plan, work, f"frame-{number}", str(work / "scan"), "--size", plan.sizes[number],
                      "--device", plan.device, *plot)

    return Part(f"frame-{number}", 60, command, f"frame-{number}.json", "frame.png" if number == 1 else None)


def _worker(name: str) -> Callable[[Plan, Path], list[str]]:
    script = str(Path(__file__).with_name("workers.py"))
    return lambda plan, work: [script, name, str(work), *(["--small"] if plan is SMALL else [])]


def _versus(plan: Plan, work: Path) -> list[str]:
    return _bench("versus", plan, work, "versus", str(work / "scan"), "--size", ",".join(plan.sizes[:2]), "--device",
                  plan.device, "--plot", str(work / "versus.png"), *(["--frames", "1"] if plan is SMALL else []))


def _scale(plan: Plan, work: Path) -> list[str]:
    return _bench("scale", plan, work, "scale", "--points", plan.scale, "--size", plan.sizes[0], "--repeats", "1",
                  "--device", plan.device)


def _pytest(work: Path, name: str, *which: str) -> list[str]:
    # without the project's own options: one of them is of pytest-timeout, which a bare machine has not.  Every test by name,
    # and where one hangs: what a driver keeps from returning is cut short, and the log is all there is of it.
    return ["-m", "pytest", *which, "-v", "--tb=short", "-rfEs", "-p", "no:cacheprovider", "-o", "addopts=",
            "-o", "faulthandler_timeout=60", "--durations=5", f"--junitxml={work / name}.xml"]


def _pictures(plan: Plan, work: Path) -> list[str]:
    # what fails is told at the end only: soon, where all does
    names = ("frame", "sums", "auto_raster", "occlusion", "stations")
    return _pytest(work, "pictures", *(f"tests/gl/test_{name}.py" for name in names), "--maxfail=10",
                   *(["-k", "any_sum"] if plan is SMALL else []))


PARTS = (
    Part("doctor", 60, lambda *_: ["-m", "pointglass.viewer", "doctor", "--json"], None),
    Part("tests", 150, lambda _plan, work: _pytest(work, "tests", "tests/gpu"), "tests.xml"),
    Part("pictures", 100, _pictures, "pictures.xml"),
    Part("scan", 60, _worker("scan"), None),
    *(_frame(number) for number in range(len(Plan.sizes))),
    Part("projected", 70, _worker("projected"), None),
    Part("versus", 120, _versus, "versus.json", "versus.png"),
    Part("agreement", 40, _worker("agreement"), None),
    Part("growth", 60, _worker("growth"), None),
    Part("workgroups", 40, _worker("workgroups"), None),
    Part("scale", 90, _scale, "scale.json"),
    Part("engines", 110, _worker("engines"), None),
    Part("grid", 45, lambda plan, work: _bench("grid", plan, work, "grid", "--points", str(plan.grid)), "grid.json"),
    Part("open", 30, lambda plan, work: _bench("open", plan, work, "open", str(work / "scan"), "--device", plan.device),
         "open.json"),
)
"""In the order of what would be missed most: the last ones are cut short where time runs out."""


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/gpu"))
    parser.add_argument("--small", action="store_true", help="on the CPU with a tiny scan: does the script itself work?")
    parser.add_argument("--only", help="names of parts, comma-separated (default: all)")
    parser.add_argument("--seconds", type=float, default=TOTAL)
    options = parser.parse_args()
    plan = SMALL if options.small else Plan()
    names = [part.name for part in PARTS]
    wanted = options.only.split(",") if options.only else names
    if unknown := set(wanted) - set(names):
        parser.error(f"--only {','.join(sorted(unknown))}: there are {', '.join(names)}")
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="pointglass-gpu-") as folder, open(options.out / "log.txt", "w") as log:
        results = _all(plan, [part for part in PARTS if part.name in wanted], Path(folder), options.out, log, options.seconds)
    print(page(results), end="")
    broken = any(verdict.state == FAIL for _, verdict in verdicts(results))
    return 1 if broken or any(held["said"] != "done" for held in results["parts"].values()) else 0


def _all(plan: Plan, parts: list[Part], work: Path, out: Path, log, seconds: float) -> dict:
    begun = time.monotonic()
    results: dict = {"machine": _machine(), "plan": vars(plan) | {"small": plan is SMALL}, "parts": {}}
    for part in parts:
        left = seconds - _LAST - (time.monotonic() - begun)
        if part.name.startswith("frame-") and int(part.name[6:]) >= len(plan.sizes):
            continue
        if left < 5:
            results["parts"][part.name] = {"seconds": 0.0, "said": "left out: no time was left", "result": None}
        else:
            results["parts"][part.name] = _run(part, plan, work, out, log, min(part.seconds, left))
        text = json.dumps(results, indent=1)
        for name, written in (("results.json", text), ("PAGE.md", page(results))):
            (out / f"{name}.partial").write_text(written)
            (out / f"{name}.partial").replace(out / name)
    return results


def _run(part: Part, plan: Plan, work: Path, out: Path, log, limit: float) -> dict:
    """Runs one part; what it said and measured."""
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1", "MPLBACKEND": "Agg",
        "POINTGLASS_CACHE": str(work / "cache"),
    }
    if plan is not SMALL:
        environment["POINTGLASS_EXPECT_GPU"] = "1"
    log.write(f"\n== {part.name}, at most {limit:.0f} s\n")
    log.flush()
    begun = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, *part.command(plan, work)], cwd=ROOT, env=environment, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True, errors="replace",
    )
    try:
        said, output = "", process.communicate(timeout=limit)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)  # its own session: children too
        output = process.communicate()[0]
        said = f"cut short after {limit:.0f} s"
    seconds = time.monotonic() - begun
    log.write(output)
    log.flush()
    if not said:
        said = "done" if process.returncode == 0 else f"failed ({process.returncode})"
    result = None
    try:
        if part.json and part.json.endswith(".xml"):
            result = _cases(work / part.json)
        elif part.json:
            result = json.loads((work / part.json).read_text())
        elif part.json is None:
            result = json.loads(output[output.index("{") :])
        elif output.strip():
            result = output.strip().splitlines()[-1]
    except (OSError, ValueError, ElementTree.ParseError) as error:
        said = f"{said}, no result ({error})"
    if part.plot and (work / part.plot).is_file():
        shutil.copyfile(work / part.plot, out / part.plot)
    return {"seconds": round(seconds, 1), "said": said, "result": result}


def _cases(path: Path) -> dict:
    """{"cases": {test: passed, failed or skipped}} of a report of pytest's."""
    cases = {}
    for case in ElementTree.parse(path).getroot().iter("testcase"):
        kinds = {child.tag for child in case}
        state = "failed" if kinds & {"failure", "error"} else "skipped" if "skipped" in kinds else "passed"
        cases[f"{case.get('classname')}.{case.get('name')}"] = state
    return {"cases": cases}


def _machine() -> dict:
    """Without any library: the system, and what nvidia-smi says."""
    query = ["nvidia-smi", "--query-gpu=name,driver_version,memory.total", "--format=csv,noheader"]
    try:
        gpu = subprocess.run(query, capture_output=True, text=True, timeout=30).stdout.strip() or None
    except (OSError, subprocess.SubprocessError):
        gpu = None
    return {"system": platform.platform(), "python": platform.python_version(), "cores": os.cpu_count(), "gpu": gpu}


__all__ = ["PROMISES", "main"]

if __name__ == "__main__":
    sys.exit(main())
