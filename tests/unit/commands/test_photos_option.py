"""Photographs colour pictures: a painted room thinned to points a hand apart, written as E57 with and without photographs."""

import json

import numpy as np
import pytest
from e57_photo_files import AWAY, hit, paint, panorama, pinhole, room_points, turn, write_photos
from PIL import Image
from untyped import any_typed

import pointglass
from pointglass.viewer.cli import main

EYE, YAW, SIZE, FOCAL = np.array([-0.3, 0.2, 0.1]), 0.5, (160, 120), 110.0


def photographs(gain=1.0):
    return [pinhole((0.4, -0.3, 0.2), 0.6, size=(320, 240), fl=190.0, name="a", gain=gain),
            pinhole((-0.6, 0.5, -0.1), 0.3, size=(320, 240), fl=190.0, name="b"),
            panorama((0.2, 0.1, 0.3), 0.4, 1024, name="c")]  # fmt: skip


def cameras(path):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn(YAW)[0], EYE + AWAY
    frame = {"file_path": "here.png", "w": SIZE[0], "h": SIZE[1], "fl_x": FOCAL, "transform_matrix": pose.tolist()}
    path.write_text(json.dumps({"frames": [frame]}))
    return path


def truth():
    i, j = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    ray = np.stack([(i - SIZE[0] / 2) / FOCAL, (SIZE[1] / 2 - j) / FOCAL, -np.ones_like(i)], -1) @ turn(YAW)[0].T
    return paint(hit(EYE, ray)).astype(float)


def rendered(scan, folder, *more):
    """The filled picture, (H, W, 3) float, its provenance, and the texts of its file."""
    out = folder / "out"
    place = cameras(folder / "transforms.json") if not (folder / "transforms.json").exists() else folder / "transforms.json"
    assert main(["render", str(scan), "--cameras", str(place), "--view", "filled", "--out", str(out), "--aux", *more]) == 0
    picture = np.asarray(Image.open(out / "here.png").convert("RGB")).astype(float)
    return picture, np.asarray(Image.open(out / "here.provenance.png")), str(any_typed(Image.open(out / "here.png")).text)


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photographed")
    xyz, rgb = room_points(3000)
    return write_photos(folder / "with.e57", photographs(), xyz, rgb), write_photos(folder / "without.e57", [], xyz, rgb)


def error(picture, where):
    return float(np.sqrt(np.mean((picture - truth())[where] ** 2)))


@pytest.mark.usefixtures("own_cache")
def test_photographs_of_an_e57_bring_detail_between_the_points(scans, tmp_path, caplog):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    coloured, origin, _ = rendered(scans[0], tmp_path / "a")
    plain, before, text_off = rendered(scans[0], tmp_path / "b", "--photos", "off")
    where = origin == 4
    assert where.mean() > 0.5 and not (before == 4).any()
    assert error(coloured, where) < 0.5 * error(plain, where)
    assert "left out" not in caplog.text and "turned" not in caplog.text
    (tmp_path / "c").mkdir()
    without = rendered(scans[1], tmp_path / "c")[2]
    (tmp_path / "d").mkdir()
    assert rendered(scans[1], tmp_path / "d", "--photos", "off")[0].tobytes() == plain.tobytes()
    assert "photos" not in without and "photos" in text_off  # a picture without photographs says nothing of them


@pytest.mark.usefixtures("own_cache")
def test_a_photograph_elsewhere_is_left_out_and_named_and_one_turned_by_a_degree_is_turned_back(tmp_path, caplog):
    good = photographs()
    turned = pinhole((0.4, -0.3, 0.2), 0.6, size=(320, 240), fl=190.0, name="turned")
    turned.quaternion = turn(0.6 + np.radians(0.6))[1]
    other = pinhole((0.4, -0.3, 0.2), 0.6 + 2.0, size=(320, 240), fl=190.0, name="elsewhere")
    other.quaternion = turn(0.6)[1]
    scan = write_photos(tmp_path / "bad.e57", [good[2], turned, other], *room_points(3000))
    coloured, origin, _ = rendered(scan, tmp_path)
    assert "photograph 'elsewhere' does not fit the points" in caplog.text
    assert "photograph 'turned': its pose was turned by 0." in caplog.text
    assert (origin == 4).mean() > 0.5 and error(coloured, origin == 4) < 20


@pytest.mark.usefixtures("own_cache")
def test_a_folder_with_cameras_gives_the_photographs(scans, tmp_path, capsys):
    taken = tmp_path / "taken"
    (taken / "images").mkdir(parents=True)
    frames = []
    for photo in photographs()[:2]:
        (taken / "images" / f"{photo.name}.png").write_bytes(photo.blobs["pngImage"])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn({"a": 0.6, "b": 0.3}[photo.name])[0], photo.translation
        frames.append({"file_path": f"images/{photo.name}.png", "w": 320, "h": 240, "fl_x": 190.0,
                       "transform_matrix": pose.tolist()})
    absent = frames[0] | {"file_path": "images/away.png"}
    (taken / "transforms.json").write_text(json.dumps({"frames": [*frames, absent]}))
    _, origin, _ = rendered(scans[1], tmp_path, "--photos", str(taken))
    assert (origin == 4).mean() > 0.3
    assert capsys.readouterr().err.count("taken: a camera has no photograph there: away\n") == 1
    assert main(["render", str(scans[1]), "--cameras", str(tmp_path / "transforms.json"), "--out", str(tmp_path / "no"),
                 "--photos", str(tmp_path / "nowhere")]) == 2  # fmt: skip
    assert "--photos" in (said := capsys.readouterr().err) and "nowhere" in said and not (tmp_path / "no").exists()


@pytest.mark.parametrize("command", ["render", "video", "publish"])
def test_a_bad_folder_is_refused_before_the_scan_is_opened(tmp_path, capsys, command):
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken.las").write_bytes(b"no scan")  # opening it would be another error
    path = str(cameras(tmp_path / "transforms.json"))
    place = {"render": ["--cameras", path], "video": ["--path", path], "publish": []}[command]
    for folder, said in (("nix", "no such folder"), ("empty", "holds no photographs")):
        for workers in ([], ["--workers", "2"]):
            given = [command, str(tmp_path / "broken.las"), *place, "--photos", str(tmp_path / folder), "--view", "filled"]
            assert main([*given, "--out", str(tmp_path / "out"), *workers]) == 2
            assert said in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_python_refuses_a_bad_folder_before_the_first_picture_is_prepared(tmp_path):
    scan = pointglass.from_points(*room_points(500))
    with pytest.raises(pointglass.InputError, match="no such folder"):
        scan.render(pointglass.look_at(AWAY, AWAY + (1, 0, 0), size=(64, 48)), view="filled", photos=str(tmp_path / "nix"))
    assert scan._drawing is None
