"""Compiled loops are kept where the user may write, and a long compilation is said once."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pointglass
from pointglass.model.common import loop_cache

COMMON = Path(pointglass.__file__).parent / "model" / "common"
LOOP = """
from .common.jit import compiled

@compiled()
def twice(number):
    return 2 * number
"""
RUN = """
import json, sys
sys.path.insert(0, sys.argv[1])
from package.common import loop_cache
loop_cache._QUIET_SECONDS = -1.0
said = []
loop_cache.NOTICE.tell = said.append
from package import loops
assert loops.twice(4) == 8
print(json.dumps([sum(loops.twice.dispatcher.stats.cache_hits.values()), loops.twice.dispatcher.stats.cache_path, said]))
"""


@pytest.fixture
def package(tmp_path):
    """A package with one loop, in a folder where no machine code can be kept: as if it were read-only, also for root."""
    folder = tmp_path / "site" / "package"
    (folder / "common").mkdir(parents=True)
    for file in (folder / "__init__.py", folder / "common" / "__init__.py", folder / "__pycache__"):
        file.touch()
    (folder / "loops.py").write_text(LOOP)
    for name in ("compiled_in", "jit", "loop_cache", "numba_loops", "system"):
        shutil.copy(COMMON / f"{name}.py", folder / "common")
    return folder


def run(package: Path, **environment: str) -> tuple[int, str, list[str]]:
    """(loops loaded from disk, their folder, what was said) of one process."""
    clean = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "POINTGLASS_CACHE")}
    done = subprocess.run([sys.executable, "-B", "-c", RUN, str(package.parent)], env=clean | environment, cwd=package.parent,
                          capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    hits, folder, said = json.loads(done.stdout)
    return hits, folder, said


def test_loops_of_a_read_only_package_are_compiled_once_and_said(package, tmp_path):
    cache = tmp_path / "cache"
    hits, folder, said = run(package, POINTGLASS_CACHE=str(cache))
    assert hits == 0 and said == ["compiling loops, once, about a minute"]
    assert Path(folder).parent == cache / f"loops-{os.getuid()}" and (cache / f"loops-{os.getuid()}").stat().st_mode & 0o77 == 0
    assert run(package, POINTGLASS_CACHE=str(cache)) == (1, folder, [])


def test_numbas_own_setting_goes_first(package, tmp_path):
    _, folder, _ = run(package, POINTGLASS_CACHE=str(tmp_path / "cache"), NUMBA_CACHE_DIR=str(tmp_path / "numba"))
    assert Path(folder).parent == tmp_path / "numba" and not (tmp_path / "cache").exists()


def test_without_any_folder_it_says_that_each_process_compiles(package):
    code = RUN.replace("said = []", "said = []; loop_cache.user_folder = lambda: None")
    done = subprocess.run([sys.executable, "-B", "-c", code, str(package.parent)], capture_output=True, text=True, timeout=120,
                          env={name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"})
    assert done.returncode == 0, done.stderr
    hits, folder, said = json.loads(done.stdout)
    assert (hits, folder) == (0, None) and len(said) == 1 and "POINTGLASS_CACHE" in said[0]


def test_a_folder_that_others_can_write_to_is_not_used(tmp_path):
    """Machine code is stored as pickles: whoever writes there runs code as the person who loads it."""
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "link").symlink_to(tmp_path / "mine", target_is_directory=True)
    (tmp_path / "mine").mkdir(mode=0o700)
    assert not loop_cache._made(tmp_path / "open") and not loop_cache._made(tmp_path / "link")
    assert loop_cache._made(tmp_path / "mine") and loop_cache._made(tmp_path / "new")


def test_the_line_comes_once_and_not_for_a_single_fast_loop(monkeypatch):
    said: list[str] = []
    now = iter([0.0, 1.0, 1.0, 4.0, 4.0, 9.0])
    monkeypatch.setattr(loop_cache, "perf_counter", lambda: next(now))
    monkeypatch.setattr(loop_cache, "_QUIET_SECONDS", 2.0)  # tests/conftest.py silences it
    notice = loop_cache.CompilingNotice()
    notice.tell = said.append
    for expected in (0, 0, 1):  # after 0, 1 and 4 seconds of compiling
        notice.started()
        notice.started()  # a loop that it calls
        notice.ended()
        notice.ended()
        assert len(said) == expected
    notice.kept = False
    assert "POINTGLASS_CACHE" in notice.line()


CALLER = """
from . import values
from .common.jit import compiled
from .helpers import scaled
from .values import OFFSET

@compiled()
def result(number):
    return inner(number) + OFFSET + values.PAIR[1]

@compiled()
def inner(number):
    return scaled(number)
"""
HELPERS = """
from .common.jit import compiled
from .values import FACTOR

@compiled()
def scaled(number):
    return FACTOR * number
"""


CHANGES = (
    ("values.py", "OFFSET = 1", "OFFSET = 2", 312), ("values.py", "PAIR = (5, 10)", "PAIR = (5, 20)", 322),
    ("values.py", "FACTOR = 100", "FACTOR = 300", 922), ("helpers.py", "FACTOR * number", "FACTOR - number", 319),
)  # fmt: skip
"""File, text before, text after, and the result after this change and those above it."""


def test_a_constant_or_a_loop_of_another_module_that_changed_is_compiled_again(package, tmp_path):
    """As after `git pull`: the file of the loop that is called is the same."""
    for name, text in (("caller", CALLER), ("helpers", HELPERS), ("values", "OFFSET = 1\nPAIR = (5, 10)\nFACTOR = 100\n")):
        (package / f"{name}.py").write_text(text)
    told = ("import sys; sys.path.insert(0, sys.argv[1])\nfrom package.caller import result\n"
            "print(result(3), sum(result.dispatcher.stats.cache_hits.values()))")
    environment = os.environ | {"POINTGLASS_CACHE": str(tmp_path / "cache")}
    environment.pop("NUMBA_CACHE_DIR", None)

    def called() -> tuple[int, int]:
        done = subprocess.run([sys.executable, "-B", "-c", told, str(package.parent)], env=environment, capture_output=True,
                              text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        value, hits = map(int, done.stdout.split())
        return value, hits

    assert called() == (311, 0)
    for file, before, after, expected in CHANGES:
        changed = package / file
        changed.write_text(changed.read_text().replace(before, after))
        assert called() == (expected, 0) and called() == (expected, 1)
