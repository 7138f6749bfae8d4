"""``pointglass publish`` of a project with all that it can hold: stations that are turned, photographs, notes, viewpoints."""

import base64
import getpass
import io
import json
import re
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from test_publish import photograph, publish, value_of

from pointglass.viewer.commands.publishing.cube_faces import face_cameras
from pointglass.viewer.commands.publishing.depth_codes import DepthScale, unpacked_depth
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.viewpoint import Viewpoint

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from cloud_files import E57Scan, write_e57
from e57_photo_files import AWAY, BOX, hit, paint, panorama, pinhole, room_points, turn, write_photos

STANDS = np.array([[0.6, 0.4, 0.1], [-0.9, -0.5, 0.2]])
"""Of the scanner, room coordinates."""
SIDE = 512


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """(folder, scans): the project has two E57 files, one of two stations and one of a photograph."""
    folder = tmp_path_factory.mktemp("scans of anna")
    stations = []
    for number, stand in enumerate(STANDS):
        rotation, quaternion = turn(0.8 - 2.5 * number, 0.3, 0.2)
        xyz, rgb = room_points(20_000, seed=number)
        stations.append(E57Scan((xyz - stand - AWAY) @ rotation, rgb, quaternion=quaternion, translation=tuple(stand + AWAY),
                                name=f"Stand {number}"))
    scans = [write_e57(folder / "stands.e57", stations),
             write_photos(folder / "photo.e57", [panorama((0.2, 0.1, 0.3), 0.4, 1024)], *room_points(1_000, seed=9))]
    photograph(folder / "my.jpg")
    view = Viewpoint.of(from_fov(64, 64, 60.0, look_at(AWAY + (0.5, 0.4, 0.0), AWAY + (0.5, 1.4, 0.2))), "At the wall")
    note = Annotation("Crack\nin the plaster", tuple((AWAY + (0.0, BOX[1], 0.3)).tolist()), picture=str(folder / "my.jpg"))
    write_project(folder / "whole.pointglass", Document(scans=tuple(ScanFile(str(scan)) for scan in scans), viewpoints=(view,),
                                                        annotations=(note,)))
    settings = "--at", "stations", "--view", "filled", "--size", SIDE
    done = publish(folder / "whole.pointglass", *settings, "--out", folder / "site")
    assert done.returncode == 0, done.stderr
    return folder / "site", scans


def test_places_are_the_stations_and_notes_and_viewpoints_are_there(published):
    out, _ = published
    data = value_of(out / "scene.js")
    axes = np.array(data["axes"])
    assert [place["name"] for place in data["places"]] == ["Stand 0", "Stand 1"]
    assert np.allclose([axes @ place["position"] + data["origin"] for place in data["places"]], STANDS + AWAY, atol=1e-6)
    (view,), (note,) = data["viewpoints"], data["notes"]
    assert (view["name"], view["place"]) == ("At the wall", 0) and abs(view["yaw"] - 90) < 1e-6
    assert note["title"] == "Crack" and note["picture"] == [800, 600]
    assert np.allclose(axes @ note["position"] + data["origin"], AWAY + (0.0, BOX[1], 0.3), atol=1e-6)
    assert (out / "overview.html").is_file() and (out / "notes" / "000.picture.js").is_file()


def walls(stand, camera):
    """(SIDE, SIDE, 3): where a face's pixels meet the walls, room coordinates."""
    column, row = np.meshgrid(np.arange(SIDE) + 0.5, np.arange(SIDE) + 0.5)
    rays = np.stack([2 * column / SIDE - 1, 2 * row / SIDE - 1, np.ones_like(row)], -1) @ camera.view_rotation
    return hit(stand, rays)


def errors_of(published_face, at, renderer, camera):
    """Mean difference from the painted walls, in levels: of a published face, and of its picture without photographs."""
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(published_face))).convert("RGB"), float)
    without = renderer.render(camera, Settings(view="filled", photos="off"), ("filled",)).image("filled")[..., :3]
    return [np.abs(picture - paint(at)).mean() for picture in (shown, without.astype(float))]


def test_depth_at_turned_stations_is_that_of_the_room_and_photographs_colour_it(published, renderer_of):
    out, scans = published
    renderer = renderer_of(open_scene(scans))
    for number, stand in enumerate(STANDS):
        place = value_of(out / "scene.js")["places"][number]
        packed = value_of(out / "places" / f"{number:03d}.depth.js")["depth"]
        codes, measured = unpacked_depth(base64.b64decode(packed), 6, SIDE)
        depth = DepthScale(place["near"], place["step"]).depths(codes)
        pictures = value_of(out / "places" / f"{number:03d}.full.js")["pictures"]
        errors = []
        for face, camera in enumerate(face_cameras(stand, SIDE)):
            at = walls(stand, camera)
            error = np.abs(depth[face] - (at - stand) @ camera.forward)[measured[face]]
            assert measured[face].any() and np.quantile(error, 0.9) < 0.02
            errors.append(errors_of(pictures[face], at, renderer, face_cameras(stand + AWAY, SIDE)[face]))
        with_photographs, without = np.mean(errors, axis=0)
        assert with_photographs < 0.85 * without


def test_photographs_of_a_folder_colour_what_they_show(published, renderer_of, tmp_path):
    """One that looks along the first face, from the place itself."""
    _, (scan, _) = published
    stand = np.array([0.2, 0.1, 0.3])
    photo, pose = pinhole(stand, 0.0, size=(SIDE, SIDE), fl=SIDE / 2), np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn(0.0)[0], photo.translation
    taken = tmp_path / "taken"
    taken.mkdir()
    (taken / "here.png").write_bytes(photo.blobs["pngImage"])
    frame = {"file_path": "here.png", "w": SIDE, "h": SIDE, "fl_x": SIDE / 2, "transform_matrix": pose.tolist()}
    (taken / "transforms.json").write_text(json.dumps({"frames": [frame]}))
    done = publish(scan, "--photos", taken, "--at", taken / "transforms.json", "--view", "filled", "--second", "none",
                   "--size", SIDE, "--out", tmp_path / "site")  # fmt: skip
    assert done.returncode == 0, done.stderr
    pictures, renderer = value_of(tmp_path / "site" / "places" / "000.full.js")["pictures"], renderer_of(open_scene([scan]))
    errors = [errors_of(picture, walls(stand, camera), renderer, there) for picture, camera, there in
              zip(pictures, face_cameras(stand, SIDE), face_cameras(stand + AWAY, SIDE), strict=True)]  # fmt: skip
    print(np.round(errors, 2))
    with_photograph, without = errors[0]
    assert with_photograph < 0.7 * without


def unpacked(value):
    """The bytes of all that is packed into a script: pictures, and depth as its stream and inflated."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for part in value:
            yield from unpacked(part)
    elif isinstance(value, str) and len(value) > 200 and re.fullmatch(r"[A-Za-z0-9+/]+=*", value):
        data = base64.b64decode(value)
        yield data
        if data[:1] == b"\x78":
            yield zlib.decompress(data)


def test_nothing_in_the_folder_tells_of_the_machine_also_unpacked(published):
    out, _ = published
    telling = [str(Path.home()), str(out.parent), "scans of anna", "stands.e57", "photo.e57", "whole.pointglass", "my.jpg",
               "/tmp/", "Anna Author", "SecretCam", *([getpass.getuser()] if len(getpass.getuser()) > 4 else [])]
    streams = 0
    for file in (file for file in out.rglob("*") if file.is_file() and file.name != "page.js"):  # words of libraries
        packed = list(unpacked(value_of(file))) if file.suffix == ".js" else []
        streams += len(packed)
        for data in (file.read_bytes(), *packed):
            assert not [word for word in telling if word.encode() in data], file
            assert b"EXIF" not in data[:200]
    assert streams > 40
