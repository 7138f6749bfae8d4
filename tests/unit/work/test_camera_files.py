"""Every camera format puts a known world point in the known pixel, and every bad file is one line."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.camera import Camera, from_fov, look_at
from pointglass.viewer.work.cameras.camera_files import read_cameras, write_camera_path

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


PICTURE = {"file_path": "./images/one.jpg", "transform_matrix": POSE.tolist()}


def transforms(**changes):
    return {"fl_x": 100, "fl_y": 100, "cx": 40, "cy": 30, "w": 80, "h": 60, "k1": 0.0,
            "frames": [PICTURE], **changes}


def shots(*changes, **shared):
    frame = {"camera_to_world": POSE.ravel().tolist(), "fov": 50}
    return {"render_width": 80, "render_height": 60, "camera_path": [{**frame, **c} for c in changes], **shared}


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


def test_each_angle_of_view_spans_its_own_side(tmp_path):
    path = tmp_path / "transforms.json"
    angles = {"camera_angle_x": 2 * np.arctan(0.4), "camera_angle_y": 2 * np.arctan(0.6)}
    path.write_text(json.dumps({**angles, "w": 80, "h": 60, "frames": [PICTURE]}))
    [camera] = read_cameras(path)
    assert (camera.fx, camera.fy) == pytest.approx((100, 50))


def test_a_camera_path_without_a_width_takes_it_from_the_aspect(tmp_path):
    path = tmp_path / "camera_path.json"
    data = shots({"aspect": 1.5}, {})
    del data["render_width"]
    path.write_text(json.dumps(data))
    assert [(camera.width, camera.height) for camera in read_cameras(path)] == [(90, 60), (60, 60)]


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
    ({}, r"keys \(none\)"),
    (transforms(frames=[]), "holds no cameras"),
    (transforms(k2=0.1), r"frame 0 \(one\): distortion k2 = 0.1"),
    (transforms(camera_model="OPENCV_FISHEYE"), "OPENCV_FISHEYE"),
    (transforms(w="wide"), "w: expected a number, got wide"),
    (transforms(frames=[{"file_path": "x"}]), "transform_matrix"),
    (transforms(frames=[{"transform_matrix": [[float("nan")] * 4] * 4}]), "not finite"),
    (transforms(frames=[{"transform_matrix": np.diag([0.0, 0, 0, 1]).tolist()}]), "singular"),
    (transforms(frames=[3]), "frame 0 is not an object: 3"),
    (transforms(fl_x=-4), "focal length"),
    ({"camera_path": [{"camera_to_world": [1, 2, 3], "fov": 50}], "render_height": 3}, "expected 16 numbers, got 3"),
    ({"camera_path": [{"camera_to_world": POSE.ravel().tolist(), "fov": 190}], "render_height": 60}, "fov 190"),
    ({"camera_path": [{"camera_to_world": POSE.ravel().tolist(), "fov": 50}]}, "--size"),
    ({**shots({}), "camera_type": "equirectangular"}, r"frame 0 \(frame_00000\): camera_type equirectangular"),
    (shots({"camera_to_world": POSE.T.ravel().tolist()}), "its last row is .1.0, 2.0, 3.0, 1.0., expected 0, 0, 0, 1"),
    (shots({"fov": 1e-320}), "focal length"),
    (shots({"fov": float("nan"), "name": "a\nb\u2028c"}), r"frame 0 \(a b c\): fov: holds a value that is not finite"),
    (transforms(w=80.5), "width 80.5"),
    (transforms(w=10**400), "w: expected a number"),
    (transforms(is_fisheye=True), "is_fisheye true"),
    (transforms(distortion_params=[0, 0.25]), r"distortion_params \[0, 0.25\]"),
    (transforms(frames=[{**PICTURE, "k1": -0.5}]), r"frame 0 \(one\): distortion k1 = -0.5"),
    (transforms(frames=[PICTURE, {**PICTURE, "transform_matrix": None}]), r"frame 1 \(one\): transform_matrix: expected 16"),
    ({"w": 8, "h": 6, "camera_angle_x": 0, "frames": [PICTURE]}, "camera_angle_x 0: expected radians"),
    ({"w": 8, "h": 6, "frames": [PICTURE]}, "neither fl_x nor camera_angle_x"),
    ({"fl_x": 8, "frames": [PICTURE]}, "w is missing"),
    ("[" * 100_000, "not JSON"),
    ("[1, 2]", "neither a transforms.json"),
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
    with pytest.raises(InputError, match=r"line 1 \(1\): the quaternion .* is zero"):
        read_cameras(path)
    path.write_text("1 0 0 0\n")
    with pytest.raises(InputError, match="expected `time tx ty tz"):
        read_cameras(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        read_cameras(path)


@pytest.mark.parametrize("intrinsics, said", [
    ("100 100 40", "got 3 numbers"), ("100 100 40 30 80 wide", "expected 6 numbers"), ("-100 100 40 30", "fx -100.0"),
    ("100 100 40 30 0.1 0 0 0 0", "not a matrix"), ("100 5 40\n0 100 30\n0 0 1", "not a matrix"),
    ("100 100 -40 30", "width -80"), ("100 100 1e308 30", "out of any picture"), ("100 100 nan 30", "not finite"),
])
def test_bad_intrinsics_are_named_by_their_own_file(tmp_path, intrinsics, said):
    (tmp_path / "walk.txt").write_text("1 0 0 0 0 0 0 1\n")
    (tmp_path / "walk.intrinsics.txt").write_text(intrinsics)
    (tmp_path / "intrinsics.txt").write_text("100 100 40 30")  # the more particular name goes first
    with pytest.raises(InputError, match=said) as caught:
        read_cameras(tmp_path / "walk.txt")
    assert str(caught.value).startswith(f"{tmp_path / 'walk.intrinsics.txt'}: ")


def test_a_trajectory_takes_its_lens_from_colmap_and_its_size_from_the_caller(tmp_path):
    path = tmp_path / "walk.txt"
    path.write_text("\n1.50 1 2 3 0 0 0 2e200\n1.50 1 2 3 0 0 0 1\n")  # a quaternion whose square overflows is no zero
    (tmp_path / "cameras.txt").write_text("3 SIMPLE_PINHOLE 80 60 100 40 30\n")
    one, two = read_cameras(path)
    assert (one.width, one.height, one.fx, one.fy) == (80, 60, 100, 100) and [one.name, two.name] == ["1.50", "1.50_2"]
    assert np.array_equal(one.camera_to_world, two.camera_to_world)
    (tmp_path / "cameras.txt").write_text("3 SIMPLE_PINHOLE 80 60 100 40 30\n4 SIMPLE_PINHOLE 80 60 90 40 30\n")
    with pytest.raises(InputError, match="holds 2 cameras"):
        read_cameras(path)
    (tmp_path / "intrinsics.txt").write_text("100 100 39.5 29.5")
    assert [(c.width, c.height) for c in read_cameras(path)] == [(79, 59)] * 2
    [camera, _] = read_cameras(path, size=(80, 60))
    assert (camera.width, camera.height, camera.fx, camera.cx) == (80, 60, 100, 39.5)


@pytest.mark.parametrize("model", ["SIMPLE_PINHOLE 80 60 100 40 30", "SIMPLE_RADIAL 80 60 100 40 30 0",
                                   "RADIAL 80 60 100 40 30 0 0", "OPENCV 80 60 100 100 40 30 0 0 0 0"])
def test_colmap_lenses_without_distortion(tmp_path, model):
    write_colmap(tmp_path / "sparse" / "0", f"1 {model}")
    for camera in read_cameras(tmp_path):
        assert_right(camera)


def test_colmap_images_without_their_second_line_are_not_lost(tmp_path):
    path = write_colmap(tmp_path) / "images.txt"
    image = path.read_text().splitlines()[1]
    path.write_text(f"{image}\n\n\n{image}\n1 2 -1 3 4 5\n{image}")  # more empty lines, and none at the end
    assert len(read_cameras(path)) == 3
    path.write_text(f"{image}\n{image}\n")
    with pytest.raises(InputError, match=r"images\.txt: line 2: expected the points of the image above"):
        read_cameras(path)
    path.write_text(image.replace(" 1 rooms", " nan rooms"))
    with pytest.raises(InputError, match=r"line 1 \(one\): camera nan is not in"):
        read_cameras(path)
    path.write_text("# nothing\n")
    with pytest.raises(InputError, match="holds no cameras"):
        read_cameras(path)
    for lens, said in [("1 PINHOLE 80 60 100 40 30", "PINHOLE: expected 6 numbers, got 5"),
                       ("1 PINHOLE 80 60 0 100 40 30", "fx 0.0"), ("1 PINHOLE", "expected CAMERA_ID MODEL")]:
        (tmp_path / "cameras.txt").write_text(lens)
        with pytest.raises(InputError, match=rf"cameras\.txt: line 1: .*{said}"):
            read_cameras(tmp_path)


def test_content_decides_where_the_name_does_not(tmp_path):
    path = tmp_path / "path.txt"
    path.write_text("\ufeff" + json.dumps(shots({})), encoding="utf-8")
    assert len(read_cameras(path)) == 1
    with pytest.raises(InputError, match="no such camera file"):
        read_cameras(tmp_path / "missing.json")


def test_an_angle_takes_the_size_asked_for_where_the_file_has_none(tmp_path):
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({"camera_angle_x": 2 * np.arctan(0.4), "frames": [PICTURE]}))
    assert_right(read_cameras(path, size=(80, 60))[0])
    path = tmp_path / "camera_path.json"
    path.write_text(json.dumps({"camera_path": [{**shots({})["camera_path"][0], "fov": 2 * np.degrees(np.arctan(0.3))}]}))
    assert_right(read_cameras(path, size=(80, 60))[0])
    path.write_text(json.dumps(shots({})))
    with pytest.raises(InputError, match=r"at size 0x5: .*width 0"):
        read_cameras(path, size=(0, 5))


@pytest.mark.parametrize("changes, said", [
    ({"width": 81}, "81x60"), ({"fx": 101.0}, "square pixels"), ({"cy": 31.0}, "centred"), ({"cx": 40.01}, "centred"),
])
def test_a_camera_the_path_format_cannot_hold_is_refused(tmp_path, changes, said):
    camera = Camera(80, 60, 100.0, 100.0, 40.0, 30.0, POSE, "one")
    with pytest.raises(InputError, match=said):
        write_camera_path(tmp_path / "path.json", [camera, replace(camera, **changes)])
    with pytest.raises(InputError, match="no cameras to write"):
        write_camera_path(tmp_path / "path.json", [])
    assert not list(tmp_path.iterdir())


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3), max_leaves=6,
)


@given(st.sampled_from([transforms(), shots({"name": "a", "aspect": 1.5})]), st.integers(0, 30), json_values, st.booleans())
@settings(max_examples=300, deadline=None)
def test_any_value_anywhere_is_read_or_refused_in_one_line(tmp_path_factory, good, where, value, sized):
    data = json.loads(json.dumps(good))
    frames = data.get("frames") or data["camera_path"]
    places = [(data, key) for key in data] + [(frames[0], key) for key in [*frames[0], "k1", "camera_model", "camera_type"]]
    holder, key = places[where % len(places)]
    holder[key] = value
    path = tmp_path_factory.mktemp("fuzz") / "cameras.json"
    path.write_text(json.dumps(data))
    try:
        for camera in read_cameras(path, size=(8, 6) if sized else None):
            assert np.isfinite(camera.camera_to_world).all()
    except InputError as error:
        assert str(error).startswith(f"{path}: ") and len(str(error).splitlines()) == 1


def test_names_are_safe_and_unique_as_file_names(tmp_path):
    path = tmp_path / "camera_path.json"
    given = ["../../etc/x", "..", "a b", "a_b", "A_B", "a\\b", "x..y", ".hidden", "\u00e9" * 300, "a/\x00\n", *["same"] * 3000]
    path.write_text(json.dumps(shots(*({"name": name} for name in given))))
    names = [c.name for c in read_cameras(path)]
    assert len({n.casefold() for n in names}) == len(given)
    for name in names:
        assert name and not name.startswith(".") and ".." not in name and not set(name) & set("/\\\0\n ")
        assert len(name.encode()) < 200
    assert names[2:5] == ["a_b", "a_b_2", "A_B_3"] and names[10:12] == ["same", "same_2"]
