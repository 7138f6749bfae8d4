"""Full disks, little memory, closed pipes, folders that cannot be written, and two processes on one scan."""

import contextlib
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .product import ROOT, SECONDS, Ended, Product, environment, left_in, refused, run

MEMORIES = (400 << 20, 700 << 20, 1 << 30)
"""Bytes of address space."""
DISK = ("convert", "export-laz", "export-e57", "export-ply", "simulate", "render", "video")


@contextmanager
def small_disk(size: int) -> Iterator[Path]:
    """A file system of so many bytes.  Raises PermissionError where mounting is not allowed."""
    folder = Path(tempfile.mkdtemp(prefix="faults-disk-"))
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], capture_output=True, text=True)
    if done.returncode:
        folder.rmdir()
        raise PermissionError(done.stderr.strip())
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)
        folder.rmdir()


def can_mount() -> bool:
    try:
        with small_disk(1 << 20):
            return True
    except (OSError, PermissionError):
        return False


def full_disk(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """Less room than the result needs: one line, exit code 2, nothing left."""
    while True:
        size = rng.choice((16, 64, 100, 150)) << 10
        with small_disk(size) as disk:
            ended = run(product.commands(disk)[name], work)
            wrong = refused(ended) if ended.code else ""
            if not ended.code and name not in ("render", "video"):  # whose few small pictures may fit
                wrong = f"exit code 0 on {size} bytes: {ended.out[-200:]!r}"
            left = left_in(disk)
            there = [path.name for path in disk.iterdir()] if ended.code and name != "render" else []
        yield wrong or (f"left {left}" if left else f"there is {there}" if there else "")


def full_log(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """A log on a full disk: the command does its work, or refuses in one line."""
    while True:
        with small_disk(1 << 20) as disk:
            log = disk / "log.txt"
            with contextlib.suppress(OSError), open(disk / "filler", "wb", buffering=0) as file:
                while True:
                    file.write(bytes(4096))
            ended = run(["info", "--no-cache", "--log-file", str(log), str(product.scan)], work)
        yield ("" if ended.code == 0 and "Traceback" not in ended.err else refused(ended))


def little_memory(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """One line that speaks of memory, or success; a good scan is never called damaged."""
    while True:
        memory = rng.choice(MEMORIES) + rng.randrange(40 << 20)
        out = work / "out"
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        commands = product.commands(out) | {"info": ["info", "--no-cache", str(product.scan)]}
        ended = run(commands[name], work, memory=memory)
        yield f"{memory >> 20} MiB: {wrong}" if (wrong := _of_memory(ended, out)) else ""


def _of_memory(ended: Ended, out: Path) -> str:
    if ended.code == 0:
        return f"left {left}" if (left := left_in(out)) else ""
    wrong = refused(ended, (2,))
    if not wrong and ("damaged" in ended.err or "truncated" in ended.err):
        wrong = f"a good scan is called damaged: {ended.err[-300:]!r}"
    return wrong or (f"left {left}" if (left := left_in(out)) else "")


def closed_pipe(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """Whoever read the output has gone."""
    lines = {
        "info": ["info", "--no-cache", "--json", str(product.scan)], "help": ["render", "--help"], "doctor": ["doctor"],
        "export": ["export", str(product.scan), "--out", "/dev/stdout"],
    }  # fmt: skip
    while True:
        process = subprocess.Popen(
            [sys.executable, "-m", "pointglass.viewer", *lines[name]],
            cwd=ROOT,
            env=environment(work),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        assert process.stdout is not None
        if rng.random() < 0.5:
            process.stdout.read(rng.choice((1, 10)))
        process.stdout.close()
        try:
            process.wait(SECONDS)
            assert process.stderr is not None
            err = process.stderr.read()
        except subprocess.TimeoutExpired:
            process.kill()
            err = "hangs"
        bad = "Traceback" in err or "Exception ignored" in err or process.returncode not in (0, 2, 3, -13, 141)
        yield f"exit code {process.returncode}: {err[-300:]!r}" if bad or err == "hangs" else ""


def two_processes(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """Two processes build the grid of one scan at the same time, in the cache or into one folder."""
    while True:
        shutil.rmtree(work / "cache", ignore_errors=True)
        out = work / "both"
        shutil.rmtree(out, ignore_errors=True)
        line = ["info", str(product.scan)] if name == "cache" else ["convert", str(product.scan), "--out", str(out)]
        both = [subprocess.Popen([sys.executable, "-m", "pointglass.viewer", *line], cwd=ROOT, env=environment(work),
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(2)]  # fmt: skip
        said = [process.communicate(timeout=SECONDS) for process in both]
        codes = [process.returncode for process in both]
        after = run(["info", str(product.scan if name == "cache" else out)], work)
        left = left_in(work / "cache") if (work / "cache").exists() else []
        good = codes == [0, 0] or (
            name != "cache" and 0 in codes and 2 in codes and all("Traceback" not in err for _, err in said)
        )
        yield (
            ""
            if good and after.code == 0 and not left
            else f"{codes} {after.code} {left} {said[0][1][-200:]!r} {said[1][1][-200:]!r}"
        )


def read_only(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """A folder on a file system without writing: one line, exit code 2."""
    while True:
        with small_disk(8 << 20) as disk:
            out = disk / "out"
            out.mkdir()
            subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True, capture_output=True)
            ended = run(product.commands(out)[name], work)
        yield refused(ended)
