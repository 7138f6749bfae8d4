"""Photographs inside an E57: cameras, poses, panoramas, masks; whatever is damaged is refused by name."""

import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from cloud_files import SCANS, edited_e57
from PIL import Image, ImageFile

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.e57 import e57_images
from pointglass.viewer.readers.e57.e57_images import FACES, read_photographs

BOX = np.array([2.0, 1.5, 1.2])  # half sizes of the room, metres; z is up
AWAY = np.array([30.0, -12.0, 4.0])  # of the room's middle from the file's origin


@dataclass
class Picture:
    """What one entry of images2D is written from.  values: the numbers of its representation.  blobs: name -> bytes."""

    kind: str = "pinhole"
    values: dict = field(default_factory=dict)
    blobs: dict = field(default_factory=dict)
    quaternion: tuple | None = (1.0, 0.0, 0.0, 0.0)
    translation: tuple = (0.0, 0.0, 0.0)
    name: str = "photo"
    guid: str | None = None
    more: dict = field(default_factory=dict)


def write_photos(path: Path, pictures: list[Picture], xyz: np.ndarray, rgb: np.ndarray) -> Path:
    """One scan without a pose (file coordinates) and images2D."""
    from pye57 import libe57 as e

    file = e.ImageFile(str(path), "w")
    file.extensionsAdd("", e.E57_V1_0_URI)
    file.extensionsAdd("dist", "http://www.libe57.org/E57_LEICA_Camera_Distortion.txt")
    root = file.root()
    root.set("formatName", e.StringNode(file, "ASTM E57 3D Imaging Data File"))
    root.set("guid", e.StringNode(file, "{test}"))
    root.set("versionMajor", e.IntegerNode(file, e.E57_FORMAT_MAJOR))
    root.set("versionMinor", e.IntegerNode(file, e.E57_FORMAT_MINOR))
    data, images = e.VectorNode(file, True), e.VectorNode(file, True)
    root.set("data3D", data)
    root.set("images2D", images)
    scan = e.StructureNode(file)
    data.append(scan)
    scan.set("guid", e.StringNode(file, "{scan 0}"))
    prototype, buffers, columns = e.StructureNode(file), e.VectorSourceDestBuffer(), {}
    for k, axis in enumerate("XYZ"):
        prototype.set(f"cartesian{axis}", e.FloatNode(file, 0.0, e.E57_DOUBLE, e.E57_DOUBLE_MIN, e.E57_DOUBLE_MAX))
        columns[f"cartesian{axis}"] = np.ascontiguousarray(xyz[:, k], np.float64)
    for k, name in enumerate(("Red", "Green", "Blue") if rgb is not None else ()):
        prototype.set(f"color{name}", e.IntegerNode(file, 0, 0, 255))
        columns[f"color{name}"] = np.ascontiguousarray(rgb[:, k], np.float64)
    points = e.CompressedVectorNode(file, prototype, e.VectorNode(file, True))
    scan.set("points", points)
    for name, values in columns.items():
        buffers.append(e.SourceDestBuffer(file, name, values, len(values), True, True))
    writer = points.writer(buffers)
    writer.write(len(xyz))
    writer.close()
    for picture in pictures:
        node, part = e.StructureNode(file), e.StructureNode(file)
        images.append(node)
        node.set("guid", e.StringNode(file, f"{{{picture.name}}}"))
        node.set("name", e.StringNode(file, picture.name))
        if picture.guid:
            node.set("associatedData3DGuid", e.StringNode(file, picture.guid))
        for name, value in picture.more.items():
            node.set(name, e.FloatNode(file, value))
        if picture.quaternion is not None:
            pose = e.StructureNode(file)
            node.set("pose", pose)
            for name, keys, values in (("rotation", "wxyz", picture.quaternion), ("translation", "xyz", picture.translation)):
                child = e.StructureNode(file)
                pose.set(name, child)
                for key, value in zip(keys, values, strict=True):
                    child.set(key, e.FloatNode(file, float(value)))
        node.set(f"{picture.kind}Representation", part)
        for name, value in picture.values.items():
            part.set(name, e.IntegerNode(file, value) if isinstance(value, int) else e.FloatNode(file, value))
        for name, content in picture.blobs.items():
            blob = e.BlobNode(file, len(content))
            part.set(name, blob)
            blob.write(np.frombuffer(content, np.uint8).copy(), 0, len(content))
    file.close()
    return path


def paint(at: np.ndarray) -> np.ndarray:
    """(..., 3) room coordinates -> (..., 3) uint8 colour of the wall there: nowhere the same, smooth but for a checker."""
    smooth = 120 + 60 * np.sin(at * (2.1, 2.9, 3.7) + (0.3, 1.1, 2.0)) + 25 * np.roll(at, 1, -1)
    return np.clip(smooth + 30 * (np.floor(at * 3 + 0.13).sum(-1) % 2)[..., None], 0, 255).astype(np.uint8)


def hit(position: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """Where rays from inside the room meet its walls, room coordinates."""
    with np.errstate(divide="ignore"):
        t = np.where(ray > 0, (BOX - position) / ray, (-BOX - position) / ray).min(-1)
    return position + ray * t[..., None]


def room_points(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """xyz (count, 3), in file coordinates, and rgb of points on the room's walls."""
    ray = np.random.default_rng(seed).normal(size=(count, 3))
    at = hit(np.zeros(3), ray)
    return at + AWAY, paint(at)


def turn(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> tuple[np.ndarray, tuple]:
    """(3, 3) camera-to-world of a camera looking level along +x, turned; and its quaternion w, x, y, z."""
    from scipy.spatial.transform import Rotation

    level = Rotation.from_matrix(np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]]))  # right -y, up z, forward x
    rotation = Rotation.from_euler("ZYX", [yaw, -pitch, roll]) * level
    x, y, z, w = rotation.as_quat()
    return rotation.as_matrix(), (w, x, y, z)


def encoded(picture: np.ndarray, kind: str = "png") -> bytes:
    out = io.BytesIO()
    Image.fromarray(picture).save(out, "jpeg" if kind == "jpeg" else "png", **({"quality": 95} if kind == "jpeg" else {}))
    return out.getvalue()


def pinhole(position, yaw: float, pitch: float = 0.0, *, roll: float = 0.0, size=(96, 72), fl: float = 60.0, offset=(0.0, 0.0),
            coding="png", name="photo", gain=1.0, **changes) -> Picture:  # fmt: skip
    """A photograph of the room, exact at pixel centres."""
    width, height = size
    matrix, quaternion = turn(yaw, pitch, roll)
    cx, cy = width / 2 + offset[0], height / 2 + offset[1]
    i, j = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    ray = np.stack([(i - cx) / fl, (cy - j) / fl, -np.ones_like(i)], -1) @ matrix.T
    seen = np.clip(paint(hit(np.asarray(position, float), ray)) * gain, 0, 255).astype(np.uint8)
    values = {"imageWidth": width, "imageHeight": height,
              "focalLength": 0.02, "pixelWidth": 0.02 / fl, "pixelHeight": 0.02 / fl,
              "principalPointX": cx, "principalPointY": cy}  # fmt: skip
    made = Picture(values=values, blobs={"jpegImage" if coding == "jpeg" else "pngImage": encoded(seen, coding)},
                   quaternion=quaternion, translation=tuple(np.asarray(position) + AWAY), name=name)  # fmt: skip
    for key, value in changes.items():
        setattr(made, key, value)
    return made


def panorama(position, yaw: float, width: int = 512, name="round") -> Picture:
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("ZYX", [yaw, 0.1, -0.05])
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(width // 2) + 0.5)
    azimuth, elevation = (width / 2 - column) * 2 * np.pi / width, (width / 4 - row) * 2 * np.pi / width
    ray = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)
    seen = paint(hit(np.asarray(position, float), ray @ rotation.as_matrix().T))
    x, y, z, w = rotation.as_quat()
    pitch = 2 * np.pi / width
    values = {"imageWidth": width, "imageHeight": width // 2, "pixelWidth": pitch, "pixelHeight": pitch}
    return Picture("spherical", values, {"pngImage": encoded(seen)}, (w, x, y, z), tuple(np.asarray(position) + AWAY), name)


def colour_errors(photo, xyz: np.ndarray, rgb: np.ndarray) -> np.ndarray:
    """(n,) largest channel difference between points and the pixels they fall on, by the photo's own camera."""
    local = (xyz - photo.camera_to_world[:3, 3]) @ photo.camera_to_world[:3, :3]
    ahead = local[:, 2] < -0.1
    column = photo.cx - photo.fl * local[:, 0] / local[:, 2]
    row = photo.cy + photo.fl * local[:, 1] / local[:, 2]
    height, width = photo.picture.shape[:2]
    inside = ahead & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    at = row[inside].astype(int), column[inside].astype(int)
    valid = np.ones(inside.sum(), bool) if photo.valid is None else photo.valid[at]
    return np.abs(photo.picture[at].astype(int) - rgb[inside].astype(int)).max(1)[valid]


@pytest.fixture(scope="module")
def points():
    return room_points(20_000)


def test_pinhole_gives_back_camera_pose_and_scan(points, tmp_path):
    given = pinhole((0.3, -0.4, 0.2), 0.7, 0.3, roll=0.2, offset=(4.0, -6.5), name="north", guid="{scan 0}")
    photos, warnings = read_photographs(write_photos(tmp_path / "a.e57", [given], *points))
    (photo,) = photos
    assert warnings == [] and photo.name == "north" and photo.scan == 0 and photo.valid is None
    assert photo.picture.shape == (72, 96, 3) and photo.picture.dtype == np.uint8
    assert np.allclose((photo.fl, photo.cx, photo.cy), (60.0, 52.0, 29.5))
    assert np.allclose(photo.camera_to_world[:3, :3], turn(0.7, 0.3, 0.2)[0])
    assert np.allclose(photo.camera_to_world[:3, 3], AWAY + (0.3, -0.4, 0.2))


@pytest.mark.parametrize("kind", ["png", "jpeg"])
def test_points_fall_on_their_own_colours(points, tmp_path, kind):
    given = pinhole((0.3, -0.4, 0.2), 2.2, -0.3, roll=0.4, offset=(3.0, 2.0), size=(384, 288), fl=240.0, coding=kind)
    (photo,), _ = read_photographs(write_photos(tmp_path / "a.e57", [given], *points))
    errors = colour_errors(photo, *points)
    assert len(errors) > 1000 and np.median(errors) <= 3 and np.mean(errors > 15) < 0.06  # the checker's edges
    flipped = photo.camera_to_world @ np.diag([1.0, -1.0, -1.0, 1.0])  # the other convention would be wrong
    wrong = colour_errors(type(photo)(photo.name, photo.picture, photo.fl, photo.cx, photo.cy, flipped), *points)
    assert np.median(wrong) > 20


def test_larger_pictures_are_reduced_with_their_camera(points, tmp_path):
    given = pinhole((0.3, -0.4, 0.2), 2.2, size=(1500, 1100), fl=900.0, offset=(30.0, -20.0), coding="jpeg")
    (photo,), _ = read_photographs(write_photos(tmp_path / "a.e57", [given], *points), longest=400)
    assert photo.picture.shape[1] == 400 and np.isclose(photo.fl, 240.0) and np.isclose(photo.cx, 780 * 400 / 1500)
    errors = colour_errors(photo, *points)
    assert np.median(errors) <= 4 and np.mean(errors > 20) < 0.05


def test_non_square_pixels_are_resampled_to_square_ones(points, tmp_path):
    given = pinhole((0.1, 0.2, 0.0), 1.0, size=(384, 288), fl=240.0)
    tall = np.asarray(Image.open(io.BytesIO(given.blobs["pngImage"]))).repeat(2, axis=0)
    given.blobs["pngImage"] = encoded(tall)
    given.values |= {"imageHeight": 576, "pixelHeight": 0.02 / 480, "principalPointY": 288.0}
    (photo,), _ = read_photographs(write_photos(tmp_path / "a.e57", [given], *points))
    assert photo.picture.shape == (288, 384, 3) and np.isclose(photo.fl, 240.0)
    assert np.median(colour_errors(photo, *points)) <= 3


def test_panorama_becomes_cube_faces_whose_points_have_their_colours(points, tmp_path):
    path = write_photos(tmp_path / "a.e57", [panorama((0.4, 0.1, -0.2), 0.6, 1024)], *points)
    photos, warnings = read_photographs(path)
    assert warnings == [] and [p.name for p in photos] == [f"round {face}" for face in FACES]
    seen = 0
    for photo in photos:
        assert np.isclose(np.linalg.det(photo.camera_to_world[:3, :3]), 1.0)
        errors = colour_errors(photo, *points)
        seen += len(errors)
        assert np.median(errors) <= 4 and np.mean(errors > 20) < 0.06
    assert abs(seen - len(points[0])) < 5  # together the faces see every direction once
    smaller, _ = read_photographs(path, longest=96)
    assert smaller[0].picture.shape == (96, 96, 3) and np.median(colour_errors(smaller[3], *points)) <= 8


@pytest.mark.parametrize("around", [True, False])
def test_a_panorama_is_sampled_between_the_middles_of_its_pixels(seed, around):
    rng = np.random.default_rng(seed)
    picture, inside = rng.integers(0, 256, (7, 12, 3)).astype(np.uint8), rng.random((7, 12)) < 0.8
    column, row = rng.uniform(0, 12, (40, 50)), rng.uniform(0, 7, (40, 50))
    face, valid = e57_images._sampled(picture, inside, column, row, around)
    for (j, i), x, y in zip(np.ndindex(40, 50), column.ravel(), row.ravel(), strict=True):
        left, top = int(np.floor(x - 0.5)), int(np.floor(y - 0.5))
        across, down = x - 0.5 - left, y - 0.5 - top
        sides = [(left + k) % 12 if around else np.clip(left + k, 0, 11) for k in (0, 1)]
        lines = [np.clip(top + k, 0, 6) for k in (0, 1)]
        a, b = (picture[line, sides[0]] * (1 - across) + picture[line, sides[1]] * across for line in lines)
        assert np.abs(face[j, i] - (a * (1 - down) + b * down)).max() < 0.51
        assert valid[j, i] == inside[int(y), int(x)]


def test_part_of_a_sphere_is_valid_only_inside_its_range(points, tmp_path):
    whole = panorama((0.0, 0.0, 0.0), 0.0, 512)
    picture = np.asarray(Image.open(io.BytesIO(whole.blobs["pngImage"])))
    whole.blobs["pngImage"] = encoded(np.ascontiguousarray(picture[80:176, 128:384]))  # 67 degrees high, 180 around
    whole.values |= {"imageWidth": 256, "imageHeight": 96}
    photos, _ = read_photographs(write_photos(tmp_path / "a.e57", [whole], *points))
    named = {photo.name.split()[-1]: photo for photo in photos}
    assert "back" not in named and "front" in named
    front = named["front"]
    assert front.valid is not None and front.valid[len(front.valid) // 2].all() and not front.valid[0, 80]
    assert np.median(colour_errors(front, *points)) <= 4


def test_whole_spheres_with_impossible_pixel_sizes_are_read_with_a_warning(points, tmp_path):
    given = panorama((0.4, 0.1, -0.2), 0.6)
    given.values |= {"pixelWidth": 5e-6, "pixelHeight": 5e-6}
    photos, warnings = read_photographs(write_photos(tmp_path / "a.e57", [given], *points))
    assert len(photos) == 6 and "'round'" in warnings[0] and "5e-06" in warnings[0]
    assert np.median(colour_errors(photos[0], *points)) <= 6


def test_masks_limit_the_valid_pixels(points, tmp_path):
    given = pinhole((0.3, -0.4, 0.2), 0.7)
    mask = np.zeros((72, 96), np.uint8)
    mask[10:60, 20:80] = 1
    given.blobs["imageMask"] = encoded(mask)
    (photo,), _ = read_photographs(write_photos(tmp_path / "a.e57", [given], *points))
    assert np.array_equal(photo.valid, mask > 0)


@pytest.mark.parametrize(("change", "told"), [
    ({"kind": "visualReference"}, "visual reference"), ({"kind": "cylindrical"}, "cylindrical"),
    ({"quaternion": None}, "no usable pose"), ({"quaternion": (0.0, 0.0, 0.0, 0.0)}, "no usable pose"),
    ({"more": {"dist:distortion": 0.1}}, "distortion"),
])  # fmt: skip
def test_pictures_without_a_known_camera_are_skipped_by_name(points, tmp_path, change, told):
    good = pinhole((0.3, -0.4, 0.2), 0.7)
    photos, warnings = read_photographs(
        write_photos(tmp_path / "a.e57", [pinhole((0, 0, 0), 0.0, name="odd", **change), good], *points)
    )
    assert [p.name for p in photos] == ["photo"] and len(warnings) == 1
    assert "'odd'" in warnings[0] and told in warnings[0] and "skipped" in warnings[0]


def _refused(tmp_path, points, picture: Picture) -> str:
    with pytest.raises(InputError) as caught:
        read_photographs(write_photos(tmp_path / "a.e57", [picture], *points))
    message = str(caught.value)
    assert "'bad'" in message and "a.e57" in message and "\n" not in message
    return message


@pytest.mark.parametrize("kind", ["png", "jpeg"])
def test_damaged_pictures_and_other_formats_are_refused_by_name(points, tmp_path, kind):
    given = pinhole((0, 0, 0), 0.0, coding=kind, name="bad", size=(200, 160))
    (key, content), *_ = given.blobs.items()
    for damaged in (content[: len(content) // 2], content[:4], b"GIF89a" + content, b"\0" * 500):
        given.blobs[key] = damaged
        assert "export it again" in _refused(tmp_path, points, given)


@pytest.mark.parametrize(("values", "told"), [
    ({"imageWidth": 95}, "95x72"), ({"focalLength": -0.02}, "-0.02"), ({"pixelWidth": -1e-4}, "pixelWidth"),
    ({"focalLength": 2e-6}, "focal length"), ({"principalPointX": 1e9}, "principal point"),
    ({"pixelHeight": 0.0}, "pixelHeight"),
])  # fmt: skip
def test_impossible_cameras_are_refused_by_name(points, tmp_path, values, told):
    given = pinhole((0, 0, 0), 0.0, name="bad")
    given.values |= values
    assert told in _refused(tmp_path, points, given)


def test_missing_fields_and_pictures_are_refused_by_name(points, tmp_path):
    given = pinhole((0, 0, 0), 0.0, name="bad")
    del given.values["focalLength"]
    assert "no focalLength" in _refused(tmp_path, points, given)
    given = pinhole((0, 0, 0), 0.0, name="bad", blobs={})
    assert "neither" in _refused(tmp_path, points, given)
    given = panorama((0, 0, 0), 0.0, name="bad")
    given.values["pixelWidth"] = 0.1
    assert "degrees" in _refused(tmp_path, points, given)
    for value in (1e-320, 1e308):
        given.values["pixelHeight"] = value
        with np.errstate(all="raise", under="ignore"):
            assert "degrees" in _refused(tmp_path, points, given)


def test_image_nodes_of_an_unexpected_type_are_refused_or_give_a_warning(points, tmp_path):
    for name, told in (("pixelWidth", "focal length"), ("pngImage", "its pngImage is not a Blob"),
                       ("pinholeRepresentation", ""), ("pose", ""), ("images2D", None)):  # fmt: skip
        tag = name.encode()
        path = write_photos(tmp_path / "a.e57", [pinhole((0, 0, 0), 0.3)], *points)
        edited_e57(path, (rb"<%b [^>]*/>|<%b .*?</%b>" % (tag, tag, tag), b'<%b type="Integer">5</%b>' % (tag, tag)))
        if told:
            with pytest.raises(InputError, match=told):
                read_photographs(path)
        else:
            photos, warnings = read_photographs(path)
            assert photos == [] and len(warnings) == (0 if told is None else 1)


def test_the_size_is_checked_before_decoding(points, tmp_path, monkeypatch):
    given = pinhole((0, 0, 0), 0.0, name="bad")
    monkeypatch.setattr(e57_images, "MOST_PIXELS", 96 * 72 - 1)
    monkeypatch.setattr(ImageFile.ImageFile, "load", lambda self: pytest.fail("decoded"))
    assert "96x72" in _refused(tmp_path, points, given)


def test_if_there_are_too_many_pictures_some_are_picked_evenly(points, tmp_path):
    given = [pinhole((0, 0, 0), 0.1 * n, name=f"p{n}", size=(32, 24)) for n in range(10)]
    photos, warnings = read_photographs(write_photos(tmp_path / "a.e57", given, *points), most=4)
    assert [p.name for p in photos] == ["p0", "p3", "p5", "p8"] and "4 of 10" in warnings[0]


def test_a_real_file_with_a_visual_reference_has_no_camera():
    path = SCANS / "pumpA.e57"
    if not path.is_file():
        pytest.skip(f"{path} is not there: real scans are never committed")
    photos, warnings = read_photographs(path)
    assert photos == [] and "pumpVisual" in warnings[0]
