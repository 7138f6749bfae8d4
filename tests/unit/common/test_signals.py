"""A signal ends a command with exit code 130, one line, and nothing unfinished left behind."""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pointglass.model.common.process.signals import cleaned, undone, uninterrupted
from pointglass.model.common.system import STOPS

ROOT = Path(__file__).resolve().parents[3]
LINE = "pointglass: stopped\n"


def _started(*line: str) -> subprocess.Popen:
    """With the usual handlers, also where the tests run in the background."""
    return subprocess.Popen([sys.executable, *line], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))


def _stopped(code: str, tmp_path: Path, number: int) -> subprocess.CompletedProcess:
    """Runs code that prints a line when it is to be stopped."""
    process = _started("-c", code, str(tmp_path))
    assert process.stdout is not None
    first = process.stdout.readline()
    process.send_signal(number)
    out, error = process.communicate(timeout=60)
    return subprocess.CompletedProcess(code, process.returncode, first + out, error)


NATIVE = """
import sys, time
from pathlib import Path
from pointglass.model.common.process.signals import stop_at_once
stop_at_once()
from pointglass.model.common.files.atomic_write import write_atomic
from pointglass.model.common.files.folders import made_folder
from pointglass.model.common.files.temporary import temporary_folder
def write(path):
    path.write_text("half")
    print("writing", flush=True)
    try:
        time.sleep(60)
    except BaseException:
        import os
        os.abort()  # a native library through which an exception passes
with made_folder(Path(sys.argv[1]) / "a" / "b") as folder, temporary_folder(folder / "grid") as work:
    (work / "points.npy").write_text("half")
    write_atomic(folder / "out.laz", write)
"""


@pytest.mark.parametrize("number", STOPS)
def test_a_signal_unwinds_nothing_and_leaves_nothing(tmp_path, number):
    done = _stopped(NATIVE, tmp_path, number)
    assert (done.returncode, done.stderr) == (130, LINE) and not list(tmp_path.iterdir())


CHILDREN = """
import multiprocessing, subprocess, sys, time
from pathlib import Path
from pointglass.model.common.process.signals import stop_at_once
from pointglass.model.common.files.temporary import temporary_folder
stop_at_once()
def work(folder):
    with temporary_folder(Path(folder) / "pairs"):
        time.sleep(60)
children = [multiprocessing.get_context("fork").Process(target=work, args=(sys.argv[1],), daemon=True) for _ in range(2)]
for child in children:
    child.start()
other = subprocess.Popen(["sleep", "60"])
while len(list(Path(sys.argv[1]).iterdir())) < 2:
    time.sleep(0.01)
print(*(child.pid for child in children), other.pid, flush=True)
time.sleep(60)
"""


def test_child_processes_end_and_what_they_leave_is_removed(tmp_path):
    done = _stopped(CHILDREN, tmp_path, signal.SIGTERM)
    assert (done.returncode, done.stderr) == (130, LINE) and not list(tmp_path.iterdir())
    assert not [pid for pid in done.stdout.split() if Path(f"/proc/{pid}").exists()]


DELAYED = """
import sys, time
from pathlib import Path
from pointglass.model.common.process.signals import stop_at_once, uninterrupted
stop_at_once()
with uninterrupted():
    print("begun", flush=True)
    end = time.monotonic() + 0.5
    while time.monotonic() < end:
        pass
    (Path(sys.argv[1]) / "whole").touch()
time.sleep(60)
"""


def test_uninterrupted_work_is_whole(tmp_path):
    done = _stopped(DELAYED, tmp_path, signal.SIGINT)
    assert (done.returncode, done.stderr) == (130, LINE) and (tmp_path / "whole").exists()


def test_in_a_program_of_its_own_ctrl_c_stays_an_exception():
    told, before = [], signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), cleaned(lambda: told.append("cleaned")), undone(lambda: told.append("undone")):
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            told.append("whole")
        told.append("never")
    with cleaned(lambda: told.append("cleaned")), undone(lambda: told.append("never")):
        pass
    assert told == ["whole", "undone", "cleaned", "cleaned"] and signal.getsignal(signal.SIGINT) == before


def _wait_for_handler(pid: int) -> None:
    """Until the process handles SIGTERM: before, Python's own start may still be interrupted."""
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        caught = [line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith("SigCgt:")]
        if caught and int(caught[0].split()[1], 16) >> signal.SIGTERM - 1 & 1:
            return
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["laz", "e57"])
def test_an_export_or_conversion_stopped_at_any_time(thin_demo, tmp_path, ending, seed):
    """Imports, reading, native writers and the end of the process."""
    rng = random.Random(seed)
    for command, out in (("export", f"out.{ending}"), ("convert", "grid")):
        folder = tmp_path / command
        folder.mkdir()
        process = _started("-m", "pointglass.viewer", command, str(thin_demo), "--out", str(folder / out))
        _wait_for_handler(process.pid)
        time.sleep(rng.uniform(0.0, 1.5))
        process.send_signal(rng.choice(STOPS))
        _, error = process.communicate(timeout=60)
        assert (process.returncode, error) in ((130, LINE), (0, ""))
        left = [path.name for path in folder.iterdir()]
        assert left in ([[out]] if process.returncode == 0 else [[], [out]])
        if left:  # it had its name before the signal came: it is whole
            check = _started("-m", "pointglass.viewer", "info", "--no-cache", str(folder / out))
            assert (check.communicate(timeout=120)[1], check.returncode) == ("", 0)
