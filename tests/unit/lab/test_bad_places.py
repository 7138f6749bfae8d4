"""Invalid training data: each is refused in one line that names the file, before any training."""

import json
import re
import shutil
import struct

import numpy as np
import pytest
from PIL import Image
from rooms import make_room
from scannetpp_files import write_scannetpp
from test_rgbd import PLAIN, write_nerfstudio, write_scannet, write_tum

from pointglass.model.common.errors import DataError
from pointglass.model.data.images.rgbd import load_rgbd
from pointglass.model.data.images.scannetpp import load_scannetpp, scenes
from pointglass.model.data.stations import load_scene

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    root = tmp_path_factory.mktemp("good")
    make_room(root / "room")
    write_nerfstudio(root / "rgbd", PLAIN)
    write_tum(root / "tum")
    write_scannet(root / "scannet")
    write_scannetpp(root / "plus")
    return root


def _refused(load, said):
    with pytest.raises(DataError, match=said) as caught:
        load()
    assert "\n" not in str(caught.value)


def _changed(path, change):
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


def _face(key, value):
    return lambda data: data["stations"][0]["faces"][0].update({key: value})


@pytest.mark.parametrize(("change", "said"), [
    (_face("fl", 0), "fl 0: not a valid camera"), (_face("fl", float("nan")), "fl nan"), (_face("fl", -24.0), "fl -24"),
    (_face("w", 0), "0x48 pixels"), (_face("fl", 25.0), "one size and focal length"),
    (_face("camera_to_world", [[float("nan")] * 4] * 4), "not a rotation"),
    (_face("camera_to_world", [[0] * 4] * 4), "not a rotation"),
    (_face("camera_to_world", (np.eye(4) + 1e300 * np.eye(4, k=3)).tolist()), "not a rotation"),
    (_face("camera_to_world", [[10**400] * 4] * 4), "not a scene description"),
    (_face("rgb", "x" * 5000), "cannot be read"), (_face("fl", 1e300), "not a valid camera"),
    (_face("camera_to_world", [1, 2]), "not a scene description"), (_face("rgb", 5), "5 is missing"),
    (lambda data: data.update(depth_scale=0), "depth_scale 0"),
    (lambda data: data.update(stations=[]), "stations with 6 faces"),
    (lambda data: data["stations"][1]["faces"].pop(), "stations with 6 faces"),
])
def test_an_invalid_scene_is_refused_by_name(good, tmp_path, change, said):
    room = shutil.copytree(good / "room", tmp_path / "room")
    _changed(room / "scene.json", change)
    _refused(lambda: load_scene(room), said)


@pytest.mark.parametrize("made", [lambda grey: grey.convert("RGB"), lambda grey: grey.convert("L").convert("P"),
                                  lambda grey: grey.convert("L").convert("LA")])  # fmt: skip
def test_a_depth_picture_of_colours_is_refused_by_name(good, tmp_path, made):
    room, frames = (shutil.copytree(good / name, tmp_path / name) for name in ("room", "rgbd"))
    for path in (room / "v2.depth.png", frames / "depth" / "003.png"):
        made(Image.fromarray(np.zeros(np.asarray(Image.open(path)).shape, np.uint8))).save(path)
    _refused(lambda: load_scene(room), r"v2\.depth\.png is not a depth picture")
    _refused(lambda: load_rgbd(frames), r"depth/003\.png is not a depth picture")


@pytest.mark.parametrize("array", [np.zeros((60, 80), complex), np.zeros((0, 80), np.float32), np.zeros((60, 80, 3))])
def test_an_array_without_depth_is_refused_by_name(good, tmp_path, array):
    frames = shutil.copytree(good / "rgbd", tmp_path / "rgbd")
    np.save(frames / "depth" / "000.npy", array)
    _changed(frames / "transforms.json", lambda data: data["frames"][0].update(depth_file_path="depth/000.npy"))
    _refused(lambda: load_rgbd(frames), r"depth/000\.npy")


def test_poses_that_are_not_finite_are_refused(good, tmp_path):
    frames = shutil.copytree(good / "tum", tmp_path / "tum")
    path = frames / "groundtruth.txt"
    path.write_text("\n".join(line if k != 3 else f"{line.split()[0]} nan 0 0 0 0 0 1"
                              for k, line in enumerate(path.read_text().splitlines())))  # fmt: skip
    _refused(lambda: load_rgbd(frames), r"groundtruth\.txt: expected")


HEAD = ["ply", "format binary_little_endian 1.0", "element vertex 1"]
COLOURED = [*HEAD, *(f"property float {name}" for name in ("x", "y", "z", "red", "green", "blue"))]


@pytest.mark.parametrize("lines", [
    ["ply", "format"], [*HEAD[:2], "element vertex"], [*HEAD[:2], "element vertex x"], [*HEAD[:2], "element vertex -5"],
    [*HEAD, "property list uchar int x"], [*COLOURED, "element face 1", "property list foo int v"],
    [*COLOURED, "element face 1", "property list uchar int"], ["ply", *["comment"] * 300],
])
def test_an_empty_ply_header_is_refused(good, tmp_path, lines):
    root = shutil.copytree(good / "plus", tmp_path / "plus")
    path = root / "data" / "aa11bb22cc" / "scans" / "pc_aligned.ply"
    path.write_bytes("\n".join([*lines, "end_header\n"]).encode() + bytes(100))
    _refused(lambda: load_scannetpp(root, "aa11bb22cc"), r"pc_aligned\.ply")


@pytest.mark.parametrize(("name", "text", "said"), [
    ("train_test_lists.json", '{"test": 5}', "test is not a list"),
    ("nerfstudio/transforms.json", '{"frames": 5}', "frames is not a list"),
    ("nerfstudio/transforms.json", '{"frames": [{"file_path": 5}]}', "without file_path"),
])
def test_invalid_lists_are_refused(good, tmp_path, name, text, said):
    root = shutil.copytree(good / "plus", tmp_path / "plus")
    (root / "data" / "aa11bb22cc" / "dslr" / name).write_text(text)
    _refused(lambda: load_scannetpp(root, "aa11bb22cc"), said)
    (root / "splits" / "nvs_sem_train.txt").write_bytes(b"\xff\xfe")
    _refused(lambda: scenes(root, "train"), "not a list of scenes")


def test_deeply_nested_json_is_refused(good, tmp_path):
    """The JSON reader raises RecursionError, which is not a ValueError."""
    room, frames, plus = (shutil.copytree(good / name, tmp_path / name) for name in ("room", "rgbd", "plus"))
    home = plus / "data" / "aa11bb22cc" / "dslr"
    for path, load in ((room / "scene.json", lambda: load_scene(room)), (frames / "transforms.json", lambda: load_rgbd(frames)),
                       (home / "train_test_lists.json", lambda: load_scannetpp(plus, "aa11bb22cc"))):  # fmt: skip
        path.write_text("[" * 200_000)
        _refused(load, re.escape(f"{path}: not "))


@pytest.mark.parametrize("text", ["", "# none\n", "1 2 3\n", "1 0 0 1e300\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", None])
def test_a_file_without_a_pose_is_refused_without_warnings(good, tmp_path, text, recwarn):
    frames = shutil.copytree(good / "scannet", tmp_path / "scannet")
    path = frames / "pose" / "7.txt"
    path.unlink()
    if text is None:
        path.mkdir()
    else:
        path.write_text(text)
    _refused(lambda: load_rgbd(frames), re.escape(f"{path}: "))
    assert [str(warning.message) for warning in recwarn] == []


@pytest.mark.parametrize("text", ["1e300 55 41 29", "55 55 41 -1e300", "", "0 0 0 0"])
def test_invalid_intrinsics_are_refused_by_name(good, tmp_path, text):
    frames = shutil.copytree(good / "tum", tmp_path / "tum")
    (frames / "calibration.txt").write_text(text)
    _refused(lambda: load_rgbd(frames), r"calibration\.txt: ")


def test_points_with_invalid_positions_are_left_out(good, tmp_path, recwarn):
    root = shutil.copytree(good / "plus", tmp_path / "plus")
    path = root / "data" / "aa11bb22cc" / "scans" / "pc_aligned.ply"
    data = bytearray(path.read_bytes())
    begin = data.index(b"end_header\n") + 11
    struct.pack_into("<3f", data, begin, 3e38, 0, 0)
    struct.pack_into("<I", data, begin + 15, 0x7F800001)  # a signalling NaN
    path.write_bytes(data)
    assert len(load_scannetpp(root, "aa11bb22cc").scan(0).xyz) == 60_000 - 2
    assert [str(warning.message) for warning in recwarn] == []
