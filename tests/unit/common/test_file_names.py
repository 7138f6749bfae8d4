"""Names from files become names of files: safe, unique, inside their folder."""

from pathlib import Path

import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.file_names import inside, leads_elsewhere, safe_name, unique_names

HOSTILE = ["../../etc/passwd", "/etc/passwd", "..", ".", "", "a/b", "a\\b", "C:\\x", "c:x", "a\0b", "\x1b]0;x\x07", "nul",
"COM1.png",
           "con", "a\u202egnp.exe", "x" * 9000, "\udcff", ".hidden", "a.", "a ", "\n", "ä" * 200, "~", "-rf", "$HOME", "*",
           "a\u0000"]


@pytest.mark.parametrize("name", HOSTILE)
def test_every_name_becomes_one_harmless_part_of_a_path(tmp_path, name):
    made = safe_name(name, "camera")
    assert made and made == Path(made).name and made.isprintable() and not made.startswith(".") and not made.endswith(".")
    assert len(made.encode()) <= 151 and made.split(".")[0].lower() not in ("con", "nul", "com1") and safe_name(made) == made
    path = inside(tmp_path, f"{made}.png")
    path.write_text("picture")
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_ordinary_names_stay():
    for name in ("01-living-room", "frame_00001", "Küche", "IMG_2041.JPG", "a+b", "north.west"):
        assert safe_name(name) == name


def test_no_two_names_are_alike():
    names = unique_names(["a", "A", "a_2", "../a", "", "", "a\0", "_a"], "camera")
    assert len({name.casefold() for name in names}) == len(names) and names[0] == "a"


@pytest.mark.parametrize("name", ["../a.png", "/a.png", "a/b.png", "a\\b.png", "", ".", "..", "a\0.png"])
def test_nothing_is_written_outside_the_folder(tmp_path, name):
    with pytest.raises(InputError, match="no name of a file"):
        inside(tmp_path, name)


def test_paths_that_lead_elsewhere():
    assert all(map(leads_elsewhere, ["/a", "\\a", "../a", "a/../b", "..", "C:\\a", "c:/a", "a\\..\\b"]))
    assert not any(map(leads_elsewhere, ["a", "a/b", "a..b", "Kitchen: north/east", "..a", ""]))
