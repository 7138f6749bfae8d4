"""The processes that decode LAZ, from without: none goes on after the command, Ctrl-C and forks do not disturb them, and they
keep no file open."""

import errno
import os
import pty
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from test_laz_chunks import write_laz
from test_laz_points import made

from pointglass.viewer import cli
from pointglass.viewer.common.paths import assets_dir
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.las import laz_points
from pointglass.viewer.readers.las.laz_points import ALL, FIELDS, LazError

LIMIT_S = 60.0
linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are looked up in /proc")


def decoders(parent: int) -> list[int]:
    """Numbers of the processes that decode LAZ for a process."""
    found = []
    for task in Path(f"/proc/{parent}/task").glob("*/children"):
        for child in task.read_text().split():
            if b"laz_worker" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(int(child))
    return found


def wait_for(condition, what: str):
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        if found := condition():
            return found
        time.sleep(0.01)
    raise AssertionError(f"not within {LIMIT_S:.0f} s: {what}")


def is_gone(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def converting(tmp_path: Path, **given) -> subprocess.Popen:
    command = [sys.executable, "-m", "pointglass.viewer", "convert", str(assets_dir() / "demo.laz"), "--out",
               str(tmp_path / "grid")]  # fmt: skip
    return subprocess.Popen(command, **given)


@linux
@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGTERM])
def test_nothing_goes_on_after_a_command_that_is_ended(tmp_path, stop):
    with converting(tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as command:
        assert command.stderr is not None
        (decoder, *_) = wait_for(lambda: decoders(command.pid), "a process that decodes")
        command.send_signal(stop)
        said = command.stderr.read()
        command.wait()
    wait_for(lambda: is_gone(decoder), "its end")
    assert (command.returncode, said) == ((130, "pointglass: stopped\n") if stop == signal.SIGTERM else (-signal.SIGKILL, ""))


@linux
def test_ctrl_c_in_a_terminal_ends_a_command_in_one_line(tmp_path):
    terminal, screen = pty.openpty()

    def own_terminal() -> None:
        import fcntl
        import termios

        os.setsid()
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    with converting(tmp_path, stdin=screen, stdout=screen, stderr=screen, preexec_fn=own_terminal) as command:
        os.close(screen)
        (decoder, *_) = wait_for(lambda: decoders(command.pid), "a process that decodes")
        os.write(terminal, b"\x03")
        said = b""
        while True:
            try:
                data = os.read(terminal, 1 << 16)
            except OSError:  # EIO: no process has the terminal open
                break
            said += data
            if not data:
                break
        assert command.wait() == 130
    os.close(terminal)
    wait_for(lambda: is_gone(decoder), "its end")
    assert said.endswith(b"pointglass: stopped\r\n") and b"Traceback" not in said
    assert not (tmp_path / "grid").exists()


@linux
def test_a_process_that_decodes_is_apart_from_the_terminal(tmp_path):
    points, raw = made(tmp_path, 1, point_format=3, extra=0, chunks=[50], kind="smooth")
    assert points.read(0, 50) == raw
    assert os.getpgid(laz_points._idle[-1].pid) != os.getpgid(0)


def test_threads_read_one_scan_at_the_same_time(tmp_path, seed):
    points, raw = made(tmp_path, seed, point_format=7, extra=0, chunks=[3000, 500, 2000], kind="random")
    count, length = 5500, points.length
    wrong: list[object] = []

    def read(number: int) -> None:
        rng = np.random.default_rng(seed + number)
        try:
            for _ in range(8):
                start, stop = np.sort(rng.integers(0, count + 1, 2)).tolist()
                if points.read(start, stop) != raw[start * length : stop * length]:
                    wrong.append((start, stop))
                if b"".join(points.blocks(int(rng.integers(100, 2000)))) != raw:
                    wrong.append("blocks")
        except Exception as error:
            wrong.append(error)

    threads = [threading.Thread(target=read, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


@linux
def test_a_fork_takes_no_answer_and_no_process_from_its_parent(tmp_path, seed):
    points, raw = made(tmp_path, seed, point_format=7, extra=0, chunks=[400, 400, 400], kind="random")
    blocks = points.blocks(400)
    found = [next(blocks)]
    child = os.fork()
    if child == 0:
        code = 1
        try:
            try:
                next(blocks)
            except LazError as error:
                code = 0 if "forked" in str(error) else 2
            blocks.close()
            code = code or (0 if points.read(0, 1200) == raw else 3)
            laz_points._end_all()
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert b"".join([*found, *blocks]) == raw


@linux
def test_a_fork_does_not_keep_a_process_alive(tmp_path):
    points, _ = made(tmp_path, 1, point_format=3, extra=0, chunks=[50, 50], kind="smooth")
    blocks = points.blocks(50)
    next(blocks)
    (process,) = set(laz_points._all) - set(laz_points._idle)
    child = os.fork()
    if child == 0:
        time.sleep(LIMIT_S)
        os._exit(0)
    try:
        laz_points._close(process)
        assert process.wait(LIMIT_S / 2) is not None
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    blocks.close()


@linux
def test_no_file_stays_open_and_one_that_changes_is_not_mixed(tmp_path, seed):
    count = 60_000
    points, raw = made(tmp_path, seed, point_format=3, extra=0, chunks=[count], kind="random")
    laz_points._end_all()
    assert points.read(0, 10) == raw[: 10 * points.length]
    (process,) = laz_points._idle
    opened = [os.readlink(path) for path in Path(f"/proc/{process.pid}/fd").iterdir() if path.exists()]
    assert str(points.path) not in opened
    shutil.copy(points.path, tmp_path / "other")
    os.replace(tmp_path / "other", points.path)
    with pytest.raises(LazError, match="has changed"):
        points.read(10, count)
    assert points.read(10, count) == raw[10 * points.length :]


def test_a_process_that_cannot_be_started_is_one_line_and_no_damage(monkeypatch, tmp_path, capsys):
    path = write_laz(tmp_path / "a.laz")
    laz_points._end_all()

    def refused(*_, **__):
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr(laz_points.subprocess, "Popen", refused)
    assert cli.main(["convert", str(path), "--out", str(tmp_path / "grid")]) == 2
    said = capsys.readouterr().err
    assert "a.laz: no process can be started" in said and "Resource temporarily unavailable" in said and "damaged" not in said


@pytest.mark.skipif(sys.platform == "win32", reason="no such names")
def test_any_file_name_is_read(tmp_path):
    name = os.fsencode(tmp_path) + b"/a\xff\n \xc3\xa9.laz"
    path = Path(os.fsdecode(name))
    write_laz(tmp_path / "a.laz").rename(path)
    path.chmod(0o444)
    done = subprocess.run([sys.executable, "-m", "pointglass.viewer", "convert", name, "--out", str(tmp_path / "grid")],
                          capture_output=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert sum(len(chunk.xyz) for chunk in open_source(path).chunks()) == 2000


@pytest.mark.parametrize("point_format", [6, 7, 8, 9, 10])
def test_a_field_is_the_same_decoded_alone(tmp_path, seed, point_format):
    """The records as lazrs compressed them are the reference."""
    import laspy

    points, raw = made(tmp_path, seed, point_format=point_format, extra=3, chunks=[700, 1, 300], kind="random")
    layout = laspy.LasHeader(point_format=point_format, version="1.4").point_format.dtype()
    layout = np.dtype([*layout.descr, ("extra", "V3")])
    expected = np.frombuffer(raw, layout)
    columns = {"xyz": ("X", "Y", "Z"), "rgb": ("red", "green", "blue"), "return_number": ("bit_fields",),
               "number_of_returns": ("bit_fields",)}  # fmt: skip
    for name, bits in FIELDS.items():
        found = np.frombuffer(b"".join(points.blocks(450, bits)), layout)
        for column in columns.get(name, (name,)):
            if column in layout.names:
                assert found[column].tobytes() == expected[column].tobytes(), (name, column)
    assert b"".join(points.blocks(450, 0)) != b"".join(points.blocks(450, ALL)) == raw


@pytest.mark.parametrize("point_format", [3, 7, 8])
def test_one_column_of_a_file_is_that_of_its_records(tmp_path, point_format):
    source = open_source(write_laz(tmp_path / "a.laz", point_format=point_format, chunk=300))
    (whole,) = source.record_chunks()
    for name in ("xyz", "rgb", *whole.columns):
        found = list(source.column_chunks(name))
        assert np.array_equal(np.concatenate([piece.xyz for piece in found]), whole.xyz)
        if name in ("xyz", "rgb"):
            values = [getattr(piece, name) for piece in found]
        else:
            values = [piece.columns[name] for piece in found]
            assert all(set(piece.columns) == {name} and piece.rgb is None for piece in found)
        expected = getattr(whole, name) if name in ("xyz", "rgb") else whole.columns[name]
        assert np.array_equal(np.concatenate(values), expected), name
