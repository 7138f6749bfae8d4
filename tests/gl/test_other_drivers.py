"""Other implementations of OpenGL on this machine: Mesa's softpipe, an interpreter without vectors, and zink, which translates
to Vulkan, here on lavapipe.  Each makes the pictures that llvmpipe makes.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from driver_pictures import named_pictures

from pointglass.viewer.render.device.context import describe_device

pytestmark = pytest.mark.gl

DRIVERS = {
    # softpipe has all that is used and names OpenGL 3.3, for other parts of 4.x that it lacks
    "softpipe": {"GALLIUM_DRIVER": "softpipe", "MESA_GL_VERSION_OVERRIDE": "4.3", "MESA_GLSL_VERSION_OVERRIDE": "430"},
    "zink": {"MESA_LOADER_DRIVER_OVERRIDE": "zink", "LIBGL_ALWAYS_SOFTWARE": "true"},
}
"""Environment by driver.  zink finds lavapipe through Vulkan's loader (VK_ICD_FILENAMES where it lies elsewhere)."""
DEPTH_ROUNDING = 2e-6
"""Relative difference of depths that drivers may round differently: 16 units in the last place of float32."""


def made_by(environment: dict[str, str], path: Path, *more: str) -> "subprocess.CompletedProcess[str]":
    script = Path(__file__).with_name("driver_pictures.py")
    return subprocess.run([sys.executable, str(script), str(path), *more], env=os.environ | environment, capture_output=True,
                          text=True, timeout=180)  # fmt: skip


@pytest.fixture(scope="module")
def expected(context):
    if not describe_device(context).software:
        pytest.skip("compares software drivers; here a GPU draws")
    return named_pictures(context)


@pytest.mark.parametrize(("driver", "as_gpu"), [("softpipe", False), ("zink", False), ("zink", True)])
def test_another_driver_makes_the_same_pictures(expected, tmp_path, driver, as_gpu):
    """Also by the programs chosen for a GPU: zink has the 64-bit atomics of buffers that their colour sums use."""
    path = tmp_path / "there.npz"
    done = made_by(DRIVERS[driver], path, *(["--gpu"] if as_gpu else []))
    if done.returncode and "could not be had" in done.stderr:
        pytest.skip(f"{driver} is not installed (apt install mesa-vulkan-drivers brings lavapipe, which zink needs)")
    assert done.returncode == 0, done.stderr
    made = dict(np.load(path))
    assert driver in str(made.pop("renderer")) and made.keys() == expected.keys() - {"renderer"}
    different = {}
    for name, picture in made.items():
        wanted = expected[name]
        if name.endswith("wide sums"):
            assert picture == as_gpu, name
        elif name.endswith("depth"):  # the same pixels are empty, and depths differ by rounding at most
            assert np.array_equal(np.isinf(picture), np.isinf(wanted)), name
            here = np.isfinite(wanted)
            assert np.all(np.abs(picture[here] - wanted[here]) <= DEPTH_ROUNDING * wanted[here]), name
        elif not np.array_equal(picture, wanted):
            different[name] = f"{np.count_nonzero((picture != wanted).reshape(*wanted.shape[:2], -1).any(-1))} pixels"
    assert not different
