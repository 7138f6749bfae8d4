"""Folders and dialects of cameras: nerfstudio's applied transform, layouts of COLMAP, nerfstudio and ScanNet++."""

import json

import numpy as np
import pytest
from test_camera_files import PICTURE, POSE, assert_right, transforms, write_colmap

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.work.cameras.camera_files import read_cameras

TURN = np.array([[0, 1.0, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]])  # as ns-process-data writes it


def write(path, data):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize("turn", [TURN, np.array([[1.0, 0, 0, 5], [0, 0, 1, -2], [0, -1, 0, 1]]), None])
@pytest.mark.parametrize("scale", [None, 0.25, 3.0])
def test_applied_transform_and_scale_are_taken_back_and_named(tmp_path, caplog, turn, scale):
    whole = np.eye(4) if turn is None else np.vstack([turn, [0, 0, 0, 1]])
    pose = whole @ POSE
    pose[:3, 3] *= scale or 1.0
    more = {} if turn is None else {"applied_transform": turn.tolist()}
    more |= {} if scale is None else {"applied_scale": scale}
    path = write(tmp_path / "transforms.json", transforms(frames=[{**PICTURE, "transform_matrix": pose.tolist()}], **more))
    assert_right(read_cameras(path)[0])
    assert ("applied_transform" in caplog.text) == bool(more)


@pytest.mark.parametrize("wrong", [[[1, 0], [0, 1]], "turned", [[0, 0, 0, 0]] * 3, [[1, 0, 0, "x"]] * 3])
def test_an_applied_transform_that_cannot_be_taken_back_is_refused(tmp_path, wrong):
    with pytest.raises(InputError, match="applied_transform"):
        read_cameras(write(tmp_path / "a.json", transforms(applied_transform=wrong)))
    with pytest.raises(InputError, match="applied_scale"):
        read_cameras(write(tmp_path / "a.json", transforms(applied_scale=0)))


@pytest.mark.parametrize("place", ["", "sparse", "sparse/0", "sparse/2", "colmap/sparse/0", "colmap/sparse/1", "colmap",
                                   "dense/sparse", "dense/0/sparse",
                                   "undistorted/sparse", "dslr/colmap", "iphone/colmap"])  # fmt: skip
def test_colmap_models_are_found_where_programs_put_them(tmp_path, place):
    write_colmap(tmp_path / place)
    cameras = read_cameras(tmp_path)
    assert_right(cameras[0])
    assert len(cameras) == 2


@pytest.mark.parametrize("place", ["transforms.json", "nerfstudio/transforms_undistorted.json",
                                   "dslr/nerfstudio/transforms_undistorted.json",
                                   "dslr/nerfstudio/transforms.json"])  # fmt: skip
def test_transforms_are_found_in_a_folder(tmp_path, place):
    write(tmp_path / place, transforms())
    assert_right(read_cameras(tmp_path)[0])


def test_undistorted_cameras_of_scannetpp_come_before_its_fisheye_model(tmp_path):
    write_colmap(tmp_path / "dslr" / "colmap", camera="1 OPENCV_FISHEYE 80 60 100 100 40 30 0.1 0 0 0")
    with pytest.raises(InputError, match="OPENCV_FISHEYE"):
        read_cameras(tmp_path)
    write(tmp_path / "dslr" / "nerfstudio" / "transforms_undistorted.json", transforms())
    assert_right(read_cameras(tmp_path)[0])


def test_a_folder_without_cameras_is_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match=r"no cameras\.txt .* no transforms\.json in this folder"):
        read_cameras(tmp_path)


@pytest.mark.parametrize("model", ["OPENCV", "FULL_OPENCV", "SIMPLE_RADIAL", "RADIAL", "PINHOLE"])
def test_models_with_distortion_of_zero_are_read(tmp_path, model):
    assert_right(read_cameras(write(tmp_path / "a.json", transforms(camera_model=model, k1=0, k2=0.0, p1=0, p2=0)))[0])
    with pytest.raises(InputError, match=r"k2 = 0\.01"):
        read_cameras(write(tmp_path / "a.json", transforms(camera_model=model, k2=0.01)))


def test_intrinsics_of_each_frame_and_sizes_of_pictures_beside_the_file(tmp_path):
    from PIL import Image

    one = {**PICTURE, "file_path": "images/a", "camera_angle_x": float(2 * np.arctan(0.4))}
    two = {**PICTURE, "file_path": "images/b.png", "fl_x": 50, "w": 80, "h": 60}
    (tmp_path / "images").mkdir()
    Image.new("RGB", (80, 60)).save(tmp_path / "images" / "a.png")
    first, second = read_cameras(write(tmp_path / "a.json", {"frames": [one, two]}))
    assert_right(first)
    assert_right(second, fx=50.0)
    (tmp_path / "images" / "a.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="w is missing"):
        read_cameras(tmp_path / "a.json")
