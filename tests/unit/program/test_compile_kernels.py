"""After the set-up nobody waits for the compiler: the loops of sections, pointing and passers-by are compiled ahead, too."""

import os
import subprocess
import sys

import numpy as np
import pytest
from cloud_files import write_las

SCRIPT = """
import sys
from pathlib import Path
import numpy as np
from pointglass.model.common.jit import Loop
from pointglass.viewer import cli, compile_kernels
from pointglass.viewer.commands import demo
from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import from_fov
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary
from pointglass.viewer.work.ghosts import find_ghosts
from pointglass.viewer.work.places.pick import pick, surface_around

scan = Path(sys.argv[1])
demo.demo_scan = lambda: scan

def compiled():
    return {(loop.py_func.__module__, loop.py_func.__name__, str(types)) for name, module in list(sys.modules.items())
            if name.startswith("pointglass.") for loop in list(vars(module).values()) if isinstance(loop, Loop)
            for types in loop.dispatcher.signatures}

compile_kernels._open_scans(scan.parent)
compile_kernels._draw_and_point()
compile_kernels._find_ghosts_and_show_photograph()
before = compiled()
assert cli.main(["section", str(scan), "--plan", "1.5", "--out", str(scan.with_name("plan.png"))]) == 0
scene = open_scene(scan)
pose = np.eye(4)
pose[:3, 3] = scene.bounds.mean(axis=0)
pick(scene, from_fov(320, 240, 70.0, pose), np.ones((240, 320), bool), np.full((240, 320), 1.5, np.float32), (9.0, 9.0))
surface_around(scene, scene.bounds[0])
stations = (ScanSummary("a", 2000, tuple(scene.bounds[0] + 0.5)), ScanSummary("b", 2000, tuple(scene.bounds[1] - 0.5)))
xyz, rgb = unpack(scene)[:2]
find_ghosts(scene_from_arrays(xyz, rgb, scan=np.repeat([0, 1], 2000).astype(np.uint8), meta=ScanDescription(scans=stations)))
print("loops:", len(before), "more:", sorted(compiled() - before))
"""


@pytest.mark.slow
def test_sections_pointing_and_passers_by_compile_nothing_after_the_set_up(tmp_path):
    rng = np.random.default_rng(0)
    scan = tmp_path / "room.laz"
    write_las(scan, rng.random((4000, 3)) * 3, rng.integers(0, 256, (4000, 3), np.uint8))
    environment = os.environ | {"POINTGLASS_CACHE": str(tmp_path / "cache"), "POINTGLASS_STATE": str(tmp_path / "state")}
    command = [sys.executable, "-c", SCRIPT, str(scan)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    last = done.stdout.splitlines()[-1]
    assert last.endswith("more: []") and not last.startswith("loops: 0 "), last
