"""SIGINT and SIGTERM at random times: exit code 130, one line, nothing unfinished.  After ``kill -9`` the next start removes
what was left."""

import random
import shutil
import signal
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from .product import FRAMES, POINTS, STOPPED, Ended, Product, left_in, run

COMMANDS = ("export-laz", "export-e57", "convert", "video", "train")
KILLED = ("export-laz", "export-e57", "convert", "video")
_LATEST = 1.1
"""Times the length of an undisturbed run within which it is stopped: some runs end before."""
_lengths: dict[str, float] = {}


def interrupts(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """One run after the other of a command that is stopped."""
    while True:
        out = _empty(work / "out")
        wait, number = rng.uniform(0, _LATEST * _length(product, work, name)), rng.choice((signal.SIGINT, signal.SIGTERM))
        ended = run(product.commands(out)[name], work, disturb=partial(_stop, wait=wait, number=number))
        wrong = _judged(ended, out, name)
        yield f"{number.name} after {wait:.2f} s: {wrong}" if wrong else ""


def kills(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """One run after the other of a command that is killed; then another command starts."""
    while True:
        out = _empty(work / "out")
        wait = rng.uniform(0, _length(product, work, name))
        run(product.commands(out)[name], work, disturb=partial(_stop, wait=wait, number=signal.SIGKILL))
        after = run(["info", "--no-cache", str(product.scan)], work)
        left = left_in(out) + left_in(work / "cache")
        if after.code:
            yield f"killed after {wait:.2f} s: the next command ends with {after.code}: {after.err[-200:]!r}"
        else:
            yield f"killed after {wait:.2f} s: {left} is left after the next start" if left else ""


def _length(product: Product, work: Path, name: str) -> float:
    """Seconds of an undisturbed run."""
    if name not in _lengths:
        out = _empty(work / "out")
        ended = run(product.commands(out)[name], work, disturb=lambda process: None)
        if ended.code:
            raise RuntimeError(f"{name} does not run: {ended.err}")
        _lengths[name] = ended.seconds
    return _lengths[name]


def _stop(process: subprocess.Popen, wait: float, number: signal.Signals) -> None:
    try:
        process.wait(wait)
    except subprocess.TimeoutExpired:
        process.send_signal(number)


def _judged(ended: Ended, out: Path, name: str) -> str:
    if ended.code not in (0, 130):
        return f"exit code {ended.code}: {ended.err[-300:]!r}"
    if "Traceback" in ended.err or (ended.code == 130 and ended.last_lines != [STOPPED]):
        return f"standard error: {ended.err[-300:]!r}"
    if left := left_in(out):
        return f"{left} is left"
    for path in out.iterdir():  # stopped after the rename, or a training's checkpoint, from which it resumes
        if wrong := not_whole(path):
            return f"exit code {ended.code}, {path.name}: {wrong}"
    return ""


def not_whole(path: Path) -> str:
    """What is wrong with a result, read by another library where there is one."""
    try:
        match path.suffix:
            case ".laz":
                import laspy

                return (
                    "" if len(laspy.read(path, laz_backend=laspy.LazBackend.Lazrs).points) == POINTS else "points are missing"
                )
            case ".e57":
                import pye57

                file = pye57.E57(str(path))
                count = len(file.read_scan(0, ignore_missing_fields=True)["cartesianX"])
                file.close()
                return "" if count == POINTS else "points are missing"
            case ".mp4":
                import av

                with av.open(str(path)) as video:
                    return "" if sum(1 for _ in video.decode(video=0)) == FRAMES else "frames are missing"
            case "" if path.name == "grid":
                from pointglass.viewer.grid.open_scene import open_scene

                return "" if open_scene(path).count == POINTS else "points are missing"
            case "" if path.name == "train":
                return ""
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "is not expected"


def _empty(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
