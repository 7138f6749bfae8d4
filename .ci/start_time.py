"""How long pointglass takes from launch to its first picture of a cached scan, measured as whole processes.

    .venv/bin/python .ci/start_time.py [CHECKOUT ...] [--runs 5] [--views filled]

Each checkout (default: this one) renders one 960x720 picture of the demo scan, and opens a window on it (under Xvfb if there is
no DISPLAY).  Checkouts take turns, so that other load on the machine meets all of them alike.  One run of each, which fills
the grid cache and numba's, is not counted.  Printed: median seconds from launch to the picture, and median CPU seconds.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LAUNCHED = "POINTGLASS_LAUNCHED"

# Runs the window as `pointglass view` does, and leaves when the first picture of the scan has been shown.
WINDOW = f"""
import os, sys, time
import pointglass.viewer.window.shell.app as window
step = window.App.step
def until_a_picture(self, **options):
    step(self, **options)
    if self.session.picture.made is not None:
        print("first picture", time.monotonic() - float(os.environ["{LAUNCHED}"]), flush=True)
        os._exit(0)
window.App.step = until_a_picture
from pointglass.viewer.cli import main
sys.exit(main(sys.argv[1:]))
"""


def measure(command: list[str], checkout: Path, environment: dict[str, str]) -> tuple[float, float]:
    """Seconds from launch to the picture (for a command that does not say: to its end), and CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.monotonic()
    done = subprocess.run(command, cwd=checkout, env={**environment, "PYTHONPATH": str(checkout), LAUNCHED: str(start)},
                          capture_output=True, text=True, timeout=300)
    seconds = time.monotonic() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"{' '.join(command)} in {checkout}: {done.stderr}")
    told = [line for line in done.stdout.splitlines() if line.startswith("first picture")]
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return (float(told[-1].split()[-1]) if told else seconds), cpu


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkouts", nargs="*", type=Path, default=[ROOT])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--views", nargs="+", default=["filled"])
    parser.add_argument("--only", choices=["render", "window"])
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        cameras = json.loads((ROOT / "assets/demo_cameras.json").read_text())
        (work / "one.json").write_text(json.dumps({**cameras, "camera_path": cameras["camera_path"][:1]}))
        display = None
        if not os.environ.get("DISPLAY") and options.only != "render":
            read, write = os.pipe()
            display = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x900x24"], pass_fds=[write],
                                       stderr=subprocess.DEVNULL)
            os.environ["DISPLAY"] = f":{os.read(read, 16).decode().strip()}"
        try:
            compare(options, work)
        finally:
            if display is not None:
                display.terminate()
    return 0


def compare(options: argparse.Namespace, work: Path) -> None:
    """Runs every checkout in turn and prints the medians."""
    cases = {}
    for view in options.views:
        for checkout in (path.resolve() for path in options.checkouts):
            python, demo = [sys.executable], str(checkout / "assets/demo.laz")
            cases["render", view, checkout] = [*python, "-m", "pointglass.viewer", "render", demo, "--cameras",
                                               str(work / "one.json"), "--out", str(work / "out"), "--view", view]
            cases["window", view, checkout] = [*python, "-c", WINDOW, "view", demo, "--view", view]
    cases = {case: command for case, command in cases.items() if options.only in (None, case[0])}
    found: dict[tuple, list[tuple[float, float]]] = {case: [] for case in cases}
    for run in range(options.runs + 1):
        for case, command in cases.items():
            cache = work / case[2].name
            environment = {**os.environ, "POINTGLASS_CACHE": str(cache)}
            environment.pop("PYTHONDONTWRITEBYTECODE", None)  # a user's Python keeps compiled modules
            took = measure(command, case[2], environment)
            if run:
                found[case].append(took)
    for (what, view, checkout), runs in found.items():
        seconds, cpu = zip(*runs)
        print(f"{what} {view:8} {checkout.name:12} {statistics.median(seconds):5.2f} s (from {min(seconds):.2f} to "
              f"{max(seconds):.2f}), {statistics.median(cpu):5.2f} s CPU")


if __name__ == "__main__":
    sys.exit(main())
