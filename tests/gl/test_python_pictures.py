"""Pictures from ``import pointglass``: those of the renderer, by scan and in turn; and the example that people copy."""

import doctest
import io
import pickle
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clouds import camera_in, room
from PIL import Image
from scipy.spatial import cKDTree

import pointglass
from pointglass.viewer.cli import main
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.interface import publish_folder
from pointglass.viewer.interface.pictures import as_picture
from pointglass.viewer.picture.background import as_saved
from pointglass.viewer.picture.provenance import provenance
from pointglass.viewer.picture.settings import Memory, Settings
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.work.pictures.shot_metadata import read_shot

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from cloud_files import write_ply

pytestmark = pytest.mark.gl


@pytest.fixture(autouse=True)
def back_to_the_tests_own_context(no_gl_error, context):
    yield
    context.__enter__()  # the check for errors asks this one


def plain(context, scene, camera, settings, views):
    with context:
        renderer = Renderer(context, scene)
        try:
            frame = renderer.render(camera, settings, views)
            return frame.image(settings.view).copy(), frame.depth().copy(), frame.mask().copy()
        finally:
            renderer.release()


@pytest.mark.parametrize("view, extra", [("raw", ("filtered",)), ("filtered", ()), ("filled", ())])
def test_a_full_frame_is_what_the_renderer_makes(context, seed, view, extra):
    scene = room(seed, 20_000)
    camera = camera_in(scene, seed, (96, 72))
    image, depth, mask = plain(context, scene, camera, Settings(view=view, filter_strength=0.5), (view, *extra))
    with pointglass.Scan(scene, "room", Memory()) as scan:
        frame = scan.render(camera, view=view, full=True, filter_strength=0.5)
        alone = scan.render(camera, view=view, filter_strength=0.5)
    assert frame.image.shape == (72, 96, 4) and frame.image.flags.writeable
    assert np.array_equal(frame.image, image) and np.array_equal(alone, image)
    assert np.array_equal(frame.depth, depth) and np.array_equal(frame.mask, mask)
    assert np.array_equal(frame.provenance, provenance(view, image, mask))
    assert frame.stats["total_ms"] > 0 and frame.stats["points_total"] == scene.count
    assert "network" not in frame.stats["stages"]


def test_the_network_repaints_what_was_measured_and_fills_the_rest(one_thread):
    scene = room(3, 20_000)
    camera = camera_in(scene, 3, (64, 48))
    with pointglass.Scan(scene, "room", Memory()) as scan:
        frame = scan.render(camera, full=True, quality="fast", device="cpu", precision="fp32")
    shown = frame.image[..., 3] > 0
    assert set(np.unique(frame.provenance)) <= {0, 2, 3} and (frame.provenance == 2).any()
    assert np.array_equal(frame.provenance == 2, shown & frame.mask) and np.array_equal(frame.provenance > 0, shown)
    assert "fast" in frame.stats["network"]


def test_scans_rendered_in_turn_do_not_mix(seed):
    scenes = [room(seed + n, 20_000) for n in range(2)]
    cameras = [camera_in(scene, seed, (64, 48)) for scene in scenes]
    first, second = (pointglass.Scan(scene, "room", Memory()) for scene in scenes)
    alone = [first.render(cameras[0], view="filled"), second.render(cameras[1], view="filled")]
    assert np.array_equal(first.render(cameras[0], view="filled"), alone[0])
    second.close()
    assert np.array_equal(first.render(cameras[0], view="filled"), alone[0])
    first.close()
    with pointglass.Scan(scenes[1], "again", Memory()) as again:
        assert np.array_equal(again.render(cameras[1], view="filled"), alone[1])


def test_a_context_that_cannot_be_had_is_said_and_asked_for_again(monkeypatch):
    def refuse():
        raise pointglass.DeviceError("OpenGL 4.3 is needed")

    scene = room(1, 20_000)
    with pointglass.Scan(scene, "room", Memory()) as scan:
        with monkeypatch.context() as patch:
            patch.setattr("pointglass.viewer.render.device.context.create_context", refuse)
            with pytest.raises(pointglass.DeviceError, match=r"^OpenGL 4\.3"):
                scan.render(camera_in(scene, 1, (16, 16)), view="raw")
        assert scan.render(camera_in(scene, 1, (16, 16)), view="raw").shape == (16, 16, 4)


def test_several_cameras_give_a_list_of_the_same_pictures(seed, capsys):
    scene = room(seed, 20_000)
    cameras = [camera_in(scene, seed + n, (48 + n, 36)) for n in range(3)]
    with pointglass.Scan(scene, "room", Memory()) as scan:
        alone = [scan.render(camera, view="filled") for camera in cameras]
        together = scan.render(iter(cameras), view="filled")
        frames = scan.render(cameras, view="filled", full=True)
        assert scan.render([], view="filled") == []
    assert [picture.shape for picture in together] == [(36, 48, 4), (36, 49, 4), (36, 50, 4)]
    for one, listed, frame in zip(alone, together, frames, strict=True):
        assert np.array_equal(one, listed) and np.array_equal(one, frame.image)


def test_pixels_and_depth_lead_back_to_points_as_the_documentation_says(seed):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-3, 3, (300, 3)) + (4.5e5, 5.2e6, 300)
    eye = xyz.mean(axis=0) + rng.normal(size=3) * 2 + (9, 0, 0)
    camera = pointglass.look_at(eye, xyz.mean(axis=0), up=rng.normal(size=3), size=(300, 200))
    with pointglass.from_points(xyz, rng.random((300, 3))) as scan:
        depth = scan.render(camera, view="raw", full=True).depth
    row, column = np.nonzero(np.isfinite(depth))
    along = depth[row, column][:, None]
    right = ((column + 0.5 - camera.cx) / camera.fx)[:, None] * camera.right
    up = ((row + 0.5 - camera.cy) / camera.fy)[:, None] * camera.up
    places = camera.position + along * (camera.forward + right - up)
    distance, _ = cKDTree(xyz).query(places)
    half_a_pixel = np.sqrt(0.5) * along[:, 0] / camera.fx
    assert len(places) > 50 and (distance <= half_a_pixel * 1.01 + 1e-4).all()
    view = (xyz - camera.position) @ camera.view_rotation.T  # and forwards
    ahead = view[view[:, 2] > 0.1]
    x, y = ahead[:, 0] / ahead[:, 2], ahead[:, 1] / ahead[:, 2]
    lands = np.floor([camera.cx + camera.fx * x, camera.cy + camera.fy * y])
    inside = (lands >= 0).all(axis=0) & (lands[0] < 300) & (lands[1] < 200)
    assert np.isfinite(depth[lands[1, inside].astype(int), lands[0, inside].astype(int)]).mean() > 0.98


def test_a_picture_is_an_array_that_notebooks_show(seed):
    scene = room(seed, 20_000)
    with pointglass.Scan(scene, "room", Memory()) as scan:
        frame = scan.render(camera_in(scene, seed, (40, 30)), view="filled", full=True)
    image = frame.image
    for shown in (image, frame):
        with Image.open(io.BytesIO(shown._repr_png_())) as png:
            assert np.array_equal(np.asarray(png), as_saved(np.asarray(image), "black"))
    assert type(image) is pointglass.Picture and isinstance(image, np.ndarray) and type(np.asarray(image)) is np.ndarray
    assert type(image / 2) is np.ndarray and isinstance(image.mean(), np.float64) and image[:5, :5]._repr_png_() is not None
    assert image[0]._repr_png_() is None and (image == image).all()
    again = pickle.loads(pickle.dumps(frame))
    assert np.array_equal(again.image, image) and type(again.image) is pointglass.Picture and again.image.flags.writeable


def test_a_saved_picture_can_be_drawn_again_by_its_description(seed, tmp_path):
    """Unless its pixels were changed: then the file does not say how it was made."""
    write_ply(tmp_path / "room.ply", *unpack(room(seed, 20_000))[:2])
    with pointglass.open(tmp_path / "room.ply") as scan:
        picture = scan.render(pointglass.look_at((4, 3, 1.5), (1, 2, 1), size=(64, 48)), view="filled", filter_strength=0.7)
    picture.save(tmp_path / "mine.png", background="sky")
    pickle.loads(pickle.dumps(picture)).save(tmp_path / "pickled.png", background="sky")
    assert (tmp_path / "mine.png").read_bytes() != (tmp_path / "pickled.png").read_bytes()  # the camera has the file's name
    like = ["--like", str(tmp_path / "mine.png"), "--out", str(tmp_path / "again")]
    assert main(["render", str(tmp_path / "room.ply"), *like]) == 0
    assert (tmp_path / "again" / "mine.png").read_bytes() == (tmp_path / "mine.png").read_bytes()
    picture[0, 0] ^= 1
    picture.save(tmp_path / "changed.png")
    with pytest.raises(pointglass.InputError, match="does not say how it was made"):
        read_shot(tmp_path / "changed.png")
    picture.save(tmp_path / "small.jpg")
    with Image.open(tmp_path / "small.jpg") as jpeg:
        assert jpeg.size == (64, 48) and jpeg.format == "JPEG"


@pytest.mark.parametrize("name, given, said", [
    ("a.gif", {}, r"a\.gif'?: expected a file name that ends in \.png"), ("a.png", {"background": "red"}, "^background 'red'"),
    ("a.jpg", {"background": "transparent"}, "JPEG"), ("no/a.png", {}, "cannot be written"), (3, {}, "^3: expected the path"),
])  # fmt: skip
def test_what_cannot_be_saved_is_refused_in_one_line(name, given, said, tmp_path):
    with pytest.raises(pointglass.InputError, match=said) as caught:
        as_picture(np.zeros((4, 4, 4), np.uint8)).save(name if isinstance(name, int) else tmp_path / name, **given)
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


def test_another_thread_is_told_to_open_the_scan_itself(seed):
    scene = room(seed, 20_000)
    camera = camera_in(scene, seed, (48, 36))
    said: list[object] = []

    def elsewhere():
        for use in (lambda: scan.render(camera, view="raw"), scan.close):
            with pytest.raises(pointglass.InputError) as caught:
                use()
            said.append(str(caught.value))
        with pointglass.Scan(scene, "room", Memory()) as own:
            said.append(own.render(camera, view="filled"))

    with pointglass.Scan(scene, "room", Memory()) as scan:
        picture = scan.render(camera, view="filled")
        thread = threading.Thread(target=elsewhere, name="second")
        thread.start()
        thread.join(60)
        assert np.array_equal(scan.render(camera, view="filled"), picture)
    assert all("thread MainThread, this is second" in text for text in said[:2]) and np.array_equal(said[2], picture)


FORK = """
import multiprocessing, sys, numpy as np, pointglass
rng = np.random.default_rng(1)
scan = pointglass.from_points(rng.uniform(0, 3, (20000, 3)), rng.random((20000, 3)))
camera = pointglass.look_at((1, 1, 1), (2, 2, 1), size=(32, 24))
def render(pipe):
    for use in (scan, pointglass.from_points(np.eye(4, 3), np.zeros((4, 3)))):
        try:
            pipe.send(use.render(camera, view="filled"))
        except Exception as error:
            pipe.send(f"{type(error).__name__}: {error}")
    scan.close()
def child():
    ours, theirs = fork.Pipe()
    process = fork.Process(target=render, args=(theirs,))
    process.start()
    found = [ours.recv() if ours.poll(60) else "hangs" for _ in range(2)]
    process.join(60)
    return found, process.exitcode
fork = multiprocessing.get_context("fork")
before, code = child()  # of a process without a picture
assert before[0].shape == (24, 32, 4) and code == 0, (before, code)
picture = scan.render(camera, view="filled")
assert np.array_equal(before[0], picture)
after, code = child()
assert code == 0 and all("spawn" in said and said.startswith("DeviceError: ") for said in after), (after, code)
assert np.array_equal(scan.render(camera, view="filled"), picture)
"""


def test_a_forked_process_is_told_to_be_spawned(tmp_path):
    done = subprocess.run([sys.executable, "-c", FORK], capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr


def test_the_example_in_the_documentation_runs():
    example = doctest.DocTestParser().get_doctest(pointglass.__doc__ or "", {}, "pointglass", pointglass.__file__, 0)
    said: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    runner.run(example, out=said.append)
    assert runner.tries >= 10 and not runner.failures, "".join(said)


def test_a_publication_is_called_as_its_scan_is(monkeypatch, tmp_path):
    titles = []
    monkeypatch.setattr(publish_folder, "publish_folder", lambda *given: titles.append(given[6]))
    for name in ("points", "house.e57", "heap"):
        with pointglass.from_points(np.eye(3), np.eye(3), name=name) as scan:
            scan.publish(tmp_path / "site")
    assert titles == ["points", "house", "heap"]


def test_a_scan_publishes_itself_as_the_command_does(tmp_path, seed):
    write_ply(tmp_path / "room.ply", *unpack(room(seed, 20_000))[:2])
    with pointglass.open(tmp_path / "room.ply") as scan:
        assert scan.publish(tmp_path / "python", at=1, view="filled", title="Room") == 1
        (tmp_path / "thesis.txt").write_text("")
        new = tmp_path / "new"
        cases: list[tuple[Any, dict[str, Any], str]] = [
            (tmp_path, {}, "other files"), (3.5, {}, "3.5: expected the path"), (new, {"title": 5}, "title 5: expected a text"),
            (new, {"at": 1.5}, "at '1.5': expected auto"), (new, {"at": []}, "at "), (new, {"size": 500}, "size 500: "),
            (new, {"size": [2]}, "size "), (new, {"view": {}}, "view "), (new, {"view": "x"}, "view 'x'"),
        ]  # fmt: skip
        for folder, given, said in cases:
            with pytest.raises(pointglass.InputError, match=said):
                scan.publish(folder, **{"view": "filled", **given})
        assert not new.exists()
    command = ["publish", str(tmp_path / "room.ply"), "--out", str(tmp_path / "command"), "--view", "filled", "--at", "1",
               "--title", "Room"]
    assert main(command) == 0
    mine, its = (sorted(file for file in (tmp_path / name).rglob("*") if file.is_file()) for name in ("python", "command"))
    assert [file.name for file in mine] == [file.name for file in its] and len(mine) == 8
    assert all(one.read_bytes() == other.read_bytes() for one, other in zip(mine, its, strict=True))
