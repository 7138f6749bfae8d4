"""Camera paths, encoding and panoramas, without OpenGL."""

import json
from fractions import Fraction

import numpy as np
import pytest

from pointglass.viewer.commands.film.command import read_path
from pointglass.viewer.commands.film.encode import write_folder, write_mp4
from pointglass.viewer.commands.film.equirectangular import Panorama
from pointglass.viewer.commands.film.frames import averaged
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.work.cameras.camera_files import write_camera_path
from pointglass.viewer.work.cameras.path import interpolate

SIZE = (64, 48)


def key(position, target, fov=60.0):
    return from_fov(*SIZE, fov, look_at(position, target))


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (636_000.0, 5_848_000.0, 400.0)])
def test_a_path_passes_through_its_keyframes_and_keeps_its_speed(origin):
    rng = np.random.default_rng(5)
    at = np.array(origin)
    places = at + np.cumsum(rng.uniform(0.5, 3.0, (5, 3)), axis=0)  # unevenly spaced
    keys = [key(place, place + (1.0, 0.4, 0.0)) for place in places]  # one direction throughout
    made = interpolate(keys, 400)
    positions = np.array([camera.position for camera in made])
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    assert steps.max() / steps.min() < 1.02
    for place in places:
        assert np.linalg.norm(positions - place, axis=1).min() <= steps.max()
    assert np.allclose(positions[[0, -1]], places[[0, -1]], atol=1e-6)


def test_a_turn_on_the_spot_takes_its_share_of_time_and_a_zoom_does_not_overshoot():
    keys = [key((0, 0, 1), (np.cos(a), np.sin(a), 1), fov) for a, fov in ((0.0, 70.0), (0.8, 30.0), (2.4, 30.0))]
    made = interpolate(keys, 121)
    assert all(np.allclose(camera.position, (0, 0, 1)) for camera in made)
    forward = np.array([camera.forward for camera in made])
    angles = np.arccos(np.clip((forward[1:] * forward[:-1]).sum(1), -1, 1))
    assert angles.max() < 1.1 * angles.mean() and angles.sum() == pytest.approx(2.4, rel=0.02)
    fov = np.array([camera.vertical_fov for camera in made])
    assert fov.max() <= 70.0 + 1e-6 and fov.min() >= 30.0 - 1e-6


def test_equal_keyframes_stand_still():
    made = interpolate([key((1, 2, 3), (4, 5, 6))] * 3, 10)
    assert all(np.allclose(camera.camera_to_world, made[0].camera_to_world) for camera in made)


def test_a_camera_path_is_frames_where_it_is_as_long_as_it_says_and_keyframes_otherwise(tmp_path):
    file = tmp_path / "camera_path.json"
    cameras = [key((x, 0, 1), (x, 5, 1)) for x in range(5)]
    write_camera_path(file, cameras)
    read = read_path(file)
    frames, rate = read.cameras, read.rate
    assert len(frames) == 5 and rate == 24.0
    assert all(np.allclose(a.camera_to_world, b.camera_to_world) for a, b in zip(frames, cameras, strict=True))
    data = json.loads(file.read_text())
    file.write_text(json.dumps(data | {"seconds": 2.0, "fps": 10}))
    read = read_path(file)
    frames, rate = read.cameras, read.rate
    assert (len(frames), rate) == (20, 10.0)
    assert len(read_path(file, seconds=1, fps=30).cameras) == 30


@pytest.mark.parametrize(("change", "said"), [
    ({"fps": -1}, "fps -1"),
    ({"fps": 65536}, "fps 65536: expected at most 1000; give --fps"),
    ({"seconds": "long"}, "seconds 'long'"),
    ({"seconds": 1e9}, "frames"),
])  # fmt: skip
def test_a_path_with_impossible_times_is_refused(tmp_path, change, said):
    file = tmp_path / "camera_path.json"
    write_camera_path(file, [key((0, 0, 1), (1, 0, 1))])
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(InputError, match=said):
        read_path(file)


def test_a_panorama_shows_what_lies_in_each_direction():
    camera = key((3.0, -2.0, 1.0), (4.0, -2.3, 1.6))
    panorama = Panorama(512, 256)

    def world(directions):  # smooth over all directions
        return np.rint(127.5 + 127 * np.concatenate([directions, np.ones_like(directions[..., :1])], -1)).astype(np.uint8)

    def draw(face):
        rows, columns = np.mgrid[0 : face.height, 0 : face.width] + 0.5
        points = face.unproject(np.stack([columns.ravel(), rows.ravel()], 1), 1.0) - face.position
        return world((points / np.linalg.norm(points, axis=1, keepdims=True)).reshape(face.height, face.width, 3))

    made = panorama.picture(camera, draw).astype(int)
    rays = panorama.rays(camera)
    assert np.abs(made - world(rays).astype(int)).max() <= 1
    middle = rays[127:129, 255:257].mean((0, 1))
    heading = camera.forward[:2] / np.linalg.norm(camera.forward[:2])
    assert np.allclose(middle[:2] / np.linalg.norm(middle[:2]), heading, atol=1e-6)
    assert rays[0, 0, 2] > 0.99 and rays[-1, 0, 2] < -0.99
    # what lies to the right of the heading is in the right half
    assert rays[128, 384] @ camera.right > 0.9


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_supersampling_averages_light_and_not_levels(factor):
    white = np.zeros((6, 6, 4), np.uint8)
    white[::factor] = 255
    made = averaged(white, factor)
    share = 1 / factor
    level = 255 * (1.055 * share ** (1 / 2.4) - 0.055) if factor > 1 else 255
    assert made.shape == (6 // factor, 6 // factor, 4)
    assert np.abs(made[0, 0, :3].astype(int) - level).max() <= 1.5 and abs(int(made[0, 0, 3]) - 255 * share) <= 1


def draw(camera):
    """A picture that depends on where the camera is."""
    rows, columns = np.mgrid[0 : camera.height, 0 : camera.width]
    plane = (rows * 3 + columns * 2 + 10 * camera.position[0]) % 256 // 2 + 40
    return np.dstack([plane, plane[::-1], np.full_like(plane, 90.0)]).astype(np.uint8)


def test_a_video_holds_the_pictures_and_comes_out_the_same_twice(tmp_path):
    import av

    cameras = interpolate([key((x, 0, 1), (x, 5, 1)) for x in (0, 4)], 12)
    for name in ("a.mp4", "b.mp4"):
        write_mp4(tmp_path / name, cameras, draw, size=SIZE, fps=Fraction(12))
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()
    with av.open(str(tmp_path / "a.mp4")) as container:
        stream = container.streams.video[0]
        shown = [frame.to_ndarray()[: SIZE[1]] for frame in container.decode(stream)]  # the rows of luma come first
        assert stream.average_rate == 12 and (stream.width, stream.height) == SIZE
    assert len(shown) == len(cameras)
    luma = np.array([0.2126, 0.7152, 0.0722])
    for frame, camera in zip(shown, cameras, strict=True):
        assert np.abs(frame.astype(float) - (16 + draw(camera) @ luma * 219 / 255)).mean() < 4


def test_a_film_that_fails_leaves_nothing(tmp_path):
    cameras = interpolate([key((x, 0, 1), (x, 5, 1)) for x in (0, 4)], 5)

    def breaks(camera):
        if camera is cameras[3]:
            raise KeyboardInterrupt
        return draw(camera)

    with pytest.raises(KeyboardInterrupt):
        write_mp4(tmp_path / "a.mp4", cameras, breaks, size=SIZE, fps=Fraction(12))
    with pytest.raises(InputError, match="even sides"):
        write_mp4(tmp_path / "a.mp4", cameras, draw, size=(63, 48), fps=Fraction(12))
    assert list(tmp_path.iterdir()) == []


def test_frames_in_a_folder_are_continued_only_if_made_of_the_same(tmp_path):
    cameras = interpolate([key((x, 0, 1), (x, 5, 1)) for x in (0, 4)], 6)
    calls = []

    def counted(camera):
        calls.append(camera.name)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return draw(camera)

    with pytest.raises(KeyboardInterrupt):
        write_folder(tmp_path, cameras, counted, made_of={"a": 1}, resume=False)
    before = {path.name: path.read_bytes() for path in tmp_path.glob("*.png")}
    assert len(before) == 3
    with pytest.raises(InputError, match="--resume"):
        write_folder(tmp_path, cameras, draw, made_of={"a": 1}, resume=False)
    with pytest.raises(InputError, match="another a"):
        write_folder(tmp_path, cameras, draw, made_of={"a": 2}, resume=True)
    assert write_folder(tmp_path, cameras, draw, made_of={"a": 1}, resume=True) == 3
    assert len(list(tmp_path.glob("*.png"))) == 6
    assert all((tmp_path / name).read_bytes() == data for name, data in before.items())
