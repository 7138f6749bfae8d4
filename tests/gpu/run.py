#!/usr/bin/env python3
"""Everything that needs a CUDA GPU, in one go: the doctor, the GPU tests, those of pictures that a driver could make otherwise
than software OpenGL, and the benches.  Under nine minutes.

    python3 tests/gpu/run.py --out FOLDER          where there is a GPU
    python tests/gpu/run.py --dry --out FOLDER     the plumbing alone, on the CPU with a tiny scan

Leaves FOLDER/results.json (every part's figures; rewritten after each part, so that what was measured survives a loss),
FOLDER/log.txt and two plots.  Each part is a process of its own with a time limit: one that fails or hangs does not end the
rest.  The exit code is 1 where a part failed.  Needs no window, no open3d, no imgui; makes its scans itself.

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
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from plan import DRY, Plan

ROOT = Path(__file__).resolve().parents[2]
TOTAL = 525.0
"""Seconds for everything."""
_LAST = 5.0  # seconds kept for writing the results


@dataclass(frozen=True)
class Part:
    """One process.  seconds: its limit.  command: its arguments to Python, from the plan and a folder to work in.  json: a
    file in that folder it leaves, or None: its last line is JSON; "" : it leaves none.  plot: a file it leaves."""

    name: str
    seconds: float
    command: Callable[[Plan, Path], list[str]]
    json: str | None = ""
    plot: str | None = None


def _bench(kind: str, plan: Plan, work: Path, name: str, *more: str) -> list[str]:
    return ["-m", "viewer", "bench", kind, *more, "--json", str(work / f"{name}.json")]


def _frame(number: int) -> Part:
    def command(plan: Plan, work: Path) -> list[str]:
        plot = ["--plot", str(work / "frame.png")] if number == 1 else []
        return _bench("frame", plan, work, f"frame-{number}", str(work / "scan"), "--size", plan.sizes[number],
                      "--device", plan.device, *plot)

    return Part(f"frame-{number}", 60, command, f"frame-{number}.json", "frame.png" if number == 1 else None)


def _worker(name: str) -> Callable[[Plan, Path], list[str]]:
    script = str(Path(__file__).with_name("workers.py"))
    return lambda plan, work: [script, name, str(work), *(["--dry"] if plan is DRY else [])]


def _versus(plan: Plan, work: Path) -> list[str]:
    return _bench("versus", plan, work, "versus", str(work / "scan"), "--size", ",".join(plan.sizes[:2]), "--device",
                  plan.device, "--plot", str(work / "versus.png"), *(["--frames", "1"] if plan is DRY else []))


def _pytest(*which: str) -> list[str]:
    # without the project's own options: one of them is of pytest-timeout, which a bare machine has not.  Every test by name,
    # and where one hangs: what a driver keeps from returning is cut short, and the log is all there is of it.
    return ["-m", "pytest", *which, "-v", "--tb=short", "-rfEs", "-p", "no:cacheprovider", "-o", "addopts=",
            "-o", "faulthandler_timeout=60", "--durations=5"]


def _pictures(plan: Plan, _work: Path) -> list[str]:
    # what fails is told at the end only: soon, where all does
    names = ("frame", "sums", "auto_raster", "occlusion", "stations")
    return _pytest(*(f"tests/gl/test_{name}.py" for name in names), "--maxfail=10", *(["-k", "any_sum"] if plan is DRY else []))


PARTS = (
    Part("doctor", 60, lambda *_: ["-m", "viewer", "doctor", "--json"], None),
    Part("tests", 150, lambda *_: _pytest("tests/gpu")),
    Part("pictures", 100, _pictures),
    Part("scan", 60, _worker("scan"), None),
    *(_frame(number) for number in range(len(Plan.sizes))),
    Part("projected", 90, _worker("projected"), None),
    Part("versus", 120, _versus, "versus.json", "versus.png"),
    Part("engines", 110, _worker("engines"), None),
    Part("grid", 45, lambda plan, work: _bench("grid", plan, work, "grid", "--points", str(plan.grid)), "grid.json"),
    Part("open", 30, lambda plan, work: _bench("open", plan, work, "open", str(work / "scan"), "--device", plan.device),
         "open.json"),
)
"""In the order of what would be missed most: the last ones are cut short where time runs out."""


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/gpu"))
    parser.add_argument("--dry", action="store_true", help="on the CPU with a tiny scan: does the script itself work?")
    parser.add_argument("--only", help="names of parts, comma-separated (default: all)")
    parser.add_argument("--seconds", type=float, default=TOTAL)
    options = parser.parse_args()
    plan = DRY if options.dry else Plan()
    names = [part.name for part in PARTS]
    wanted = options.only.split(",") if options.only else names
    if unknown := set(wanted) - set(names):
        parser.error(f"--only {','.join(sorted(unknown))}: there are {', '.join(names)}")
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="pointglass-gpu-") as folder, open(options.out / "log.txt", "w") as log:
        results = _all(plan, [part for part in PARTS if part.name in wanted], Path(folder), options.out, log, options.seconds)
    for name, held in results["parts"].items():
        print(f"{name:10} {held['seconds']:6.1f} s  {held['said']}")
    return 0 if all(held["said"] == "done" for held in results["parts"].values()) else 1


def _all(plan: Plan, parts: list[Part], work: Path, out: Path, log, seconds: float) -> dict:
    begun = time.monotonic()
    results: dict = {"machine": _machine(), "plan": vars(plan) | {"dry": plan is DRY}, "parts": {}}
    for part in parts:
        left = seconds - _LAST - (time.monotonic() - begun)
        if part.name.startswith("frame-") and int(part.name[6:]) >= len(plan.sizes):
            continue
        if left < 5:
            results["parts"][part.name] = {"seconds": 0.0, "said": "left out: no time was left", "result": None}
        else:
            results["parts"][part.name] = _run(part, plan, work, out, log, min(part.seconds, left))
        text = json.dumps(results, indent=1)
        (out / "results.json.partial").write_text(text)
        (out / "results.json.partial").replace(out / "results.json")
    return results


def _run(part: Part, plan: Plan, work: Path, out: Path, log, limit: float) -> dict:
    """Runs one part; what it said and measured."""
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1", "MPLBACKEND": "Agg",
        "POINTGLASS_CACHE": str(work / "cache"),
    }
    if plan is not DRY:
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
        if part.json:
            result = json.loads((work / part.json).read_text())
        elif part.json is None:
            result = json.loads(output[output.index("{") :])
        elif output.strip():
            result = output.strip().splitlines()[-1]
    except (OSError, ValueError) as error:
        said = f"{said}, no result ({error})"
    if part.plot and (work / part.plot).is_file():
        shutil.copyfile(work / part.plot, out / part.plot)
    return {"seconds": round(seconds, 1), "said": said, "result": result}


def _machine() -> dict:
    """Without any library: the system, and what nvidia-smi says."""
    query = ["nvidia-smi", "--query-gpu=name,driver_version,memory.total", "--format=csv,noheader"]
    try:
        gpu = subprocess.run(query, capture_output=True, text=True, timeout=30).stdout.strip() or None
    except (OSError, subprocess.SubprocessError):
        gpu = None
    return {"system": platform.platform(), "python": platform.python_version(), "cores": os.cpu_count(), "gpu": gpu}


if __name__ == "__main__":
    sys.exit(main())
