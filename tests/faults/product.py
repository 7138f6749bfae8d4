"""The commands that are disturbed, small enough to run hundreds of times, and how a disturbed run is judged."""

import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "unit"))  # the makers of files
STOPPED = "pointglass: stopped"
POINTS, FRAMES = 60_000, 24
"""Of the scan, and of the video."""
TRAINING = ("--quality", "fast", "--steps", "30", "--batch", "2", "--crop", "32")
SECONDS = 300
"""After which a command hangs; far more than it takes on a busy machine."""
_TEMPORARY = re.compile(r"\.partial|\.tmp$|^\.")
_CHATTER = re.compile(r"pointglass: (warning: |compiling |[a-z' ]+: [\d,.]+ of )|^[a-z' ]+: +\d|\r")
"""Lines on standard error that are no message of a failure: warnings and progress."""


@dataclass(frozen=True)
class Product:
    """scan, grid: a small scan, and its grid made by convert.  path: a camera path.  room: training data."""

    folder: Path

    @property
    def scan(self) -> Path:
        return self.folder / "scan.laz"

    @property
    def path(self) -> Path:
        return self.folder / "path.json"

    @property
    def room(self) -> Path:
        return self.folder / "room"

    def commands(self, out: Path) -> dict[str, list[str]]:
        """Name -> arguments; everything is written below ``out``."""
        scan = str(self.scan)
        size = ["--size", "64x48", "--view", "raw"]
        return {
            "export-laz": ["export", scan, "--out", str(out / "a.laz")],
            "export-e57": ["export", scan, "--out", str(out / "a.e57")],
            "export-ply": ["export", scan, "--out", str(out / "a.ply")],
            "convert": ["convert", scan, "--out", str(out / "grid")],
            "video": ["video", scan, "--path", str(self.path), "--out", str(out / "a.mp4"), *size],
            "render": ["render", scan, "--cameras", str(self.path), "--out", str(out / "pictures"), *size],
            "simulate": ["simulate", "--out", str(out / "a.laz"), "--points", "100000"],
            "train": ["train", str(self.room), "--out", str(out / "train"), "--device", "cpu", *TRAINING],
        }  # fmt: skip


def make_product(folder: Path, points: int = POINTS) -> Product:
    """Writes what the commands read."""
    from cloud_files import surface, write_las
    from rooms import make_room

    from pointglass.viewer.picture.camera import from_fov, look_at
    from pointglass.viewer.work.cameras.camera_files import write_camera_path

    folder.mkdir(parents=True, exist_ok=True)
    made = Product(folder)
    xyz, rgb = surface(points)
    write_las(made.scan, xyz, rgb.astype(np.uint16) * 257, np.arange(points) % 65536)
    views = [look_at(np.array([2 + 0.1 * i, -3, 2]), np.array([2, 2, 0])) for i in range(FRAMES)]
    write_camera_path(made.path, [from_fov(64, 48, 60, view, f"v{i}") for i, view in enumerate(views)])
    make_room(made.room, face=96, view=(72, 96))
    return made


def environment(state: Path, **more: str) -> dict[str, str]:
    """A cache and a state folder of its own."""
    return os.environ | {"POINTGLASS_CACHE": str(state / "cache"), "POINTGLASS_STATE": str(state / "state"),
                         "LP_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1", **more}  # fmt: skip


@dataclass(frozen=True)
class Ended:
    """code: as of subprocess.  seconds: from the moment it could be disturbed."""

    code: int
    out: str
    err: str
    seconds: float

    @property
    def last_lines(self) -> list[str]:
        """Of standard error, without warnings and progress."""
        return [line for line in self.err.splitlines() if line.strip() and not _CHATTER.search(line)]


def run(
    arguments: Sequence[str],
    state: Path,
    *,
    disturb: Callable[[subprocess.Popen], object] | None = None,
    memory: int = 0,
    cwd: Path = ROOT,
    wrap: Sequence[str] = (),
    **more: str,
) -> Ended:
    """Runs a command.  disturb: called once it handles signals.  memory: bytes of address space.  wrap: a command around it."""

    def prepare() -> None:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))

    line = [*wrap, sys.executable, "-m", "pointglass.viewer", *arguments]
    process = subprocess.Popen(
        line,
        cwd=cwd,
        env=environment(state, **more),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=prepare,
        text=True,
        errors="replace",
    )
    begun = time.monotonic()
    if disturb is not None:
        _wait_for_handler(process)
        begun = time.monotonic()
        disturb(process)
    try:
        out, err = process.communicate(timeout=SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        return Ended(-999, out, err, SECONDS)
    return Ended(process.returncode, out, err, time.monotonic() - begun)


def _wait_for_handler(process: subprocess.Popen) -> None:
    """Until the process handles SIGTERM: before, Python itself is starting."""
    while process.poll() is None:
        caught = [line for line in Path(f"/proc/{process.pid}/status").read_text().splitlines() if line.startswith("SigCgt:")]
        if caught and int(caught[0].split()[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.005)


def left_in(folder: Path) -> list[str]:
    """Temporary and hidden files below a folder."""
    return [str(path.relative_to(folder)) for path in folder.rglob("*") if _TEMPORARY.search(path.name)]


def refused(ended: Ended, codes: Sequence[int] = (2,)) -> str:
    """What is wrong with a command that had to refuse in one line."""
    if ended.code == -999:
        return "hangs"
    if ended.code not in codes:
        return f"exit code {ended.code}: {ended.err[-300:]!r}"
    if len(ended.last_lines) != 1 or "Traceback" in ended.err:
        return f"{len(ended.last_lines)} lines: {ended.err[-400:]!r}"
    return ""
