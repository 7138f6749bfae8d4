"""Pictures inside an E57 as files: all are listed and decoded, also those without a pose; their names make safe file names."""

import json
from dataclasses import replace

import numpy as np
import pytest
from e57_photo_files import pinhole, room_points, write_photos

from pointglass.viewer.cli import main
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.e57.e57_pictures import picture_file, picture_of, stored_pictures
from pointglass.viewer.window.interaction.stations.picture_viewer import file_name


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """An E57 with a photograph that has a pose and one that has none, and the bytes of both."""
    given = [pinhole((0.3, -0.4, 0.2), 0.7, name="placed", coding="jpeg"),
             pinhole((0, 0, 0), 0.0, name="../..\\of: the\x9b2J pump?", kind="visualReference")]  # fmt: skip
    path = write_photos(tmp_path_factory.mktemp("e57") / "a.e57", given, *room_points(2000))
    return path, [next(iter(one.blobs.values())) for one in given]


def test_all_pictures_are_listed_and_their_files_are_given_back(scan):
    path, files = scan
    placed, without = stored_pictures(path)
    assert (placed.name, placed.placed, placed.kind) == ("placed", True, "pinhole")
    assert not without.placed and (without.width, without.height) == (96, 72)
    assert picture_file(placed) == (files[0], ".jpg") and picture_file(without) == (files[1], ".png")
    picture, full = picture_of(without, 48)
    assert full == (96, 72) and picture.shape == (36, 48, 3) and picture.dtype == np.uint8 and picture.std() > 5
    with pytest.raises(InputError, match="not there any more"):
        picture_file(replace(placed, number=7))


def test_the_name_of_its_file_stays_in_its_folder(scan):
    name = file_name(stored_pictures(scan[0])[1].name)
    assert name.isprintable() and not set('/\\:?"') & set(name) and name.strip(". ") == name and "pump" in name


def test_info_counts_and_names_them(scan, capsys):
    assert main(["info", str(scan[0]), "--no-cache"]) == 0
    told = capsys.readouterr().out
    assert "2 photographs, 1 without a pose: placed (96 x 72)" in told
    assert main(["info", str(scan[0]), "--no-cache", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["photographs"]
    assert [(one["pose"], one["geometry"]) for one in found] == [(True, "pinhole"), (False, "visualReference")]
