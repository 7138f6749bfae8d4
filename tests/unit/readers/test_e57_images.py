"""Photographs inside an E57: cameras, poses, panoramas, masks; whatever is damaged is refused by name."""

import io

import numpy as np
import pytest
from cloud_files import SCANS, edited_e57
from e57_photo_files import AWAY, Picture, encoded, panorama, pinhole, room_points, turn, write_photos
from PIL import Image, ImageFile

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers import decoded_picture
from pointglass.viewer.readers.e57 import e57_images
from pointglass.viewer.readers.e57.e57_images import FACES, read_photographs


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
    monkeypatch.setattr(decoded_picture, "MOST_PIXELS", 96 * 72 - 1)
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
