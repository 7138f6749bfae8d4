"""A saved picture says how it was made, exactly enough to draw it again."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.files import write_png
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import Box, Slab
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.work.pictures.shot_metadata import KEY, Shot, camera_line, differences, parse_camera_line, read_shot


def shot(seed=0):
    rng = np.random.default_rng(seed)
    place = rng.uniform(-1e6, 1e6, 3)
    camera = from_fov(97, 61, rng.uniform(20, 120), look_at(place, place + rng.normal(size=3)), "a view, with \"quotes\" and ü")
    spec = PictureSpec(camera, Settings(view="filled", detail=0.3, lod=1.7), background="sky")
    return Shot(spec, "as-scanned", ("a.laz", "b.e57"), 1234, "", "9.9")


def save(path, text):
    write_png(path, np.zeros((4, 5, 3), np.uint8), {KEY: text})
    return path


@pytest.mark.parametrize("seed", range(5))
def test_what_is_written_comes_back_to_the_bit(tmp_path, seed):
    given = shot(seed)
    found = read_shot(save(tmp_path / "a.png", given.text()))
    assert found == given and found.text() == given.text()
    camera = given.spec.camera
    assert found.spec.camera.name == camera.name
    line = parse_camera_line(camera_line(camera))
    assert line.key == camera.key and "\n" not in camera_line(camera)


def test_edits_and_comparisons_come_back_and_the_keys_stay_those_of_the_format(tmp_path):
    """Pictures of earlier versions are read, and theirs read pictures of this one."""
    edits = Edits(clips=(Box((1.0, 2.0, 3.0), (1.0, 1.0, 1.0)), Slab((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.5, removes=True)),
                  hidden_stations=(2, 5), look=Look(exposure=0.5), lock_measured=True, ghosts="dimmed")
    given = replace(shot(), spec=replace(shot().spec, edits=edits, views=("filled", "raw"), split_at=0.3))
    assert read_shot(save(tmp_path / "a.png", given.text())) == given
    found = json.loads(given.text())
    assert list(found) == ["version", "scans", "points", "exposures", "background", "weights", "settings", "camera",
                           "alterations", "comparison"]
    assert list(found["alterations"]) == ["clips", "hidden_stations", "up", "look", "lock_measured", "ghosts"]
    assert found["settings"]["view"] == "filled" and found["comparison"] == {"view": "raw", "split_at": 0.3}
    bad = {"alterations": [{"up": [0.0, 0.0, 2.0]}, {"hidden_stations": [-1]}, {"unknown": 1}],
           "comparison": [{"view": "x"}, {"view": "raw", "split_at": 2}]}
    for key, values in bad.items():
        for value in values:
            with pytest.raises(InputError, match="damaged"):
                read_shot(save(tmp_path / "a.png", json.dumps(found | {key: value})))


def test_pictures_without_or_with_a_damaged_description_are_refused(tmp_path):
    Image.new("RGB", (3, 3)).save(tmp_path / "plain.png")
    with pytest.raises(InputError, match="does not say how it was made"):
        read_shot(tmp_path / "plain.png")
    (tmp_path / "none.png").write_bytes(b"no png")
    with pytest.raises(InputError, match="no readable PNG"):
        read_shot(tmp_path / "none.png")
    whole = json.loads(shot().text())
    for broken in ("{", "[]", json.dumps(whole | {"camera": {}}), json.dumps(whole | {"settings": {"view": "x"}}),
                   json.dumps(whole | {"background": "pink"}), json.dumps({**whole, "camera": {**whole["camera"], "fx": "5"}})):
        with pytest.raises(InputError):
            read_shot(save(tmp_path / "a.png", broken))
    with pytest.raises(InputError, match="no camera"):
        parse_camera_line("hello")


def test_moved_scans_come_back_and_a_crooked_matrix_is_refused(tmp_path):
    moved = ((0.0, -1.0, 0.0, 5.0), (1.0, 0.0, 0.0, 1e6), (0.0, 0.0, 1.0, -2.5), (0.0, 0.0, 0.0, 1.0))
    given = replace(shot(), moves=(None, moved))
    assert read_shot(save(tmp_path / "a.png", given.text())) == given
    assert differences(given, shot()) == ["its scans were at other places, where a project had moved them"]
    for wrong in ([[[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]], "x", [[1, 2]], 5):
        with pytest.raises(InputError, match="damaged"):
            read_shot(save(tmp_path / "a.png", json.dumps(json.loads(given.text()) | {"moves": wrong})))


def test_what_may_change_the_picture_is_named():
    given = shot()
    assert differences(given, given) == []
    other = replace(given, points=5, scans=("c.ply",), weights="abc", version="10")
    assert len(differences(given, other)) == 4
