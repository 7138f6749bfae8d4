"""All values of a scan are read into Python in little more memory than the result, whatever else its records hold: beside what
does not grow with the scan, a quarter of a byte a point.

Measured is the growth of the resident memory of a process of its own, pages of mapped files included, from the moment at which
the scan is open and a few points have been read (which loads libraries) to the highest one.
"""

import json
import os
import subprocess
import sys

import laspy
import numpy as np
import pytest
from cloud_files import E57Scan, write_e57

from pointglass.viewer.grid.open_scene import open_scene

COUNT = 1_500_000
BESIDE = 28 << 20
"""Bytes that do not grow with the scan: pieces of decoded records, and numbers that are looked through; about 20 MB."""
NAMES = ("xyz", "rgb", "intensity", "classification")
SCRIPT = """
import json, sys
import pointglass
points = pointglass.open(sys.argv[1]).points
def of(some, name):
    return some["rgb"] if name == "file's rgb" else getattr(some, name)
for name in sys.argv[2:]:
    of(points[:: len(points) // 20], name)
    of(points[:10], name)
def status(key):
    return next(int(line.split()[1]) * 1024 for line in open("/proc/self/status") if line.startswith(key))
found = {}
for name in sys.argv[2:]:
    open("/proc/self/clear_refs", "w").write("5")  # the peak is measured from here
    before = status("VmRSS")
    result = of(points, name)
    found[name] = [status("VmHWM") - before, result.nbytes]
    del result
print(json.dumps([points.note, found]))
"""


def written(path, suffix: str):
    rng = np.random.default_rng(1)
    xyz = np.round(rng.random((COUNT, 3)) * (20, 15, 4), 3)
    rgb = np.repeat(rng.integers(0, 256, (COUNT // 100, 3)), 100, 0).astype(np.uint8)
    intensity = np.arange(COUNT) // 50 % 4096
    if suffix == "e57":
        return write_e57(path, [E57Scan(xyz, rgb, intensity / 4096, kind="float")])
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.add_extra_dims([laspy.ExtraBytesParams(name, "float64") for name in ("one", "two", "three")])
    header.scales = np.full(3, 1e-3)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rgb.T.astype(np.uint16) * 257
    las.intensity, las.classification = intensity, np.arange(COUNT) // 1000 % 20
    las.gps_time = np.arange(COUNT) / 1e4
    las.write(str(path))
    return path


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak is read from /proc")
@pytest.mark.parametrize("suffix", ["laz", "e57"])
def test_reading_every_point_takes_little_more_than_the_result(tmp_path, monkeypatch, suffix):
    path = written(tmp_path / f"a.{suffix}", suffix)
    names = [name for name in (*NAMES, "file's rgb") if suffix != "e57" or name != "classification"]
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    open_scene(path)  # builds the grid
    command = [sys.executable, "-c", SCRIPT, str(path), *names]
    done = subprocess.run(command, env=os.environ | {"MALLOC_ARENA_MAX": "1"}, check=True, capture_output=True, text=True)
    note, found = json.loads(done.stdout.splitlines()[-1])
    assert note is None and set(found) == set(names)
    for name, (peak, held) in found.items():
        assert peak <= held + COUNT // 2 + BESIDE, (name, found)
