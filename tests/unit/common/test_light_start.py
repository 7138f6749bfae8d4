"""A light start: raw, filtered and filled views of a cached scan load no library that only other work needs."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pointglass.viewer.cli import main
from pointglass.viewer.common.paths import assets_dir

ROOT = Path(__file__).resolve().parents[3]
NEVER = ("torch", "open3d", "matplotlib", "pye57", "tensorboard", "pointglass.viewer.window")
"""Not loaded by a raw, filtered or filled picture, whether the scan is in the cache or not."""
NOT_FROM_CACHE = ("laspy", "lazrs")
"""Not loaded either where the scan is in the cache."""
RENDER = """
import json, sys
from pointglass.viewer.cli import main
code = main(["render", *sys.argv[1:]])
assert code == 0, code
print(json.dumps(sorted(sys.modules)))
"""
FROM_PYTHON = """
import json, sys
import pointglass
with pointglass.open(sys.argv[1]) as scan:
    camera = pointglass.look_at((4.8, 3.2, 1.5), (3.0, 2.0, 1.2), fov=64, size=(80, 60))
    for view in ("raw", "filtered", "filled"):
        assert scan.render(camera, view=view, full=True).image.any()
print(json.dumps(sorted(sys.modules)))
"""


def modules_after(code: str, *arguments: object) -> set[str]:
    """Names of the modules that a fresh Python has loaded when ``code`` has run."""
    done = subprocess.run([sys.executable, "-c", code, *map(str, arguments)], cwd=ROOT, capture_output=True, text=True,
                          timeout=300, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


@pytest.fixture(scope="module")
def one_camera(tmp_path_factory) -> Path:
    cameras = json.loads((assets_dir() / "demo_cameras.json").read_text())
    path = tmp_path_factory.mktemp("cameras") / "one.json"
    path.write_text(json.dumps({**cameras, "camera_path": cameras["camera_path"][:1]}))
    return path


@pytest.mark.slow
@pytest.mark.gl
def test_a_picture_without_the_network_loads_no_torch(thin_demo, one_camera, tmp_path):
    for view in ("raw", "filtered", "filled"):  # the first builds the grid, the others find it in the cache
        loaded = modules_after(RENDER, thin_demo, "--cameras", one_camera, "--out", tmp_path / view, "--view", view,
                               "--size", "80x60")
        assert not loaded & set(NEVER), view
        assert view == "raw" or not loaded & set(NOT_FROM_CACHE), view


@pytest.mark.gl
def test_a_picture_without_the_network_loads_no_torch_from_python(thin_demo):
    assert not modules_after(FROM_PYTHON, thin_demo) & set(NEVER)


WORDS_ONLY = """
import contextlib, io, json, sys
from pointglass.viewer.cli import main
from pointglass.viewer.command_table import COMMANDS
for command in ([], *([name] for name in COMMANDS)):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        main([*command, "--help"])
assert main(["info", sys.argv[1]]) == 0
print(json.dumps(sorted(sys.modules)))
"""


def test_help_of_every_command_and_info_of_a_scan_in_the_cache_load_no_library_that_computes(thin_demo):
    """In one process, because its commands add up: numba takes 0.4 s to import, scipy 0.2 s, torch 1.5 s."""
    assert main(["info", str(thin_demo)]) == 0  # into the cache
    heavy = {*NEVER, *NOT_FROM_CACHE, "numba", "scipy", "glfw", "moderngl", "imgui_bundle"}
    assert not modules_after(WORDS_ONLY, thin_demo) & heavy


def test_loops_of_other_code_may_still_use_blas():
    """numba_loops keeps numba from loading scipy's BLAS when it is imported; np.dot in a loop of other code still works."""
    code = ("import sys, json, numpy as np, pointglass.model.common.numba_loops, numba; early = sorted(sys.modules)\n"
            "a = np.arange(6.0).reshape(2, 3); assert (numba.njit(lambda x, y: np.dot(x, y))(a, a.T) == a @ a.T).all()\n"
            "print(json.dumps(early))")
    assert "scipy.linalg" not in modules_after(code)
