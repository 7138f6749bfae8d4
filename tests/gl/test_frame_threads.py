"""What draws a picture leaves the processors to OpenGL: NumPy's own threads stay asleep.

A thread of BLAS that has done its share turns idly for the next one, for 25 ms.  In software OpenGL that is a processor less
for the shaders, and nothing but time says so.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.gl
ROOT = Path(__file__).resolve().parents[2]

FRAMES = """
import os
import sys
from pathlib import Path

import numpy as np

TASKS = Path("/proc/self/task")
theirs = [task for task in TASKS.iterdir() if int(task.name) != os.getpid()]  # before anyone else makes threads


def worked():
    '''Clock ticks that NumPy's threads have worked so far.'''
    return sum(sum(map(int, (task / "stat").read_text().rsplit(")", 1)[1].split()[11:13])) for task in theirs)


from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.grid.density_layers import morton_order
from pointglass.viewer.grid.scene import Scene
from pointglass.viewer.render.device.context import create_context
from pointglass.viewer.render.culling.occlusion import Occlusion
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.picture.settings import Settings

rng = np.random.default_rng(int(sys.argv[1]))
coords = np.stack(np.meshgrid(np.arange(128), np.arange(128), np.arange(2)), axis=-1).reshape(-1, 3).astype(np.int32)
coords = coords[morton_order(coords)]
offsets = 8 * np.arange(len(coords) + 1)
points = rng.integers(0, 1 << 32, (offsets[-1], 3), np.uint32)
bounds = np.array([(0.0, 0.0, 0.0), (128.0, 128.0, 2.0)])
scene = Scene(points, coords, offsets, np.zeros(3), 1.0, 1, len(points), 0.3, bounds)
camera = from_fov(64, 48, 80.0, look_at((-30.0, 64.0, 60.0), (64.0, 64.0, 0.0)))
context = create_context()
renderer, memory, settings = Renderer(context, scene, raster="compute"), Occlusion(), Settings(view="filled", raster="compute")
before = worked()
for _ in range(8):
    stats = renderer.render(camera, settings, ("filled",), memory).stats
    memory.forget()  # each is a first one, which looks for the nearest cells
print(len(theirs), stats["cells_drawn"], "occlusion" in stats, worked() - before)
"""


def test_frames_leave_the_threads_of_numpy_asleep(seed):
    if not Path("/proc/self/task").is_dir():
        pytest.skip("only Linux tells what a thread has worked")
    environment = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}  # NumPy heeds it
    environment |= {"PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))}
    done = subprocess.run([sys.executable, "-c", FRAMES, str(seed)], env=environment, capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stderr
    threads, cells, looked, ticks = done.stdout.split()
    if threads == "0":
        pytest.skip("NumPy has no threads of its own here")
    assert int(cells) > 20_000
    assert looked == "True"
    assert int(ticks) == 0
