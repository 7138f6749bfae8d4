"""Every camera format puts a known world point in the known pixel, and every bad file is one line."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from viewer.camera import from_fov, look_at
from viewer.errors import InputError
from viewer.tools.camera_files import read_cameras, write_camera_path

# A camera at (1, 2, 3) looking along world +x, world z up: right is -y.  OpenGL camera axes in columns.
POSE = np.array([[0.0, 0, -1, 1], [-1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]])
POINT = np.array([6.0, 1.5, 3.25])  # 5 ahead, 0.5 right, 0.25 up


def pixel(camera, point):
    """Independent of the renderer: OpenGL camera axes, y up."""
    x, y, z = (np.linalg.inv(camera.camera_to_world) @ [*point, 1])[:3]
    return camera.fx * x / -z + camera.cx, camera.cy - camera.fy * y / -z


def assert_right(camera, fx=100.0, size=(80, 60)):
    assert (camera.width, camera.height) == size
    assert pixel(camera, POINT) == pytest.approx((size[0] / 2 + fx * 0.1, size[1] / 2 - fx * 0.05))
    assert camera.position == pytest.approx([1, 2, 3]) and camera.forward == pytest.approx([1, 0, 0])


def transforms(**changes):
    return {"fl_x": 100, "fl_y": 100, "cx": 40, "cy": 30, "w": 80, "h": 60, "k1": 0.0,
            "frames": [{"file_path": "./images/one.jpg", "transform_matrix": POSE.tolist()}], **changes}


def opencv_quaternion():
    """w, x, y, z of the world-to-camera rotation with OpenCV axes."""
    r = np.diag([1, -1, -1]) @ POSE[:3, :3].T
    w = np.sqrt(max(0, 1 + np.trace(r))) / 2
    if w > 1e-6:
        return np.array([w, (r[2, 1] - r[1, 2]) / (4 * w), (r[0, 2] - r[2, 0]) / (4 * w), (r[1, 0] - r[0, 1]) / (4 * w)]), r
    raise AssertionError("pick another pose")


def write_colmap(folder, camera="1 PINHOLE 80 60 100 100 40 30", second=""):
    q, r = opencv_quaternion()
    t = -r @ POSE[:3, 3]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cameras.txt").write_text(f"# comment\n{camera}\n")
    line = " ".join(map(str, [7, *q, *t, 1, "rooms/one.jpg"]))
    (folder / "images.txt").write_text(f"# comment\n{line}\n{second}\n{line}\n1.0 2.0 -1\n")
    return folder


def test_transforms_json(tmp_path):
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(transforms()))
    [camera] = read_cameras(path)
    assert_right(camera)
    assert camera.name == "one"
    [half] = read_cameras(path, size=(40, 30))
    assert_right(half, 50.0, (40, 30))


def test_transforms_json_with_one_lens_a_frame_and_field_of_view(tmp_path):
    path = tmp_path / "transforms.json"
    frame = {"file_path": "a", "transform_matrix": POSE.tolist(), "camera_angle_x": 2 * np.arctan(0.4), "w": 80, "h": 60}
    path.write_text(json.dumps({"frames": [frame, {**frame, "fl_x": 50.0}]}))
    wide, wider = read_cameras(path)
    assert_right(wide)
    assert wider.fx == wider.fy == 50 and wider.name == "a_2"


def test_camera_path_json(tmp_path):
    path = tmp_path / "camera_path.json"
    fov = 2 * np.degrees(np.arctan(0.3))
    path.write_text(json.dumps({"render_width": 80, "render_height": 60, "camera_path": [
        {"camera_to_world": POSE.ravel().tolist(), "fov": fov, "aspect": 80 / 60}]}))
    [camera] = read_cameras(path)
    assert_right(camera)
    assert camera.name == "frame_00000"


@pytest.mark.parametrize("second", ["", "10.5 3.2 77 11.0 4.0 -1"])
@pytest.mark.parametrize("give", ["", "images.txt", "cameras.txt"])
def test_colmap(tmp_path, second, give):
    folder = write_colmap(tmp_path / "model", second=second)
    cameras = read_cameras(folder / give if give else folder)
    assert [c.name for c in cameras] == ["one", "one_2"]
    assert_right(cameras[0])


@pytest.mark.parametrize("intrinsics", ["100 100 40 30 80 60", "100 0 40\n0 100 30\n0 0 1\n80 60", "100 100 40 30"])
def test_tum(tmp_path, intrinsics):
    q, _ = opencv_quaternion()
    w, x, y, z = q * [1, -1, -1, -1]  # camera to world
    path = tmp_path / "trajectory.txt"
    path.write_text(f"# time tx ty tz qx qy qz qw\n1305031102.175 1 2 3 {x} {y} {z} {w}\n")
    (tmp_path / "intrinsics.txt").write_text(intrinsics)
    [camera] = read_cameras(path)
    assert_right(camera)
    assert camera.name == "1305031102.175"


@given(st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3, *[st.floats(-1, 1)] * 3, st.floats(2, 170)), min_size=1, max_size=4))
@settings(max_examples=40, deadline=None)
def test_camera_path_there_and_back(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("path") / "camera_path.json"
    cameras = [from_fov(97, 61, fov, look_at((x, y, z), (x + a, y + b, z + c + 2)), f"shot{n}")
               for n, (x, y, z, a, b, c, fov) in enumerate(values)]
    write_camera_path(path, cameras)
    for before, after in zip(cameras, read_cameras(path), strict=True):
        assert after.name == before.name and (after.width, after.height) == (97, 61)
        assert np.allclose(after.camera_to_world, before.camera_to_world, atol=1e-9) and after.fy == pytest.approx(before.fy)


@pytest.mark.parametrize("data, said", [
    ("{not json", "not JSON"),
    ({"images": []}, "neither a transforms.json"),
    (transforms(frames=[]), "holds no cameras"),
    (transforms(k2=0.1), r"frame 0 \(one\): distortion k2 = 0.1"),
    (transforms(camera_model="OPENCV_FISHEYE"), "OPENCV_FISHEYE"),
    (transforms(w="wide"), "w: expected 1 numbers"),
    (transforms(frames=[{"file_path": "x"}]), "transform_matrix"),
    (transforms(frames=[{"transform_matrix": [[float("nan")] * 4] * 4}]), "not finite"),
    (transforms(frames=[{"transform_matrix": [[0.0] * 4] * 4}]), "singular"),
    (transforms(frames=[3]), "frame 0 is not an object"),
    (transforms(fl_x=-4), "focal length"),
    ({"camera_path": [{"camera_to_world": [1, 2, 3], "fov": 50}], "render_height": 3}, "expected 16 numbers, got 3"),
    ({"camera_path": [{"camera_to_world": POSE.ravel().tolist(), "fov": 190}], "render_height": 60}, "fov 190"),
    ({"camera_path": [{"camera_to_world": POSE.ravel().tolist(), "fov": 50}]}, "--size"),
])
def test_bad_json_is_one_line(tmp_path, data, said):
    path = tmp_path / "cameras.json"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    with pytest.raises(InputError, match=said) as caught:
        read_cameras(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_bad_colmap_and_tum_are_one_line(tmp_path):
    with pytest.raises(InputError, match="OPENCV_FISHEYE"):
        read_cameras(write_colmap(tmp_path / "a", "1 OPENCV_FISHEYE 80 60 100 100 40 30 0 0 0 0"))
    with pytest.raises(InputError, match=r"distortion \[0.1\]"):
        read_cameras(write_colmap(tmp_path / "b", "1 SIMPLE_RADIAL 80 60 100 40 30 0.1"))
    with pytest.raises(InputError, match="camera 1 is not in"):
        read_cameras(write_colmap(tmp_path / "c", "2 PINHOLE 80 60 100 100 40 30"))
    (tmp_path / "a" / "cameras.txt").unlink()
    with pytest.raises(InputError, match=r"cameras\.txt: no such file"):
        read_cameras(tmp_path / "a")
    with pytest.raises(InputError, match=r"no cameras\.txt"):
        read_cameras(tmp_path)
    path = tmp_path / "walk.txt"
    path.write_text("1 0 0 0 0 0 0 1\n")
    with pytest.raises(InputError, match=r"add intrinsics\.txt"):
        read_cameras(path)
    (tmp_path / "intrinsics.txt").write_text("100 100 40 30 80 60")
    path.write_text("1 0 0 0 0 0 0 0\n")
    with pytest.raises(InputError, match="line 1: the quaternion is zero"):
        read_cameras(path)
    path.write_text("1 0 0 0\n")
    with pytest.raises(InputError, match="expected `time tx ty tz"):
        read_cameras(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        read_cameras(path)


def test_names_cannot_leave_the_folder(tmp_path):
    path = tmp_path / "camera_path.json"
    frame = {"camera_to_world": POSE.ravel().tolist(), "fov": 50}
    path.write_text(json.dumps({"render_width": 80, "render_height": 60, "camera_path": [
        {**frame, "name": "../../etc/x"}, {**frame, "name": ".."}, {**frame, "name": "a b"}, {**frame, "name": "a_b"}]}))
    names = [c.name for c in read_cameras(path)]
    assert len(set(names)) == 4 and not any("/" in n or n.startswith(".") for n in names)
