"""Properties of the camera's geometry and of camera files, on random input."""

import json

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.camera import Camera, from_fov, look_at
from pointglass.viewer.work.cameras.camera_files import read_cameras, write_camera_path

seeds = st.integers(0, 2**32 - 1)
sides = st.integers(1, 4000)


def random_rotation(rng) -> np.ndarray:
    """(3, 3), evenly over all rotations."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def random_camera(rng, *, square: bool = False, name: str = "") -> Camera:
    width, height = (int(n) for n in rng.integers(1, 3000, 2))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = random_rotation(rng), rng.normal(size=3) * 10.0 ** rng.uniform(-3, 8)
    if square:
        return from_fov(width, height, float(np.exp(rng.uniform(0, np.log(170)))), pose, name)
    fx, fy = 10.0 ** rng.uniform(-1, 5, 2)
    return Camera(width, height, fx, fy, rng.uniform(-1, 2) * width, rng.uniform(-1, 2) * height, pose, name)


def pixel_of(camera: Camera, view: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(view, -1, 0)
    return np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], -1)


@given(seeds)
@settings(deadline=None)
def test_a_pixels_ray_projects_back_into_the_pixel(seed):
    rng = np.random.default_rng(seed)
    camera = random_camera(rng)
    given = rng.uniform(0, (camera.width, camera.height), (20, 2))
    ray = np.column_stack([(given - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(20)]) @ camera.view_rotation
    away = ray * 10.0 ** rng.uniform(-3, 6, (20, 1))
    back = pixel_of(camera, away @ camera.view_rotation.T)
    slack = 1e-9 * (1 + np.abs(back).max() + abs(camera.cx) + abs(camera.cy) + camera.fx + camera.fy)
    assert np.abs(back - given).max() <= slack


@given(seeds)
@settings(deadline=None)
def test_axes_are_a_right_handed_rotation_and_the_inverse_is_one(seed):
    camera = random_camera(np.random.default_rng(seed))
    assert np.allclose(np.cross(camera.right, camera.up), -camera.forward, atol=1e-12)
    assert np.allclose(camera.view_rotation @ camera.view_rotation.T, np.eye(3), atol=1e-12)
    axes = np.column_stack([camera.right, -camera.up, camera.forward])
    assert np.allclose(camera.view_rotation @ axes, np.eye(3), atol=1e-12)
    reach = 1 + np.abs(camera.position).max()
    assert np.allclose(camera.world_to_camera @ camera.camera_to_world, np.eye(4), atol=1e-12 * reach)


@given(seeds, st.floats(-150, 150))
@settings(deadline=None)
def test_any_scale_in_the_matrix_is_taken_out(seed, power):
    camera = random_camera(np.random.default_rng(seed))
    pose = camera.camera_to_world.copy()
    pose[:3, :3] *= 10.0**power
    assert np.allclose(camera.moved(pose).camera_to_world, camera.camera_to_world, rtol=0, atol=1e-12)


@given(st.lists(st.floats(), min_size=16, max_size=16))
@settings(max_examples=300, deadline=None)
def test_any_sixteen_floats_are_a_rotation_or_refused_in_one_line(values):
    with np.errstate(all="ignore"):
        try:
            camera = Camera(8, 6, 5.0, 5.0, 4.0, 3.0, np.array(values).reshape(4, 4))
        except InputError as error:
            assert "\n" not in str(error)
            return
    rotation = camera.camera_to_world[:3, :3]
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) and np.linalg.det(rotation) > 0.9


@given(seeds, sides, sides)
@settings(deadline=None)
def test_resizing_there_and_back_gives_the_same_lens(seed, width, height):
    camera = random_camera(np.random.default_rng(seed))
    other = camera.resized(width, height)
    assert np.isclose(other.vertical_fov, camera.vertical_fov, rtol=1e-9, atol=1e-9)
    back = other.resized(camera.width, camera.height)
    scale = max(camera.width, camera.height, width, height, camera.fx, camera.fy)
    ratio = max(1.0, camera.height / height)
    assert np.allclose([back.fx, back.fy, back.cx, back.cy], [camera.fx, camera.fy, camera.cx, camera.cy],
                       rtol=1e-12, atol=1e-12 * scale * ratio)


@given(sides, sides, st.floats(1e-6, 179.9))
def test_a_field_of_view_comes_back(width, height, fov):
    assert np.isclose(from_fov(width, height, fov, np.eye(4)).vertical_fov, fov, rtol=1e-9)


@given(seeds, st.floats(-300, 300))
@settings(deadline=None)
def test_looking_at_something_however_near_or_far_is_looking_there(seed, power):
    rng = np.random.default_rng(seed)
    ahead = rng.normal(size=3)
    assume(np.linalg.norm(np.cross(ahead, (0, 0, 1))) > 1e-3)
    with np.errstate(over="ignore"):
        matrix = look_at((0, 0, 0), ahead * 10.0**power)
    if abs(power) < 190:
        assert np.allclose(-matrix[:3, 2], ahead / np.linalg.norm(ahead), atol=1e-12)
    assert np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-12)


# Camera files there and back: each format written here by its own documentation, read by the program


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """w, x, y, z by the eigenvector of the largest eigenvalue (Bar-Itzhack), which no rotation breaks."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    k = np.array([[a + e + i, h - f, c - g, d - b], [h - f, a - e - i, b + d, c + g],
                  [c - g, b + d, e - a - i, f + h], [d - b, c + g, f + h, i - a - e]])
    return np.linalg.eigh(k)[1][:, -1]


def assert_same(read: Camera, camera: Camera) -> None:
    """The same lens and pose, but for the rounding of an angle of view."""
    lens = np.array([read.fx, read.fy, read.cx, read.cy])
    assert (read.width, read.height) == (camera.width, camera.height)
    assert np.allclose(lens, [camera.fx, camera.fy, camera.cx, camera.cy], rtol=1e-9, atol=1e-9)
    assert np.allclose(read.camera_to_world[:3, :3], camera.camera_to_world[:3, :3], rtol=0, atol=1e-9)
    assert np.allclose(read.position, camera.position, rtol=1e-12, atol=1e-12 * (1 + np.abs(camera.position).max()))


@given(seeds, st.integers(1, 5))
@settings(max_examples=40, deadline=None)
def test_camera_path_there_and_back(tmp_path_factory, seed, count):
    rng = np.random.default_rng(seed)
    first = random_camera(rng, square=True)
    cameras = [from_fov(first.width, first.height, float(rng.uniform(1, 170)), random_camera(rng).camera_to_world, f"shot{n}")
               for n in range(count)]
    path = tmp_path_factory.mktemp("path") / "camera_path.json"
    write_camera_path(path, cameras)
    read = read_cameras(path)
    assert [c.name for c in read] == [c.name for c in cameras]
    for one, other in zip(read, cameras, strict=True):
        assert_same(one, other)
    write_camera_path(path, read)
    again = read_cameras(path)
    assert all(np.array_equal(a.camera_to_world, b.camera_to_world) for a, b in zip(again, read, strict=True))


@given(seeds, st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_transforms_there_and_back(tmp_path_factory, seed, count):
    rng = np.random.default_rng(seed)
    cameras = [random_camera(rng, name=f"picture{n}") for n in range(count)]
    frames = [{"file_path": f"images/{c.name}.jpg", "transform_matrix": c.camera_to_world.tolist(), "fl_x": c.fx, "fl_y": c.fy,
               "cx": c.cx, "cy": c.cy, "w": c.width, "h": c.height} for c in cameras]
    path = tmp_path_factory.mktemp("transforms") / "transforms.json"
    path.write_text(json.dumps({"frames": frames}))
    for read, camera in zip(read_cameras(path), cameras, strict=True):
        assert_same(read, camera)
        assert read.name == camera.name and np.array_equal(read.camera_to_world, camera.camera_to_world)


@given(seeds, st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_colmap_there_and_back(tmp_path_factory, seed, count):
    rng = np.random.default_rng(seed)
    cameras = [random_camera(rng, name=f"picture{n}") for n in range(count)]
    folder = tmp_path_factory.mktemp("colmap")
    (folder / "cameras.txt").write_text("".join(
        f"{n} PINHOLE {c.width} {c.height} {' '.join(repr(float(v)) for v in (c.fx, c.fy, c.cx, c.cy))}\n"
        for n, c in enumerate(cameras)))
    lines = []
    for n, c in enumerate(cameras):
        turn = c.view_rotation  # OpenCV axes, world to camera
        values = [*quaternion(turn) * rng.choice([-1, 1]), *(-turn @ c.position)]
        lines += [f"{n} {' '.join(repr(float(v)) for v in values)} {n} {c.name}.png", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    for read, camera in zip(read_cameras(folder), cameras, strict=True):
        assert read.name == camera.name
        assert_same_place(read, camera)


@given(seeds, st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_trajectories_there_and_back(tmp_path_factory, seed, count):
    rng = np.random.default_rng(seed)
    lens = random_camera(rng)
    cameras = [lens.moved(random_camera(rng).camera_to_world) for _ in range(count)]
    path = tmp_path_factory.mktemp("tum") / "walk.txt"
    values = [lens.fx, lens.fy, lens.cx, lens.cy, lens.width, lens.height]
    path.with_name("intrinsics.txt").write_text(" ".join(repr(float(v)) for v in values))
    rows = []
    for number, camera in enumerate(cameras):
        w, x, y, z = quaternion(camera.view_rotation.T)
        rows.append(" ".join(repr(float(v)) for v in (number, *camera.position, x, y, z, w)))
    path.write_text("\n".join(rows))
    for read, camera in zip(read_cameras(path), cameras, strict=True):
        assert_same_place(read, camera)


def assert_same_place(read: Camera, camera: Camera) -> None:
    """As above, where the file holds a quaternion and COLMAP a position turned into the camera's axes."""
    assert np.allclose(read.camera_to_world[:3, :3], camera.camera_to_world[:3, :3], rtol=0, atol=1e-12)
    assert np.allclose(read.position, camera.position, rtol=0, atol=1e-13 * (1 + np.abs(camera.position).max()) * 20)
    assert (read.width, read.height) == (camera.width, camera.height)
    assert np.allclose([read.fx, read.fy, read.cx, read.cy], [camera.fx, camera.fy, camera.cx, camera.cy], rtol=1e-14)
