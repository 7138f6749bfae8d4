"""``pointglass publish`` as a command: what the folder holds, against `render` and against a room whose distances are known."""

import base64
import contextlib
import getpass
import io
import json
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import laspy
import numpy as np
import pytest
from command_line import run_here, run_in_a_process
from PIL import Image

from pointglass.viewer.commands.publishing.coming_files import alone
from pointglass.viewer.commands.publishing.cube_faces import FACES, face_cameras, render_place
from pointglass.viewer.commands.publishing.depth_codes import DepthScale, unpacked_depth
from pointglass.viewer.commands.publishing.face_margins import with_margin, without_margin
from pointglass.viewer.commands.publishing.own_files import check_folder
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.picture.background import composite
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.render.described_picture import Composer
from pointglass.viewer.work.cameras.camera_files import write_transforms
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.viewpoint import Viewpoint

SIZE = np.array([6.0, 4.0, 2.6])
EYE = np.array([2.2, 1.7, 1.5])
NOISE = 0.002
OFFSET = np.array([500.0, 700.0, 20.0])
HOSTILE = "</script><img src=x onerror=alert(1)>"


def room(path, seed, points=500_000):
    """A room of known size, 2 mm noise across its walls, colours that change slowly; nothing on a square of one wall."""
    rng = np.random.default_rng(seed)
    xyz = rng.random((points, 3)) * SIZE
    axis, side = rng.integers(0, 3, points), rng.integers(0, 2, points)
    rows = np.arange(points)
    xyz[rows, axis] = side * SIZE[axis]
    hole = (xyz[:, 0] == SIZE[0]) & (np.abs(xyz[:, 1:] - (2.0, 1.3)) < 0.5).all(axis=1)
    rgb = (90 + 80 * np.sin(1.5 * xyz)).astype(np.uint16) * 256
    xyz[rows, axis] += rng.normal(0, NOISE, points)
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.offsets, header.scales = OFFSET, [1e-4] * 3
    header.add_crs(__import__("pyproj").CRS.from_epsg(25832))
    las = laspy.LasData(header)
    las.xyz = (xyz + OFFSET)[~hole]
    las.red, las.green, las.blue = rgb[~hole].T
    las.write(path)
    return path


def project(folder, scan):
    """A project with a viewpoint at EYE, one beside it, and notes."""
    def view(name, eye, ahead):
        return Viewpoint.of(from_fov(64, 64, 60.0, look_at(eye + OFFSET, eye + OFFSET + ahead)), name)

    views = view("By the window", EYE, (1, 0, 0)), view(HOSTILE, EYE + (1.6, 0.4, 0.1), (0, 1, -0.2))
    at = tuple((OFFSET + (1.0, 4.0, 1.2)).tolist())
    photograph(folder / "my.jpg")
    notes = (Annotation(f"{HOSTILE}\nsecond line", at, link="https://example.org/"),
             Annotation("Tür", at, picture=str(folder / "my.jpg")), Annotation("gone", at, picture=str(folder / "my.png")))
    ends = [MeasuredPoint(tuple((OFFSET + end).tolist()), 0.01, NOISE, scan="room.laz") for end in ((0, 1, 1), (6, 1, 1))]
    document = Document(scans=(ScanFile(str(scan)),), viewpoints=views, annotations=notes,
                        measurements=(Measurement("distance", tuple(ends), HOSTILE),))
    write_project(folder / "flat.pointglass", document)
    return folder / "flat.pointglass"


def photograph(path):
    """Left half red, right half blue, with what a camera writes about its owner."""
    exif = Image.Exif()
    exif[0x013B], exif[0x010F] = "Anna Author", "SecretCam"
    half = np.zeros((600, 800, 3), np.uint8)
    half[:, :400, 0] = half[:, 400:, 2] = 200
    Image.fromarray(half).save(path, exif=exif, comment=b"at home")


def publish(*arguments):
    return run_here("publish", *arguments)


def value_of(file):
    text = file.read_text("ascii")
    return json.loads(f"[{text[text.index('(') + 1:text.rindex(')')]}]")[1]


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """(folder, project, what the command printed on both streams)."""
    folder = tmp_path_factory.mktemp("scans of anna")
    scan = project(folder, room(folder / "room.laz", 5))
    out = folder / "site"
    done = run_in_a_process("publish", scan, "--out", out, "--view", "filled", "--at", "viewpoints", "--title", HOSTILE)
    assert done.returncode == 0, done.stderr
    return out, scan, done.stdout + done.stderr


def test_every_face_is_the_picture_that_render_makes(published, renderer_of):
    """The filled one of its camera with a margin, which is cut away: nearly everywhere that of the camera itself, too."""
    out, scan, _ = published
    renderer = renderer_of(open_scene([scan.parent / "room.laz"]))
    for part, side, view, block in (("full", 1024, "filled", 1), ("second", 512, "raw", 8)):  # WebP smears single points
        cameras = face_cameras(EYE + OFFSET, side)
        for picture, camera in zip(value_of(out / "places" / f"000.{part}.js")["pictures"], cameras, strict=True):
            shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB"), int)
            for of in (camera, with_margin(camera)) if view == "filled" else (camera,):
                rendered = composite(renderer.render(of, Settings(view=view), (view,)).image(view), "plain").astype(int)
                expected = rendered if of is camera else without_margin(rendered)
                error = (shown - expected).reshape(side // block, block, side // block, block, 3).mean(axis=(1, 3))
                assert np.abs(error).mean() < 2.0


def test_no_seam_runs_through_what_was_not_measured(renderer_of, context, tmp_path, seed):
    """A room without points around the edges of the upward face, but for a few."""
    scan = laspy.read(room(tmp_path / "room.laz", seed, 200_000))
    away = np.abs(scan.xyz - OFFSET - EYE)
    edge = np.abs(np.maximum(away[:, 0], away[:, 1]) - away[:, 2]) < 0.25 * away[:, 2]
    edge &= scan.xyz[:, 2] > OFFSET[2] + EYE[2]
    scan.points = scan.points[~edge | (np.random.default_rng(seed).random(len(edge)) < 0.005)]
    scan.write(tmp_path / "room.laz")
    renderer, composer = renderer_of(open_scene([tmp_path / "room.laz"])), Composer(context)
    eye, side = EYE + OFFSET, 256
    spec = PictureSpec(face_cameras(eye, 8)[0], Settings(view="filled"))
    made = render_place(renderer, composer, spec, eye, side=side, depth_side=side, second=None).pictures
    composer.release()
    plain = [renderer.render(camera, spec.settings, ("filled",)).image("filled")[..., :3]
             for camera in face_cameras(eye, side)]

    def steps(faces):
        """Between the upward face's border pixels and those of the four faces beneath, in means of eight pixels."""
        top = np.asarray(faces[list(FACES).index("up")], float)
        pairs = (("east", top[::-1, -1]), ("west", top[:, 0]), ("north", top[-1, :]), ("south", top[0, ::-1]))
        found = [edge - np.asarray(faces[list(FACES).index(name)], float)[0] for name, edge in pairs]
        return np.abs(np.stack(found).reshape(4, -1, 8, 3).mean(axis=2)).mean()

    assert steps(made) < 0.4 * steps(plain) and steps(made) < 3.0, (steps(made), steps(plain))


def test_depth_is_that_of_the_room_and_holes_are_not_measured(published):
    out, _, _ = published
    place = value_of(out / "scene.js")["places"][0]
    codes, measured = unpacked_depth(base64.b64decode(value_of(out / "places" / "000.depth.js")["depth"]), 6, 512)
    depth = DepthScale(place["near"], place["step"]).depths(codes)
    hits = 0
    for face, camera in enumerate(face_cameras(EYE, 512)):
        column, row = np.meshgrid(np.arange(512) + 0.5, np.arange(512) + 0.5)
        rays = np.stack([(column - 256) / 256, (row - 256) / 256, np.ones_like(row)], -1) @ camera.view_rotation
        with np.errstate(divide="ignore"):
            truth = np.where(rays > 0, (SIZE - EYE) / rays, np.where(rays < 0, -EYE / rays, np.inf)).min(-1)
        error = np.abs(depth[face] - truth)[measured[face]]
        assert np.quantile(error, 0.9) < 0.02 and measured[face].mean() > 0.03
        at = EYE + rays * truth[..., None]
        hole = (np.abs(at - (6.0, 2.0, 1.3)) < (0.01, 0.45, 0.45)).all(axis=-1)
        assert not measured[face][hole].any()
        hits += int(hole.sum())
    assert hits > 500


def test_text_stays_text_and_nothing_tells_of_the_machine(published):
    out, scan, told = published
    assert re.search(r"left out: .*my\.png.*not there", told)
    telling = {str(Path.home()), str(scan.parent), str(Path.cwd()), "scans of anna", "room.laz", "my.jpg", "my.png", "/tmp/",
               "Anna Author", "SecretCam"}
    telling |= {getpass.getuser()} if len(getpass.getuser()) > 4 else set()
    for file in (file for file in out.rglob("*") if file.is_file()):
        text = file.read_bytes().decode("utf-8")
        if file.name == "page.js":  # words of libraries: /tmp/ and names of people are not among them
            text = text.split("\n", 1)[0]
        assert not [word for word in telling if word in text], file
    data, page = value_of(out / "scene.js"), (out / "index.html").read_text("utf-8")
    assert HOSTILE not in page and "&lt;/script&gt;&lt;img" in page and "<img" not in (out / "scene.js").read_text("ascii")
    assert data["title"] == data["viewpoints"][1]["name"] == data["places"][1]["name"] == HOSTILE
    assert data["notes"][0]["text"].splitlines()[0] == HOSTILE and data["notes"][0]["link"] == "https://example.org/"
    assert data["unit"] == "m" and data["places"][0]["plan"] == 0 and len(data["plans"]) == 1
    assert [note["picture"] for note in data["notes"]] == [None, [800, 600], None]
    picture = base64.b64decode(value_of(out / "notes" / "001.picture.js")["pictures"][0])
    assert not [word for word in (b"Anna", b"Secret", b"EXIF", b"home") if word in picture]
    shown = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), int)
    assert np.abs(shown[300, [200, 600]] - ((200, 0, 0), (0, 0, 200))).max() < 30
    made = data["measurements"][0]
    assert made["name"] == HOSTILE and made["text"].startswith("6.00") and made["text"].endswith(" m")
    assert np.allclose(np.diff(made["lines"][0]["points"], axis=0) @ np.array(data["axes"]).T, (6, 0, 0), atol=1e-4)
    assert abs(data["viewpoints"][0]["yaw"]) < 0.1 and data["viewpoints"][0]["place"] == 0
    file = np.array(data["axes"]) @ data["places"][0]["position"] + data["origin"]
    assert np.allclose(file, EYE + OFFSET, atol=1e-9)
    assert abs(data["places"][0]["position"][2] - data["places"][0]["floor"] - EYE[2]) < 0.02
    for number in range(2):
        assert (out / "places" / f"{number:03d}.first.js").stat().st_size < 1_500_000


def content(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_a_replacement_that_is_killed_or_stopped_leaves_the_publication_as_it_is(published, tmp_path, seed):
    """Of another scan with other places.  The first run is killed, the next one stopped; the third one ends."""
    shown, _, _ = published
    out, coming = tmp_path / "site", tmp_path / "site" / "coming" / "places"
    shutil.copytree(shown, out)
    earlier, rng = content(shown), np.random.default_rng(seed)
    other = room(tmp_path / "other.laz", 6, 50_000)
    stands = EYE + OFFSET + np.array([[x, y, 0] for x in (-1.0, 0, 1) for y in (-0.8, 0.8)])
    write_transforms(tmp_path / "six.json", [from_fov(64, 48, 50.0, look_at(at, at + (1, 0, 0)), f"{n}")
                                              for n, at in enumerate(stands)])
    line = [str(other), "--out", str(out), "--view", "filled", "--size", "512", "--at", str(tmp_path / "six.json")]

    def stopped(by):
        """Sends the signal once a place more is there.  Returns what it said, and its exit code."""
        number = len(list(coming.glob("*.first.js")))
        command = [sys.executable, "-m", "pointglass.viewer", "publish", *line]
        running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        end = time.monotonic() + 240
        while not (coming / f"{number:03d}.first.js").is_file():
            assert running.poll() is None and time.monotonic() < end
            time.sleep(0.02)
        time.sleep(0.3 * rng.random())
        running.send_signal(by)
        return running.communicate(timeout=240)[1], running.returncode

    assert stopped(signal.SIGKILL)[1] == -signal.SIGKILL
    assert {name: data for name, data in content(out).items() if not name.startswith("coming/")} == earlier
    said, code = stopped(signal.SIGINT)
    assert code == 130 and {name: data for name, data in content(out).items() if not name.startswith("coming/")} == earlier
    parts = sorted(file.name for file in coming.iterdir() if not file.name.startswith("."))
    made = len(parts) // 4
    assert parts == [f"{number:03d}.{part}.js" for number in range(made) for part in ("depth", "first", "full", "second")]
    assert f"{made} of 6 places stay in {coming.parent}, and the same command goes on from there; {out} shows the" in said
    times = {name: (coming / name).stat().st_mtime_ns for name in parts}
    done = publish(*line)
    assert done.returncode == 0 and re.search(rf"{made} kept", done.stdout), done.stdout + done.stderr
    assert times == {name: (out / "places" / name).stat().st_mtime_ns for name in parts}
    assert not (out / "coming").exists() and not (out / "notes").exists() and len(list((out / "places").iterdir())) == 24
    again = publish(*line[:-1], "1")  # fewer places: what is left over goes
    assert again.returncode == 0 and len(list((out / "places").iterdir())) == 4


@pytest.mark.parametrize(("arguments", "told"), [
    (["--at=1.5"], "--at '1.5': expected auto, stations, viewpoints, a camera file that exists, or a number"),
    (["--at", "0"], "--at"), (["--at", "stations"], "no scanner positions"), (["--view", "raw", "--second", "raw"], "--second"),
    (["--size", "640"], "--size"),
])  # fmt: skip
def test_what_cannot_be_published_is_refused_in_a_line(published, tmp_path, arguments, told):
    _, scan, _ = published
    done = publish(scan, "--out", tmp_path / "new", *arguments)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and told in done.stderr
    assert not (tmp_path / "new").exists()


def test_cameras_of_a_file_are_places_in_any_view(published, tmp_path):
    """The second one stands where the first does."""
    _, scan, _ = published
    ahead = [(1.0, 0.2, -0.5), (0, 1.0, 0), (-1.0, 1.0, 0.4)]
    stands = [EYE + OFFSET, EYE + OFFSET + (0, 0, 0.01), EYE + OFFSET + (1.5, 0.3, 0)]
    poses = [look_at(stand, stand + way) for stand, way in zip(stands, ahead, strict=True)]
    write_transforms(tmp_path / "seen.json", [from_fov(64, 48, 50.0, pose, f"seen {n}") for n, pose in enumerate(poses)])
    done = publish(scan, "--out", tmp_path / "site", "--at", tmp_path / "seen.json", "--view", "raw", "--size", "512")
    assert done.returncode == 0, done.stderr
    data = value_of(tmp_path / "site" / "scene.js")
    axes = np.array(data["axes"])
    found = [axes @ place["position"] + data["origin"] for place in data["places"]]
    assert np.allclose(found, [stands[0], stands[2]], atol=1e-6) and (data["view"], data["second"]) == ("raw", None)
    headings = [np.degrees(np.arctan2(*(way @ axes)[1::-1])) for way in (np.array(ahead[0]), np.array(ahead[2]))]
    assert np.allclose([place["yaw"] for place in data["places"]], headings, atol=1e-6)


def test_a_second_publication_into_one_folder_is_refused_while_the_first_runs(published, tmp_path):
    _, scan, _ = published
    (tmp_path / "site").mkdir()
    with alone(tmp_path / "site"):
        done = run_in_a_process("publish", scan, "--out", tmp_path / "site", "--view", "filled", "--at", "1")
    assert done.returncode == 2 and done.stderr.splitlines()[-1].count("another publication is being written") == 1
    assert not list((tmp_path / "site").iterdir())


def test_several_files_have_an_index_page_that_leads_to_the_places(tmp_path):
    files = [room(tmp_path / f"{name}.laz", seed) for seed, name in enumerate("ab")]
    old_names = "--places", "1", "--face-size", "512"
    arguments = "--out", tmp_path / "site", "--view", "filled", *old_names, "--second", "none"
    done = publish(*files, *arguments)
    assert done.returncode == 0, done.stderr
    assert value_of(tmp_path / "site" / "scene.js")["title"] == "a and 1 more"
    page = (tmp_path / "site" / "overview.html").read_text("utf-8")
    assert 'href="index.html#place=1"' in page and 'href="index.html#place=2"' not in page
    assert all(f'href="#file{number}">{name}</a>' in page for number, name in enumerate("ab"))
    assert str(tmp_path) not in page and "<script" not in page


def test_a_folder_with_other_files_is_left_alone(published, tmp_path):
    """Names do not tell: index.html and places are names of other people's pages, too."""
    _, scan, _ = published
    (tmp_path / "places").mkdir()
    (tmp_path / "places" / "holiday.txt").write_text("years of work")
    (tmp_path / "index.html").write_text("<!doctype html><title>mine</title>")
    done = publish(scan, "--out", tmp_path)
    assert done.returncode == 2 and "holds other files (index.html)" in done.stderr
    assert sorted(file.name for file in tmp_path.rglob("*")) == ["holiday.txt", "index.html", "places"]


@pytest.mark.parametrize(("other", "damaged"), [
    ("thesis.txt", False), ("places/holiday.txt", False), ("places/more/000.first.js", False), ("places/.hidden", False),
    ("coming/work.txt", False), ("index.html", False), ("scene.js", True), ("page.css", True), ("places/000.first.js", True),
    ("coming/places/000.first.js", True),
])  # fmt: skip
def test_files_of_a_publication_are_told_from_others(published, tmp_path, other, damaged):
    """damaged: beside our page it is one of ours that is damaged, and is made again; alone it may be anybody's."""
    site, _, _ = published
    shutil.copytree(site, tmp_path / "site")
    check_folder(tmp_path / "site")
    for out, refused in ((tmp_path / "empty", True), (tmp_path / "site", not damaged)):
        (out / other).parent.mkdir(parents=True, exist_ok=True)
        (out / other).write_text("years of work")
        with pytest.raises(InputError, match="holds other files") if refused else contextlib.nullcontext():
            check_folder(out)
