"""--workers: the command line as a process, its results equal to the byte, whatever is killed or interrupted."""

import contextlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import run_here
from las_files import coloured_corner, coloured_las

from pointglass.model.common.process.processors import usable_processors
from pointglass.viewer.commands.heldout.evaluate_scan import judge_scan
from pointglass.viewer.common.workers.worker_choice import Workers
from pointglass.viewer.grid.place.own_processes import WORTH

ROOT = Path(__file__).resolve().parents[3]
pytestmark = pytest.mark.gl
FRAMES = 8
PROGRESS = re.compile(r"^pointglass: [a-z ]+[:,(].*(left|so far)\n", re.MULTILINE)
"""Lines on standard error that come on a busy machine only."""


@pytest.fixture(scope="module")
def scan(tmp_path_factory) -> Path:
    return coloured_corner(tmp_path_factory.mktemp("scan") / "corner.laz")


@pytest.fixture(scope="module")
def cameras(tmp_path_factory) -> Path:
    frames = [{"file_path": f"images/{n}.jpg", "transform_matrix": [[1, 0, 0, 1 + 0.2 * n], [0, 0, -1, 0.5], [0, 1, 0, 1.4],
                                                                    [0, 0, 0, 1]]} for n in range(FRAMES)]
    path = tmp_path_factory.mktemp("cameras") / "transforms.json"
    path.write_text(json.dumps({"fl_x": 60, "w": 80, "h": 60, "frames": frames}))
    return path


def start(*arguments) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-m", "pointglass.viewer", *map(str, arguments)], cwd=ROOT, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def run(*arguments) -> subprocess.CompletedProcess:
    process = start(*arguments)
    out, err = process.communicate(timeout=240)
    return subprocess.CompletedProcess(process.args, process.returncode, out, PROGRESS.sub("", err))


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def children(pid: int) -> list[int]:
    try:
        tasks = [*Path(f"/proc/{pid}/task").iterdir()]
        return [int(child) for task in tasks for child in (task / "children").read_text().split()]
    except OSError:
        return []


def wait_for_the_end_of(workers) -> None:
    end = time.monotonic() + 30
    while left := [pid for pid in workers if Path(f"/proc/{pid}").exists()]:
        assert time.monotonic() < end, left
        time.sleep(0.02)


def hidden(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.name.startswith(".") or "partial" in path.name]


@pytest.fixture(scope="module")
def pictures(scan, cameras, tmp_path_factory) -> dict[str, bytes]:
    """Those of one process; the grid is in the cache then."""
    out = tmp_path_factory.mktemp("pictures") / "out"
    assert run_here("render", scan, "--cameras", cameras, "--out", out, "--view", "filled").returncode == 0
    assert len(content(out)) == FRAMES
    return content(out)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [2, pytest.param(1, marks=pytest.mark.long), pytest.param(8, marks=pytest.mark.long)])
def test_pictures_of_workers_are_those_of_one_process(scan, cameras, pictures, tmp_path, workers):
    out = tmp_path / "out"
    line = "render", scan, "--cameras", cameras, "--out", out, "--view", "filled", "--workers", workers
    ended = run(*line, "--shard", "1/2", "--verbose")
    assert ended.returncode == 0 and f"{min(workers, FRAMES // 2)} worker process" in ended.stderr
    ended = run(*line, "--resume")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == f"{FRAMES} pictures in {out} ({FRAMES // 2} pictures already there)\n"
    assert content(out) == pictures


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.mp4", pytest.param("frames", marks=pytest.mark.long)])
def test_a_film_of_workers_is_that_of_one_process(scan, cameras, pictures, tmp_path, name):
    made = []
    for number, (run_as, given) in enumerate([(run_here, []), (run, ["--workers", 2])]):
        (folder := tmp_path / str(number)).mkdir()
        ended = run_as("video", scan, "--path", cameras, "--out", folder / name, "--view", "raw", "--seconds", 1, *given)
        assert (ended.returncode, ended.stderr) == (0, "")
        made.append(content(folder))
    assert made[0] == made[1] and len(made[0]) == (1 if name == "a.mp4" else 25)


@pytest.mark.long
def test_a_publication_of_workers_is_that_of_one_process(scan, pictures, tmp_path):
    line = "publish", scan, "--view", "filled", "--face-size", 512, "--places", 2, "--second", "none", "--out"
    assert run(*line, tmp_path / "a").returncode == 0
    ended = run(*line, tmp_path / "b", "--workers", 2)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert content(tmp_path / "a") == content(tmp_path / "b")


@pytest.mark.slow
def test_figures_of_an_evaluation_by_workers_are_those_of_one_process(scan, pictures):
    one, two = (judge_scan(scan, {}, densities=(1.0,), views=3, size=(160, 120), sheet=True, workers=workers)
                for workers in (None, Workers(2)))  # fmt: skip
    assert one[0] == two[0] and one[0]["rows"][0]["views"] == 3
    assert np.array_equal(np.concatenate(one[1]), np.concatenate(two[1]))


@pytest.mark.slow
@pytest.mark.parametrize("each", [False, True])
def test_grids_of_workers_are_those_of_one_process(scan, tmp_path, each):
    """Of two LAZ files and a damaged one, which is left out."""
    rng = np.random.default_rng(3)
    (folder := tmp_path / "scans").mkdir()
    for name in "ab":
        coloured_las(folder / f"{name}.laz", rng.uniform(0, 3, (5000, 3)), rng)
    whole = (folder / "b.laz").read_bytes()
    (folder / "c.laz").write_bytes(whole[: len(whole) // 2])
    found = []
    for number, (run_as, given) in enumerate([(run_here, []), (run, ["--workers", 2])]):
        files = [folder] if each else sorted(folder.iterdir())
        ended = run_as("convert", *files, "--out", tmp_path / str(number), *(["--each"] if each else []), *given)
        assert (ended.returncode, ended.stderr.count("\n")) == ((2, 1) if each else (0, 0))
        said = ended.stderr if each else (tmp_path / str(number) / "meta.json").read_text()
        assert "c.laz" in said
        found.append((content(tmp_path / str(number)), ended.stderr.replace(str(tmp_path / str(number)), "")))
    assert found[0] == found[1] and len(found[0][0]) > 8 and hidden(tmp_path) == []


@pytest.mark.slow
@pytest.mark.skipif(usable_processors() < 2, reason="one processor converts in one process")
def test_large_scans_are_converted_by_several_processes_without_an_option_whatever_is_killed(tmp_path, seed):
    rng, choice = np.random.default_rng(4), random.Random(seed)
    (folder := tmp_path / "scans").mkdir()
    for name in "abc":
        file = coloured_las(folder / f"{name}.las", rng.uniform(0, 3, (300_000, 3)), rng)
        os.truncate(file, WORTH)  # zeros behind the points
    assert run_here("convert", folder / "b.las", "--out", tmp_path / "alone").returncode == 0
    for fault in "kill", "interrupt":
        out = tmp_path / fault
        process = start("convert", folder, "--each", "--out", out)
        while len(workers := children(process.pid)) < 2:
            assert process.poll() is None, process.communicate()[1]
            time.sleep(0.02)
        time.sleep(choice.uniform(0, 2))
        with contextlib.suppress(ProcessLookupError):
            os.kill(choice.choice(children(process.pid) or workers) if fault == "kill" else process.pid,
                    signal.SIGKILL if fault == "kill" else signal.SIGINT)
        err = PROGRESS.sub("", process.communicate(timeout=240)[1])
        assert hidden(tmp_path) == [], (fault, seed)
        wait_for_the_end_of(workers)
        if fault == "interrupt":
            assert (process.returncode, err) in ((130, "pointglass: stopped\n"), (0, "")), seed
            assert run("convert", folder, "--each", "--out", out).returncode == 0, seed  # goes on with those that are left
        else:
            assert process.returncode == 0, (seed, err)
        assert content(out / "b") == content(tmp_path / "alone"), (fault, seed)
        assert sorted(path.name for path in out.iterdir()) == ["a", "b", "c"], (fault, seed)


def at_work(scan, cameras, out, rng):
    """A command with two workers, some random time after these were started; and those there were at first."""
    process = start("render", scan, "--cameras", cameras, "--out", out, "--view", "filled", "--workers", 2)
    while not (workers := children(process.pid)):
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(rng.uniform(0, 1.5))
    return process, workers


def test_a_random_worker_is_killed_at_a_random_time(scan, cameras, pictures, tmp_path, seed):
    rng = random.Random(seed)
    process, workers = at_work(scan, cameras, tmp_path / "out", rng)
    victim = rng.choice(children(process.pid) or workers)
    with contextlib.suppress(ProcessLookupError):
        os.kill(victim, signal.SIGKILL)
    _, err = process.communicate(timeout=240)
    assert process.returncode == 0, (seed, err)
    assert content(tmp_path / "out") == pictures, seed
    assert hidden(tmp_path) == []


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_a_signal_ends_command_and_workers_and_leaves_whole_pictures(scan, cameras, pictures, tmp_path, number, seed):
    rng = random.Random(seed)
    process, workers = at_work(scan, cameras, tmp_path / "out", rng)
    workers = {*workers, *children(process.pid)}
    process.send_signal(number)
    err = PROGRESS.sub("", process.communicate(timeout=60)[1])
    assert (process.returncode, err) in ((130, "pointglass: stopped\n"), (0, "")), (seed, err)
    wait_for_the_end_of(workers)
    made = content(tmp_path)
    assert {Path(name).name for name in made} <= set(pictures) and hidden(tmp_path) == [], seed
    assert all(pictures[Path(name).name] == data for name, data in made.items()), seed


def test_an_error_in_a_worker_is_one_line_and_exit_code_2(scan, cameras, pictures, tmp_path):
    (tmp_path / "3.png").mkdir()
    ended = run("render", scan, "--cameras", cameras, "--out", tmp_path, "--view", "filled", "--workers", 2)
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"pointglass: {tmp_path / '3.png'}: is a folder") and ended.stderr.count("\n") == 1
    assert hidden(tmp_path) == []


def test_workers_without_the_cache_keep_no_grid_and_make_the_same_pictures(scan, cameras, pictures, tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    ended = run("render", scan, "--cameras", cameras, "--out", tmp_path / "out", "--view", "filled", "--workers", 2,
                "--no-cache")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert content(tmp_path / "out") == pictures
    assert not [*(tmp_path / "temporary").iterdir()] and not list((tmp_path / "cache").glob("*/meta.json"))


@pytest.mark.parametrize(("given", "said"), [
    (["--workers", "0"], "--workers '0': expected a number of processes from 1 to 256"),
    (["--scheduler", "tcp://127.0.0.1:1", "--no-cache"], "--no-cache: workers of a scheduler open the grid from the cache"),
    pytest.param(["--scheduler", "tcp://127.0.0.1:1"], "--scheduler 'tcp://127.0.0.1:1': ", marks=pytest.mark.long),
])  # fmt: skip
def test_what_cannot_be_distributed_is_refused(scan, cameras, tmp_path, given, said):
    ended = run_here("render", scan, "--cameras", cameras, "--out", tmp_path / "out", "--view", "filled", *given)
    assert ended.returncode == 2 and ended.stderr.startswith(f"pointglass: {said}") and ended.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
