"""Little memory, a full disk, closed pipes: one line and exit code 2, nothing left behind."""

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from untyped import any_typed

from pointglass.viewer import cli
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.failures import lacks_memory, report
from pointglass.viewer.common.paths import assets_dir

ROOT = Path(__file__).resolve().parents[3]
DEMO = str(assets_dir() / "demo.laz")


def _run(*arguments: object, limit: int | None = None, **given) -> subprocess.CompletedProcess:
    def limited() -> None:
        import resource

        if limit is not None:
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    return subprocess.run([sys.executable, "-m", "pointglass.viewer", *map(str, arguments)], cwd=ROOT, text=True, timeout=120,
                          preexec_fn=limited, **any_typed({"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | given))


def _line(done: subprocess.CompletedProcess) -> str:
    """The one line of an error, after lines of progress that a slow machine shows."""
    *progress, line = done.stderr.splitlines()
    assert all(re.search(r": [\d,.]+ ?\S*( of |, |/)|, \d+ s so far$", other) for other in progress), done.stderr
    return line


@pytest.mark.slow
@pytest.mark.parametrize("megabytes", [200, 400])
def test_little_memory_is_one_line_and_not_a_damaged_file(tmp_path, megabytes):
    for command in (("info", DEMO, "--no-cache"), ("export", DEMO, "--no-cache", "--out", tmp_path / "a.e57")):
        done = _run(*command, limit=megabytes << 20)
        assert done.returncode == 2 and "not enough memory" in _line(done), done.stderr
        assert "damaged" not in done.stderr and not list(tmp_path.iterdir())


def test_a_picture_without_memory_for_a_graphics_driver_is_a_lack_of_memory_not_of_a_driver(tmp_path):
    from pointglass.viewer.picture.camera import from_fov, look_at
    from pointglass.viewer.work.cameras.camera_files import write_camera_path

    write_camera_path(tmp_path / "path.json", [from_fov(64, 48, 60, look_at((2.0, -3.0, 2.0), (2.0, 2.0, 0.0)), "a")])
    done = _run("render", DEMO, "--no-cache", "--cameras", tmp_path / "path.json", "--out", tmp_path / "out", "--view", "raw",
                limit=480 << 20)  # fmt: skip
    assert done.returncode == 2 and "not enough memory" in _line(done) and not list(tmp_path.glob("out/*.png"))


def test_native_code_that_aborts_for_lack_of_memory_is_one_line(tmp_path):
    code = """
import os, sys
from pointglass.viewer.common.limited_memory import run_in_child_where_limited
run_in_child_where_limited()
if sys.argv[1] == "abort":
    os.write(2, b"memory allocation of 132 bytes failed\\n")
    os.abort()
print("fine", file=sys.stderr)
os._exit(int(sys.argv[1]))
"""
    def limited() -> None:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))

    for argument, expected in (("abort", 2), ("0", 0), ("1", 1), ("130", 130)):
        said = "not enough memory" if argument == "abort" else "fine"
        done = subprocess.run([sys.executable, "-c", code, argument], cwd=ROOT, capture_output=True, text=True,
                              preexec_fn=limited)
        assert done.returncode == expected and said in done.stderr and done.stderr.count("\n") == 1


def test_lack_of_memory_is_found_behind_another_error(capsys):
    def damaged(cause: BaseException) -> InputError:
        try:
            raise cause
        except BaseException:
            try:
                raise InputError("truncated or damaged: copy it again", file="/a/house.laz") from None
            except InputError as error:
                return error

    causes = (MemoryError(), OSError(errno.ENOMEM, "Cannot allocate memory"), RuntimeError("std::bad_alloc"),
              ImportError("x.so: failed to map segment from shared object"))
    for cause in causes:
        assert report(damaged(cause)) == 2
        assert capsys.readouterr().err.startswith("pointglass: /a/house.laz: not enough memory")
    assert not lacks_memory(damaged(ValueError("not JSON"))) and report(damaged(ValueError("x"))) == 2
    assert "truncated or damaged" in capsys.readouterr().err
    assert report(ValueError("a bug")) is None and report(BrokenPipeError()) is None


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_for_output_and_log_is_one_line(thin_demo, tmp_path):
    with open("/dev/full", "w") as full:
        done = _run("info", thin_demo, "--json", stdout=full)
    assert done.returncode == 2 and "No space left" in _line(done)
    with open("/dev/full", "w") as full:
        done = _run("--help", stdout=full)
    assert done.returncode == 2 and "No space left" in _line(done)
    done = _run("info", thin_demo, "--log-file", "/dev/full")
    assert done.returncode == 2 and "log is incomplete (No space left on device)" in _line(done)
    with open("/dev/full", "w") as full:
        assert _run("info", tmp_path / "none.laz", stderr=full).returncode == 2


def test_closed_pipes_are_no_error(thin_demo):
    for stream in ("stdout", "stderr"):
        reading, writing = os.pipe()
        os.close(reading)
        done = _run("info", thin_demo if stream == "stdout" else "none.laz", "--json", **{stream: writing})
        os.close(writing)
        assert done.returncode == (0 if stream == "stdout" else 2) and not (done.stderr or "")


@pytest.mark.slow
def test_every_writer_that_meets_a_full_disk_says_so(thin_demo, tmp_path, monkeypatch, capsys):
    """ENOSPC where a temporary file is made, of commands that write one file."""
    from pointglass.model.common.files import temporary

    def full(path, _mode):
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(temporary, "_new_file", full)
    monkeypatch.setattr(temporary, "_new_folder", full)
    scan = str(thin_demo)
    for command in (("simulate", "--points", "1000", "--out", "a.laz"), ("export", scan, "--no-cache", "--out", "a.laz"),
                    ("export", scan, "--no-cache", "--out", "a.e57"), ("convert", scan, "--out", "grid")):
        monkeypatch.chdir(tmp_path)
        assert cli.main(list(command)) == 2
        error = capsys.readouterr().err
        assert "no space left" in error.lower() and error.count("\n") == 1 and not list(tmp_path.iterdir())


def test_a_grid_truncated_while_it_is_open_is_an_error_and_one_replaced_is_read_on(thin_demo, tmp_path):
    """Reading the map beyond the end of its file would end the process (SIGBUS)."""
    from pointglass.viewer.commands.convert import convert
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.grid.scene import unpack

    convert([thin_demo], tmp_path / "grid")
    scene = open_scene(tmp_path / "grid")
    before = unpack(scene, slice(200_000, 200_010))[0]
    file = tmp_path / "grid" / "points.npy"
    other = tmp_path / "other.npy"
    other.write_bytes(b"another grid")
    other.replace(file)
    assert (unpack(scene, slice(200_000, 200_010))[0] == before).all()
    convert([thin_demo], tmp_path / "second")
    scene = open_scene(tmp_path / "second")
    os.truncate(tmp_path / "second" / "points.npy", 5000)
    with pytest.raises(InputError, match=r"points\.npy: was truncated while it was open"):
        unpack(scene, slice(200_000, 200_010))
