"""`--photos` with a folder of plain pictures: where they were taken is searched in the scan, told, and kept in the cache."""

import io
import json
import logging

import e57_photo_files
import numpy as np
import pytest
from e57_photo_files import AWAY, pinhole, room_points, turn, write_photos
from PIL import Image

from pointglass.viewer.cli import main
from pointglass.viewer.commands.photo_placing import photo_search
from pointglass.viewer.work.photo_poses import reference_views

pytest.importorskip("cv2")
EQUIVALENT = 0xA405


def jpeg(photo, focal: float | None = None) -> bytes:
    """The picture as a camera writes it.  focal: pixels, in its EXIF."""
    image, out = Image.open(io.BytesIO(photo.blobs["pngImage"])), io.BytesIO()
    exif = Image.Exif()
    if focal is not None:
        exif.get_ifd(0x8769)[EQUIVALENT] = round(focal / np.hypot(*image.size) * 43.27)
    image.save(out, "jpeg", quality=92, exif=exif)
    return out.getvalue()


@pytest.mark.slow
@pytest.mark.usefixtures("own_cache")
def test_plain_pictures_are_placed_in_the_scan_and_colour_it(tmp_path, caplog, monkeypatch, capsys):
    monkeypatch.setattr(e57_photo_files, "paint", e57_photo_files.patches)
    taken = tmp_path / "taken"
    taken.mkdir()
    places = {"one": ((0.4, -0.3, 0.2), 0.6), "two": ((-0.6, 0.5, -0.1), 2.3)}
    for name, (place, yaw) in places.items():
        photo = pinhole(place, yaw, 0.1, size=(640, 480), fl=420.0, name=name)
        (taken / f"{name}.jpg").write_bytes(jpeg(photo, 420.0 if name == "one" else None))
    noise = np.random.default_rng(3).integers(0, 255, (60, 80, 3), dtype=np.uint8)
    Image.fromarray(noise).resize((640, 480)).save(taken / "elsewhere.png")
    (taken / "a.jpg").write_text("no picture")
    scan = write_photos(tmp_path / "room.e57", [], *room_points(400_000))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn(0.5)[0], np.array((0.2, 0.2, 0.1)) + AWAY
    cameras = tmp_path / "cameras.json"
    cameras.write_text(json.dumps({"frames": [{"file_path": "here.png", "w": 160, "h": 120, "fl_x": 110.0,
                                               "transform_matrix": pose.tolist()}]}))
    monkeypatch.setattr(reference_views, "TURNS", ((0.0, 8, 0.0),))  # fewer views: less time
    monkeypatch.setattr(photo_search, "PLACES", 2)
    found = {}
    told = photo_search.told
    monkeypatch.setattr(photo_search, "told", lambda one, name, *unit: found.update({name: one}) or told(one, name, *unit))
    arguments = ["render", str(scan), "--cameras", str(cameras), "--view", "filled", "--photos", str(taken), "--aux"]
    with caplog.at_level(logging.WARNING):
        assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    for name, (place, yaw) in places.items():
        one = found[str(taken / f"{name}.jpg")]
        assert isinstance(one, photo_search.PlacedPhotograph), caplog.text
        matrix = np.array(one.camera_to_world)
        turned = np.degrees(np.arccos(np.clip((np.trace(matrix[:3, :3].T @ turn(yaw, 0.1)[0]) - 1) / 2, -1, 1)))
        assert np.linalg.norm(matrix[:3, 3] - AWAY - place) < 0.06 and turned < 0.5 and abs(one.focal / 420 - 1) < 0.05
        assert one.within is not None and one.within[0] < 0.2 and one.within[1] < 1.0
    assert "elsewhere.png: where it was taken was not found" in caplog.text and "residual" not in caplog.text
    said = capsys.readouterr().err
    assert said.count("one.jpg: taken at") == 1 and "° (95 %)" in said  # no warning
    assert "a.jpg is neither JPEG nor PNG (first bytes b'no p'); export it again; left out" in caplog.text
    assert (np.asarray(Image.open(tmp_path / "out" / "here.provenance.png")) == 4).mean() > 0.1
    monkeypatch.setattr(photo_search.PhotoSearch, "_rendered", None)  # what was found is kept
    assert main([*arguments, "--out", str(tmp_path / "again")]) == 0
    assert (tmp_path / "again" / "here.png").read_bytes() == (tmp_path / "out" / "here.png").read_bytes()
    for name in places:
        (taken / f"{name}.jpg").unlink()
    (taken / "elsewhere.png").unlink()
    for left, text in (("a.jpg", "holds no photograph that can be read"), (None, "holds no photographs: no JPEG or PNG")):
        if left is None:
            (taken / "a.jpg").unlink()
        assert main([*arguments, "--out", str(tmp_path / "never")]) == 2
        assert text in capsys.readouterr().err and not (tmp_path / "never").exists()
