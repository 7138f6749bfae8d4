"""Tries to lose work, by X events in real windows: ``python tests/window/lose_work.py MINUTES SEED FOLDER``.

Each attempt opens a scan, measures, does a few random things on the way, writing notes among them, and ends the window in a
random way; then what was measured and written must be in the project, or be offered by the next start and be in the project
after that.  A line for each attempt goes to FOLDER/log.md; the files of those that are not OK are kept.  LOST: work or a
foreign file is gone, or the title is wrong.  ODD: the attempt did not come to its end.  What happens on the way and at the end
is in lose_work_actions.py.
"""

import os
import random
import shutil
import signal
import sys
import time
import traceback
from pathlib import Path

import numpy as np
from lose_work_actions import ENDS, MIDDLES
from lose_work_attempt import Attempt, LostError
from real_window import x_display

KEPT_BESIDE = 6
"""Working folders that are used in turn."""


def make_room(path: Path) -> None:
    """A room of 8 x 6 x 3 m as text."""
    rng = np.random.default_rng(1)
    size = np.array([8.0, 6.0, 3.0])
    xyz = rng.random((60_000, 3)) * size
    wall = rng.integers(0, 6, len(xyz))
    xyz[np.arange(len(xyz)), wall % 3] = np.where(wall < 3, 0.0, size[wall % 3])
    path.parent.mkdir(parents=True)
    np.savetxt(path, np.hstack([xyz, rng.integers(60, 250, (len(xyz), 3))]), fmt="%.4f")


def run(display: str, number: int, folder: Path, chance: random.Random) -> str:
    """One attempt.  Returns its line of the log."""
    made, verdict, why = Attempt(display, folder / f"w{number % KEPT_BESIDE}", folder / "master", chance), "OK", ""
    try:
        made.open()
        for _ in range(chance.randint(1, 3)):
            made.measure()
        for act in [chance.choice(MIDDLES) for _ in range(chance.randint(1, 3))] + [chance.choice(ENDS)]:
            made.done.append(f"[{act.__name__}]")
            act(made)
    except LostError as error:
        verdict, why = "LOST", str(error)
    except Exception as error:  # whatever it is, the next attempt follows
        verdict, why = "ODD", f"{error!r:.300} {' | '.join(traceback.format_exc().splitlines()[-4:-1])}"
    finally:
        if verdict != "OK":
            made.window.picture(f"../end{number}")
        if made.alive:
            made.window.process.kill()
            made.window.process.wait()
    log = made.folder / "window.log"
    if log.exists() and "Traceback" in (text := log.read_text(errors="replace")):
        verdict, why = "LOST", f"{why} {' | '.join(text.splitlines()[-5:])}"
    if verdict != "OK":
        shutil.copytree(made.folder, folder / f"kept{number}", dirs_exist_ok=True, ignore=shutil.ignore_patterns("cache"))
    return f"{time.strftime('%H:%M:%S')} {number} {' > '.join(made.done)} :: {verdict} {why}"


def main(minutes: float, seed: int, folder: Path) -> None:
    for number in (signal.SIGINT, signal.SIGHUP):  # a shell's background jobs have them ignored, and hand that on
        signal.signal(number, signal.SIG_DFL)
    if not (folder / "master").exists():
        make_room(folder / "master" / "scans" / "room.xyz")
    end, number, chance = time.monotonic() + 60 * minutes, 0, random.Random(seed)
    with x_display() as display, (folder / "log.md").open("a") as log:
        while time.monotonic() < end:
            number += 1
            print(run(display, number, folder, chance), file=log, flush=True)


if __name__ == "__main__":
    os.chdir(Path(__file__).resolve().parent)
    main(float(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]).resolve())
