"""Scales, offsets and values with which coordinates and attributes overflow are read without a warning of NumPy, in every way
that a file is read; the grid drops points that are no positions."""

import struct
import warnings
from typing import Any

import numpy as np
import pytest
from cloud_files import E57Scan, edited_e57, surface, write_e57, write_las, write_ply

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.formats import open_source

COUNT = 300


def e57(folder, **scan):
    """The scale that the XML declares, replaced by 1e308."""
    xyz, rgb = surface(COUNT, origin=(1, 1, 1))
    path = write_e57(folder / "a.e57", [E57Scan(xyz, rgb, np.linspace(0, 1, COUNT), kind="scaled", **scan)])
    return edited_e57(path, (rb'scale="[^"]*"', b'scale="1e308" offset="-1e308"'))


def las(folder, suffix="las"):
    """Coordinates and an extra dimension."""
    import laspy

    header = laspy.LasHeader(point_format=7, version="1.4")
    header.add_extra_dim(laspy.ExtraBytesParams("ring", "i4", scales=np.array([1e308]), offsets=np.array([-1e308])))
    header.scales, header.offsets = np.full(3, 1e305), np.full(3, 1e308)
    points: Any = laspy.ScaleAwarePointRecord.zeros(COUNT, header=header)
    for name in ("X", "Y", "Z", "ring"):
        points.array[name] = np.arange(COUNT) * 7_000_001
    with np.errstate(all="ignore"), laspy.open(folder / f"a.{suffix}", mode="w", header=header) as writer:
        writer.write_points(points)
    return folder / f"a.{suffix}"


def text(folder):
    rows = [f"{x}e300 {x} 1e{x} 1e308 -1e308 5" for x in range(COUNT)]
    (folder / "a.csv").write_text("x y z intensity scan_angle classification\n" + "\n".join(rows) + "\n")
    return folder / "a.csv"


def ply(folder, order):
    xyz, rgb = surface(COUNT)
    xyz[::2] = 1.7e308
    xyz[::3] = -1.7e308
    return write_ply(folder / "a.ply", xyz, np.where(rgb > 100, 1e308, -1e308), colour="double", order=order)


MADE = {
    "e57 scaled": e57,
    "e57 scaled, limits": lambda folder: e57(folder, limits=False),
    "e57 spherical": lambda folder: e57(folder, spherical=True),
    "las": las,
    "laz": lambda folder: las(folder, "laz"),
    "las header": lambda folder: _header(write_las(folder / "a.las", *surface(COUNT))),
    "text": text,
    "ply": lambda folder: ply(folder, "binary_little_endian"),
    "ply ascii": lambda folder: ply(folder, "ascii"),
}


def _header(path):
    data = bytearray(path.read_bytes())
    struct.pack_into("<6d", data, 131, *[1e306] * 3, *[-1.7e308] * 3)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", MADE)
def test_overflowing_values_give_no_warning_of_numpy(tmp_path, name):
    path = MADE[name](tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        source = open_source(path)
        for chunk in source.sample(500, 16) or ():
            assert chunk.xyz.dtype == np.float64
        count = sum(len(chunk.xyz) for chunk in source.chunks())
        assert count == sum(len(records.xyz) for records in source.record_chunks())
        assert len(source.records(np.array([0, count - 1])).xyz) == 2
        try:
            scene = open_scene(path, cache=False)
        except InputError as error:
            assert "too far from zero" in str(error) or "none of its" in str(error) or "cannot hold" in str(error)
        else:
            assert np.isfinite(scene.bounds).all()
