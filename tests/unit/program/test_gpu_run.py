"""The script for a GPU machine, where there is none: its plumbing on the CPU, what fails in it, and what it asks of the CLI."""

import importlib.util
import io
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "gpu" / "run.py"
SMALL_PARTS = ("scan", "workgroups", "engines")
"""Parts of the small run here: one that others read, one that reads it, one that logs rows as they come."""
MORE_WORKERS = ("projected", "agreement", "growth")
"""The other workers, in one process: each would load the libraries and compile the shaders again.  All else is benches with
tests of their own."""
WORK = """
import json, sys
from pathlib import Path
from plan import SMALL
from workers import WORKERS
print(json.dumps({name: WORKERS[name](SMALL, Path(sys.argv[1])) for name in sys.argv[2:]}))
"""
ABSENT = ("open3d", "glfw", "imgui_bundle", "pye57", "OpenGL", "hatchling")
"""What such a machine does not have."""
BLOCK = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {names}:
            raise ImportError(f"{{name}} is not there")
sys.meta_path.insert(0, Absent())
"""


@pytest.fixture(scope="module")
def run():
    sys.path.insert(0, str(SCRIPT.parent))  # as Python does for a script
    spec = importlib.util.spec_from_file_location("gpu_run", SCRIPT)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["gpu_run"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    yield module
    del sys.modules["gpu_run"]
    sys.path.remove(str(SCRIPT.parent))


@pytest.fixture
def bare(tmp_path) -> Path:
    """A folder for PYTHONPATH: what such a machine does not have cannot be imported."""
    folder = tmp_path / "block"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(BLOCK.format(names=set(ABSENT)))
    return folder


@pytest.mark.slow
@pytest.mark.gl
def test_a_small_run_leaves_every_figure_in_one_folder(run, bare, tmp_path):
    out = tmp_path / "out"
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--small", "--only", ",".join(SMALL_PARTS), "--out", str(out)],
        env=os.environ | {"PYTHONPATH": str(bare)}, capture_output=True, text=True, timeout=240,
    )  # fmt: skip
    log = (out / "log.txt").read_text()
    assert done.returncode == 0, done.stdout + done.stderr + log
    results = json.loads((out / "results.json").read_text())
    parts = {name: held["result"] for name, held in results["parts"].items()}
    assert list(parts) == list(SMALL_PARTS) and results["plan"]["small"]
    assert parts["scan"]["points"] == results["plan"]["points"]
    (network,), (bridge,) = parts["engines"]["network"], parts["engines"]["bridge"]
    assert network["runs"] == "call by call" and network["problem"] is None and network["ms"] > 0
    assert bridge["kind"] == "read-back" and bridge["ms"] > 0
    rows = [json.loads(line) for line in log.splitlines() if line.startswith('{"')]
    assert [row for row in rows if "kind" in row or "engine" in row][-2:] == [bridge, network], "told as they come"
    assert sorted(path.name for path in out.iterdir()) == ["PAGE.md", "log.txt", "results.json"]
    assert {row["workgroup"] for row in parts["workgroups"]["rows"]} >= {"8x8", "64x1"}
    page = (out / "PAGE.md").read_text()
    rows = [line for line in page.splitlines() if line.startswith("| ") and "promise" not in line][: len(run.PROMISES)]
    assert [row.split(" | ")[0][2:] for row in rows] == [promise.text for promise in run.PROMISES]
    assert sum("not judged: no CUDA" in row for row in rows) == sum(promise.needs_gpu for promise in run.PROMISES)
    assert len(page.splitlines()) < 60


@pytest.mark.slow
@pytest.mark.gl
def test_every_worker_leaves_its_figures(run, bare, tmp_path):
    import workers

    begun = {part.name: part.command(run.Plan(), tmp_path)[0] for part in run.PARTS}
    assert {name for name, script in begun.items() if script.endswith("workers.py")} == set(workers.WORKERS)
    assert set(workers.WORKERS) == {*SMALL_PARTS, *MORE_WORKERS}
    plan, work = run.SMALL, tmp_path / "work"
    done = subprocess.run([sys.executable, "-c", WORK, str(work), "scan", *MORE_WORKERS], cwd=SCRIPT.parents[2],
                          env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (bare, SCRIPT.parent)))},
                          capture_output=True, text=True, timeout=240)  # fmt: skip
    assert done.returncode == 0, done.stderr
    made = json.loads(done.stdout.splitlines()[-1])
    views = made["projected"]["views"]
    assert len(views) == 8 and max(view["points"] for view in views) == made["projected"]["most"]["points"] > 0
    assert all(view["raster_ms"] > 0 and view["raster_host_ms"] > 0 for view in views)
    assert made["growth"]["frames"] == plan.frames and made["agreement"]["shares"]


@pytest.mark.gl
def test_one_bridge_that_fails_does_not_end_the_rest(run, monkeypatch, capsys):
    import workers

    from pointglass.viewer.render.network import bridge

    made = bridge.ReadBackBridge

    def broken(context, size):
        if size == (8, 6):
            raise RuntimeError("a driver's own\nmessage")
        return made(context, size)

    monkeypatch.setattr(bridge, "ReadBackBridge", broken)
    first, second = workers._bridges(replace(run.SMALL, sizes=("8x6", "16x12")))
    assert first["problem"] == "RuntimeError: a driver's own" and second["ms"] > 0
    assert [json.loads(line) for line in capsys.readouterr().err.splitlines() if line.startswith("{")] == [first, second]


@pytest.mark.slow
def test_its_tests_begin_where_pytest_has_no_plugins(run, bare, tmp_path):
    """As on a bare machine: the project's own options ask for one.  Nor is there what else such a machine does not have."""
    first, second = (part.command(run.Plan(), tmp_path) for part in run.PARTS if part.name in ("tests", "pictures"))
    options = [[word for word in command if not word.startswith(("tests/", "--junitxml"))] for command in (first, second)]
    assert set(options[0]) == set(options[1]) - {"--maxfail=10"}  # so that one run collects both parts' tests
    files = [word for word in second if word.startswith("tests/")]
    done = subprocess.run([sys.executable, *first, *files, "--collect-only", "-p", "no:timeout"], cwd=SCRIPT.parents[2],
                          env=os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": str(bare)},
                          capture_output=True, text=True, timeout=240)  # fmt: skip
    assert done.returncode == 0 and " error" not in done.stdout, done.stdout + done.stderr
    assert all(held in done.stdout for held in ("test_interop.py", "test_engines.py", *(Path(file).name for file in files)))


@pytest.mark.slow
def test_what_fails_among_its_tests_is_told_before_the_end(run, tmp_path):
    """A test after it may hang in a driver, and the part is then cut short."""
    tests = next(part for part in run.PARTS if part.name == "tests").command(run.SMALL, tmp_path)
    done = subprocess.run([sys.executable, *tests, "-k", "two_bridges or doctor_finds"], cwd=SCRIPT.parents[2],
                          env=os.environ | {"POINTGLASS_EXPECT_GPU": "1", "CUDA_VISIBLE_DEVICES": ""},
                          capture_output=True, text=True, timeout=240)  # fmt: skip
    told, _, rest = done.stdout.partition("= ERRORS =")
    assert done.returncode == 1 and rest, done.stdout + done.stderr
    assert told.count("a GPU was expected") >= 2 and "test_interop.py::test_two_bridges_at_once" in told


@pytest.mark.parametrize("kept", [True, False])
def test_the_first_page_judges_every_promise_by_its_figure(run, kept):
    """With figures just within each limit, and just beyond."""
    rate, ratio, share, ms, flat, grown, differing = ((121.0, 8.1, 0.41, 4.9, 1.29, 1 << 20, 4e-4) if kept else
                                                      (119.0, 2.9, 0.39, 5.1, 1.31, 1 << 30, 6e-4))
    frame = {"runs": [{"size": [1920, 1440], "views": {"neural": {"total": {"p50": 8.0, "in_a_row_fps": rate}}}}]}
    versus = {"runs": [{"size": [1920, 1440], "ratios": {"ours, balanced": {"paper, as published": ratio}},
                        "fairness": {"fair": kept, "share_of_matmul": share, "matmul_rate": 1e15}}]}
    state = "passed" if kept else "failed"
    parts = {
        "frame-1": frame, "versus": versus, "scale": {"growth": {"rooms": {"from": 1e7, "to": 1e9, "raw": flat}}},
        "projected": {"most": {"ms_per_100M": ms, "points": 10**8, "raster_ms": ms}},
        "tests": {"cases": {"a.test_mapped_and_copied_pixels": state, "a.test_pictures_are_equal_to_read_back_ones": state}},
        "growth": {"frames": 10_000, "main_bytes": grown, "gpu_bytes": 0, "allowed_bytes": 32 << 20},
        "agreement": {"shares": {"raw": differing}, "tolerance": 5e-4, "following": {"mask": 0.0}, "following_tolerance": 0.01},
    }
    results = {"machine": {"gpu": "a GPU", "system": "Linux", "python": "3.12"}, "plan": {"small": False, "points": 1},
               "parts": {name: {"seconds": 1.0, "said": "done", "result": result} for name, result in parts.items()}}
    states = [verdict.state for _, verdict in run.verdicts(results)]
    assert states.count("not judged") == (1 if kept else 3)  # the distance; and beside an unfair opponent no ratio counts
    assert states.count("pass" if kept else "FAIL") == len(run.PROMISES) - states.count("not judged")
    del results["parts"]["growth"]
    assert "its part left no figure" in run.page(results)


def parts_of(run, *commands: list[str], seconds: float = 20.0, **named):
    return [run.Part(f"part{i}", seconds, lambda *_, c=c: c, **named) for i, c in enumerate(commands)]


def test_a_part_that_fails_or_hangs_does_not_end_the_rest(run, tmp_path):
    parts = parts_of(run, ["-c", "print('x'); raise SystemExit(3)"], ["-c", "import time; time.sleep(60)"], seconds=2.0)
    parts += parts_of(run, ["-c", "print('progress'); print('{\"figure\": 7}')"], ["-c", "print('no figure')"], json=None)
    parts = [run.Part(f"{i}", part.seconds, part.command, part.json) for i, part in enumerate(parts)]
    with open(tmp_path / "log.txt", "w") as log:
        held = run._all(run.SMALL, parts, tmp_path, tmp_path, log, 60.0)["parts"]
    assert held["0"]["said"] == "failed (3)" and held["0"]["result"] == "x"
    assert held["1"]["said"].startswith("cut short after 2 s")
    assert held["2"]["said"] == "done" and held["2"]["result"] == {"figure": 7}
    assert held["3"]["said"].startswith("done, no result")
    assert json.loads((tmp_path / "results.json").read_text())["parts"] == held


def test_no_part_starts_without_time(run, tmp_path):
    held = run._all(run.SMALL, parts_of(run, ["-c", "print(1)"]), tmp_path, tmp_path, io.StringIO(), 9.0)["parts"]
    assert held["part0"]["said"].startswith("left out")


def test_it_ends_within_nine_minutes_and_leaves_few_files(run):
    assert run.TOTAL + run._LAST <= 540 and all(part.seconds < run.TOTAL for part in run.PARTS)
    assert 3 + sum(part.plot is not None for part in run.PARTS) <= 8
    assert len({part.name for part in run.PARTS}) == len(run.PARTS)


def test_the_command_line_has_everything_it_asks_for(run, tmp_path):
    from pointglass.viewer.command_table import make_parser

    asked = 0
    for plan in (run.Plan(), run.SMALL):
        for part in run.PARTS:
            if part.name.startswith("frame-") and int(part.name[6:]) >= len(plan.sizes):
                continue
            command = part.command(plan, tmp_path)
            if command[:2] == ["-m", "pointglass.viewer"]:
                make_parser().parse_args(command[2:])
                asked += 1
    assert asked >= 8
