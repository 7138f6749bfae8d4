"""Camera files that look readable and are not what they seem: refused in one line, never drawn wrongly."""

import json
import re
import warnings

import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.work.cameras.camera_files import read_cameras

POSE = [[1, 0, 0, 2.0], [0, 0, -1, 0.5], [0, 1, 0, 1.4], [0, 0, 0, 1]]


def transforms(*frames, **changes):
    frames = frames or ({},)
    pictures = [{"file_path": "one.jpg", "transform_matrix": POSE, **frame} for frame in frames]
    return {"fl_x": 100, "w": 80, "h": 60, "frames": pictures, **changes}


def write(folder, data):
    path = folder / "transforms.json"
    path.write_text(json.dumps(data))
    return path


def refused(path, said):
    """The one line that a file is refused with."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=said) as caught:
            read_cameras(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("distortion", [{"k1": 0.3}, 0.3, "k1=0.3", "0.3", True, [[0.3, 0]], {"k1": "0.3"}])
def test_distortion_is_refused_whatever_its_shape(tmp_path, distortion):
    for data in (transforms(distortion_params=distortion), transforms({"distortion_params": distortion})):
        path = write(tmp_path, data)
        assert refused(path, "distortion_params").startswith(f"{path}: frame 0 (one): ")


@pytest.mark.parametrize("key", ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"])
def test_distortion_is_refused_whatever_its_order(tmp_path, key):
    assert len(read_cameras(write(tmp_path, transforms(**{key: 0})))) == 1
    refused(write(tmp_path, transforms({}, {key: -1e-4})), f"frame 1 .*: distortion {key} = -0.0001")


@pytest.mark.parametrize("distortion", [None, [], {}, 0, [0, 0.0], {"k1": 0, "k2": 0.0}])
def test_no_distortion_is_read(tmp_path, distortion):
    assert len(read_cameras(write(tmp_path, transforms(distortion_params=distortion)))) == 1


@pytest.mark.parametrize("key", ["fl_x", "fl_y"])
@pytest.mark.parametrize("value", [1e300, 1e30, 1e16, 1e-30, 1e-14, 0, -3.0])
def test_a_focal_length_no_picture_can_be_made_with_is_refused(tmp_path, key, value):
    path = write(tmp_path, transforms({}, {key: value}))
    axis = {"fl_x": "fx", "fl_y": "fy"}[key]
    line = refused(path, rf"{axis} {re.escape(str(float(value)))}: .*focal length")
    assert line.startswith(f"{path}: frame 1 (one): ")


def test_long_and_short_lenses_are_read(tmp_path):
    lenses = [{"fl_x": 80 / 2e-5, "fl_y": 60 / 2e-5}, {"fl_x": 0.01}, {"cx": -4000.0}]
    assert len(read_cameras(write(tmp_path, transforms(*lenses)))) == 3


@pytest.mark.parametrize("key", ["fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "camera_angle_x"])
@pytest.mark.parametrize("value", [True, [40], "40", None, {}])
def test_what_is_no_number_is_not_taken_for_one(tmp_path, key, value):
    data = transforms(**{key: value})
    if key == "camera_angle_x":
        del data["fl_x"]
    refused(write(tmp_path, data), f"{key}: expected a number, got")


@pytest.mark.parametrize("value", [True, "1", [1], None])
def test_a_matrix_holds_numbers_only(tmp_path, value):
    pose = [list(row) for row in POSE]
    pose[0][0] = value
    refused(write(tmp_path, transforms({"transform_matrix": pose})), "transform_matrix: expected 16 numbers, got")


def test_places_beyond_all_places_are_refused(tmp_path):
    refused(write(tmp_path, transforms(cx=1e30)), r"cx 1e\+30: the principal point is too far")
    pose = [list(row) for row in POSE]
    pose[1][3] = 1e300
    refused(write(tmp_path, transforms({"transform_matrix": pose})), r"position .*1e\+300.* is farther from zero")


def test_a_size_is_shown_as_it_was_written(tmp_path):
    (tmp_path / "walk.txt").write_text("1 0 0 0 0 0 0 1\n")
    (tmp_path / "intrinsics.txt").write_text("100 100 40 30 160.5 60")
    assert "width 160.5: expected" in refused(tmp_path / "walk.txt", "width")


def write_model(folder, cameras):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cameras.txt").write_text(cameras)
    (folder / "images.txt").write_text("1 1 0 0 0 0 0 0 1 one.jpg\n\n")
    return folder


def test_a_colmap_camera_with_two_lenses_is_refused(tmp_path):
    lens = "1 PINHOLE 80 60 100 100 40 30\n"
    assert len(read_cameras(write_model(tmp_path, lens + lens))) == 1
    write_model(tmp_path, f"{lens}1 PINHOLE 80 60 50 50 40 30\n")
    assert refused(tmp_path, "camera 1 is there already").startswith(f"{tmp_path / 'cameras.txt'}: line 2: ")


@pytest.mark.parametrize("given, made", [
    ("a a a_2", "a a_3 a_2"), ("a_2 a a", "a_2 a a_3"), ("a a a a_3 a_2", "a a_4 a_5 a_3 a_2"),
    ("a A a_2 A_2", "a A_3 a_2 A_2_2"),
])
def test_only_repeated_names_are_changed(tmp_path, given, made):
    path = write(tmp_path, transforms(*({"file_path": f"{name}.jpg"} for name in given.split())))
    assert [camera.name for camera in read_cameras(path)] == made.split()
