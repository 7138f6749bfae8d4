"""Runs mutants in forked children: the parent has imported the readers, so that a child starts in milliseconds.

A child runs a batch, and reports each mutant through a pipe before and after; a crash, a hang or an excess of memory costs its
own child only.  A failure is confirmed alone in a fresh child.
"""

import faulthandler
import gc
import json
import os
import resource
import select
import shutil
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .exercise import Wrong, exercise
from .mutants import Mutant
from .seed import Seed

MOST_MEMORY = 1 << 30
"""Bytes that reading a file may take, besides ten times its size."""
ROOM = 4 << 30
"""Bytes of address space of a child beyond what the parent has: more is refused by the system."""
SECONDS, WALL_SECONDS = 20, 120
"""Of processor time, and of waiting, after which a mutant hangs."""
BATCH = 40
FAILURES = ("traceback", "signal", "hang", "memory", "noise")


@dataclass(frozen=True)
class Outcome:
    """kind: read, refused, or one of FAILURES.  said: the line, or where and what.  memory: bytes beyond those at the start."""

    kind: str
    said: str = ""
    memory: int = 0

    @property
    def failed(self) -> bool:
        return self.kind in FAILURES


class ForkServer:
    """folder: where the files lie while they are read; on a file system in memory it is faster."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._seed: Seed | None = None

    def run(self, mutants: Sequence[Mutant]) -> list[Outcome]:
        """The outcome of each mutant; all are of one format.  Failures are those that a child of their own has, too."""
        found: list[Outcome] = []
        while len(found) < len(mutants):
            found += self._batch(mutants[len(found) : len(found) + BATCH])
        for i, outcome in enumerate(found):
            if outcome.failed:
                again = self._batch([mutants[i]])[0]
                found[i] = again if again.failed else Outcome(outcome.kind, f"(not alone) {outcome.said}", outcome.memory)
        return found

    def warm(self, seed: Seed, number: int) -> str:
        """Reads a seed as it is in this process; returns what exercise returns."""
        shutil.rmtree(self.folder, ignore_errors=True)
        _write(self.folder, dict(seed.files))
        return exercise(seed.kind, self.folder / seed.entry, number)

    def check(self, seed: Seed, changed: dict[str, bytes | None], number: int) -> Outcome:
        """The outcome of these contents in a child of its own."""
        return self._batch([Given(number, seed, changed)])[0]

    def _batch(self, mutants: Sequence) -> list[Outcome]:
        """Outcomes up to the first one that ended the child."""
        shutil.rmtree(self.folder, ignore_errors=True)
        receiving, sending = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(receiving)
            _child(self.folder, mutants, sending)
        os.close(sending)
        found, begun, data = [], False, b""
        end = time.monotonic() + WALL_SECONDS
        hung = False
        while True:
            if not select.select([receiving], [], [], max(0.0, end - time.monotonic()))[0]:
                hung = True
                break
            more = os.read(receiving, 65536)
            if not more:
                break
            end = time.monotonic() + WALL_SECONDS
            data += more
            *lines, data = data.split(b"\n")
            for line in lines:
                begun = line == b"begun"
                if not begun:
                    found.append(Outcome(**json.loads(line)))
        os.close(receiving)
        if hung:
            os.killpg(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if hung or (os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU):
            return [*found, Outcome("hang", f"{WALL_SECONDS if hung else SECONDS} s")]
        if os.WIFSIGNALED(status):
            return [*found, Outcome("signal", f"{signal.Signals(os.WTERMSIG(status)).name}: {_output(self.folder)}")]
        if status or begun:
            return [*found, Outcome("signal", f"exit status {status}: {_output(self.folder)}")]
        return found


@dataclass(frozen=True)
class Given:
    """A seed with these contents in place of its own, read as the mutant of this number is."""

    number: int
    seed: Seed
    contents: dict[str, bytes | None]

    def changed(self) -> dict[str, bytes | None]:
        return self.contents


def _child(folder: Path, mutants: Sequence, sending: int):
    """Never returns."""
    try:
        gc.disable()
        faulthandler.disable()  # of pytest, which reports a crash itself
        os.setsid()
        output = os.open(_output_file(folder), os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
        for stream in (1, 2):
            os.dup2(output, stream)
        sys.stdout, sys.stderr = (open(stream, "w", closefd=False) for stream in (1, 2))  # noqa: SIM115  (until the end)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        limit = _status()["VmSize"] + ROOM
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        written: Seed | None = None
        for mutant in mutants:
            changed = mutant.changed()
            if written is not mutant.seed:
                shutil.rmtree(folder, ignore_errors=True)
                _write(folder, dict(mutant.seed.files))
                written = mutant.seed
            _write(folder, changed)
            os.write(sending, b"begun\n")
            size = sum(len(data or b"") for data in {**mutant.seed.files, **changed}.values())
            outcome = _run(mutant, folder / mutant.seed.entry, output, size)
            os.write(sending, json.dumps(vars(outcome)).encode() + b"\n")
            _write(folder, {name: mutant.seed.files[name] for name in changed})
            if outcome.failed:
                break  # the process may be changed
            gc.collect(0)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(77)
    os._exit(0)


def _write(folder: Path, files: dict[str, bytes | None]) -> None:
    for name, data in files.items():
        path = folder / name
        if data is None:
            path.unlink(missing_ok=True)
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "wb") as file:
            file.write(data)


def _run(mutant, path: Path, output: int, size: int) -> Outcome:
    used = resource.getrusage(resource.RUSAGE_SELF)
    resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime) + SECONDS, resource.RLIM_INFINITY))
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")  # the peak is measured from here
    before = _status()["VmRSS"]
    os.ftruncate(output, 0)
    os.lseek(output, 0, os.SEEK_SET)
    kind, said = "read", ""
    try:
        said = exercise(mutant.seed.kind, path, mutant.number)
        kind = "read" if said == "read" else "refused"
    except MemoryError as error:
        kind, said = "memory", _where(error)
    except Wrong as error:
        kind, said = "noise" if "standard error" in str(error) else "traceback", f"Wrong: {error}"
    except BaseException as error:
        kind, said = "traceback", _where(error)
    sys.stdout.flush()
    sys.stderr.flush()
    memory = max(0, _status()["VmHWM"] - before)
    if kind in ("read", "refused"):
        if memory > MOST_MEMORY + 10 * size:
            kind, said = "memory", f"{memory / 1e6:.0f} MB of a file of {size:,} bytes: {said}"
        elif os.fstat(output).st_size:
            os.lseek(output, 0, os.SEEK_SET)
            kind, said = "noise", os.read(output, 400).decode(errors="replace")
    return Outcome(kind, said[:1000], memory)


def _where(error: BaseException) -> str:
    """The class, the last place in the program's own code, and the text."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "/viewer/" in frame.filename or "/model/" in frame.filename]
    last = (own or frames)[-1]
    inside = "" if not own or own[-1] is frames[-1] else f" in {Path(frames[-1].filename).name}:{frames[-1].name}"
    return f"{type(error).__name__} at {Path(last.filename).name}:{last.name}:{last.lineno}{inside}: {str(error)[:200]}"


def _output_file(folder: Path) -> Path:
    return folder.with_name(folder.name + ".out")


def _output(folder: Path) -> str:
    try:
        return " ".join(_output_file(folder).read_text(errors="replace").split())[-400:]
    except OSError:
        return ""


def _status() -> dict[str, int]:
    """Bytes by the names of /proc/self/status."""
    found = {}
    with open("/proc/self/status") as file:
        for line in file:
            if line.startswith("Vm"):
                name, value, *_ = line.split()
                found[name[:-1]] = int(value) * 1024
    return found
