"""A PLY of Gaussian splats opens as points with its own colours, said to be splats; ours lie where the scan was."""

import numpy as np
import pytest
from plyfile import PlyData, PlyElement

from pointglass.viewer.cli import main
from pointglass.viewer.commands.exporting.command import export
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.edits import NO_EDITS
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.work.selection import Selection

SH0 = 0.28209479177387814
NAMES = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *(f"f_rest_{i}" for i in range(45)), "opacity",
         *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]  # fmt: skip


def trained(path, rng, count=5000, text=False):
    """A file as training writes it, by plyfile: (centres, sRGB 0..1, opacity)."""
    rows = np.zeros(count, [(name, "f4") for name in NAMES])
    for name in NAMES:
        rows[name] = rng.normal(size=count)
    for axis in "xyz":
        rows[axis] = rng.random(count) * 10
    PlyData([PlyElement.describe(rows, "vertex")], text=text).write(path)
    xyz = np.stack([rows[axis] for axis in "xyz"], axis=1).astype(float)
    rgb = np.clip(0.5 + SH0 * np.stack([rows[f"f_dc_{i}"] for i in range(3)], axis=1).astype(float), 0, 1)
    return xyz, rgb, 1 / (1 + np.exp(-rows["opacity"].astype(float)))


@pytest.mark.parametrize("text", [False, True])
def test_a_trained_file_is_its_centres_in_base_colours_without_the_transparent_ones(tmp_path, seed, capsys, text):
    path = tmp_path / "room.ply"
    xyz, rgb, opacity = trained(path, np.random.default_rng(seed), text=text)
    shown = opacity >= 0.1
    source = open_source(path)
    chunks = list(source.chunks())
    assert np.allclose(np.concatenate([chunk.xyz for chunk in chunks]), xyz[shown], atol=1e-5)
    assert np.abs(np.concatenate([chunk.rgb for chunk in chunks]) - rgb[shown] * 255).max() <= 0.501
    numbers = np.sort(np.random.default_rng(seed).choice(shown.sum(), 20, replace=False))
    assert np.allclose(source.records(numbers).xyz, xyz[shown][numbers], atol=1e-5)
    assert main(["info", str(path), "--no-cache"]) == 0
    said = capsys.readouterr().out
    assert "PLY of Gaussian splats" in said and "shown as points" in said
    assert f"{(~shown).sum():,} splats of opacity below 0.1 left out" in said


def test_a_file_of_ours_lies_where_the_scan_was(tmp_path, seed):
    import laspy

    rng = np.random.default_rng(seed)
    las = laspy.LasData(laspy.LasHeader(point_format=2))
    las.header.offsets, las.header.scales = [500_000, 5_000_000, 0], [0.001] * 3
    las.x, las.y = rng.random((2, 9000)) * [[8], [4]] + [[500_000], [5_000_000]]
    las.z = np.full(9000, 30.0)
    las.red = las.green = las.blue = np.full(9000, 40_000)
    las.write(tmp_path / "a.las")
    scan = open_scene(tmp_path / "a.las", cache=False)
    export(Selection.in_sight(scan, NO_EDITS), tmp_path / "b.ply", splats=True, budget=2000)
    scene = open_scene(tmp_path / "b.ply", cache=False)
    xyz, rgb, *_ = unpack(scene)
    assert (xyz >= [499_999.99, 4_999_999.99, 29.99]).all() and (xyz <= [500_008.01, 5_000_004.01, 30.01]).all()
    assert np.ptp(xyz, axis=0)[0] > 7.8 and np.abs(rgb - 40_000 / 257).max() < 1
    assert not [text for text in scene.meta.warning_texts if "shown as points" not in text]
    said: list[str] = []
    assert export(Selection.in_sight(scene, NO_EDITS), tmp_path / "c.laz", note=said.append) == len(xyz)
    written = set(laspy.read(tmp_path / "c.laz").point_format.dimension_names)
    assert "f_dc_0" in written and not {"nx", "scale_0", "rot_0"} & written  # these are in the file's axes
    assert "b.ply: normals, sizes and directions of its splats" in said[0] and "number of points of each" in said[0]
    count = export(Selection.in_sight(scene, NO_EDITS), tmp_path / "d.glb", budget=1000, note=said.append)
    assert f"splats are made anew from the centres of splats: {len(xyz):,} become {count:,}" in said[1] and "\n" not in said[1]
    assert f'"{len(xyz)} centres of splats"'.encode() in (tmp_path / "d.glb").read_bytes()


def test_a_comment_that_is_no_matrix_is_passed_over(tmp_path, seed):
    path = tmp_path / "a.ply"
    xyz, *_ = trained(path, np.random.default_rng(seed), count=50)
    data = path.read_bytes()
    huge = b"comment frame " + b"1e300 3e200 1 " * 4 + b"\n"
    for text in (huge, b"comment frame 1 2 three\n", b"comment frame " + b"nan " * 12 + b"\n", b"comment frame\n"):
        path.write_bytes(data.replace(b"element", text + b"element", 1))
        assert np.isin(np.concatenate([chunk.xyz for chunk in open_source(path).chunks()]), xyz.astype(np.float32)).all()
