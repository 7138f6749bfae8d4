"""Notes (viewer.work.notes): their titles and links, their files read back, and how they lie over a picture."""

import csv
import io
import json
import zipfile
from dataclasses import replace
from datetime import UTC, datetime
from xml.etree import ElementTree

import numpy as np
import pytest
from documents import random_note
from PIL import Image

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.window.kit import theme
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.notes.annotation import STATUSES, Annotation, is_address
from pointglass.viewer.work.notes.attached_picture import attached_picture
from pointglass.viewer.work.notes.note_bcf import Topic, bcf_bytes
from pointglass.viewer.work.notes.note_table import csv_text
from pointglass.viewer.work.pictures.noted_picture import with_notes
from pointglass.viewer.work.project import read_project, write_project

NOW = datetime(2026, 11, 28, 12, 0, tzinfo=UTC)


def numbers(parent) -> list[float]:
    return [float(parent.findtext(axis)) for axis in "XYZ"]


def test_a_title_is_the_first_line_with_letters_in_it():
    assert Annotation("\n  \n Crack \nsecond", (0.0, 0.0, 0.0)).title(4) == "Crack"
    assert Annotation(" \n", (0.0, 0.0, 0.0)).title(4) == "Note 5"
    title = Annotation("long " * 40, (0.0, 0.0, 0.0)).title(0)
    assert len(title) <= 48 and title.endswith("…")


@pytest.mark.parametrize(("text", "opened"), [
    ("https://example.org/a?b=1#c", True), ("HTTP://localhost:8080", True), ("file:///etc/passwd", False),
    ("javascript:1", False), ("https://", False), ("https://a b", False), (" https://a.org", False), ("https://a.org\n", False),
    ("https://a\x1b[0m", False), ("-https://a.org", False), ("", False),
])  # fmt: skip
def test_only_addresses_of_the_web_are_links(text, opened):
    assert is_address(text) == opened


def test_colours_of_statuses_are_those_of_the_window():
    from pointglass.viewer.window.interaction.notes.note_markers import COLOUR_OF

    for key, status in STATUSES.items():
        colour = theme.OVERLAY_COLOURS[COLOUR_OF[key]]
        assert status.rgb == tuple(round(255 * part) for part in (colour.x, colour.y, colour.z))


def test_pictures_of_notes_are_found_from_wherever_the_project_is(tmp_path, seed):
    random = np.random.default_rng(seed)
    (tmp_path / "a").mkdir()
    document = Document(annotations=(random_note(random, "x", str(tmp_path / "a" / "p.jpg")), random_note(random, "y")))
    write_project(tmp_path / "a" / "w.pointglass", document)
    assert json.loads((tmp_path / "a" / "w.pointglass").read_text())["document"]["annotations"][0]["picture"] == "p.jpg"
    (tmp_path / "a").rename(tmp_path / "b")
    found = read_project(tmp_path / "b" / "w.pointglass").annotations
    assert found[0] == replace(document.annotations[0], picture=str(tmp_path / "b" / "p.jpg")) and found[1].picture == ""


def test_a_project_from_before_notes_had_more_than_a_text_opens_and_stays_as_it_is(tmp_path):
    note = {"text": "old", "position": [1.0, 2.0, 3.0]}
    file = tmp_path / "w.pointglass"
    write_project(file, Document(annotations=(Annotation("old", (1.0, 2.0, 3.0)),)))
    assert json.loads(file.read_text())["document"]["annotations"] == [note]
    assert read_project(file).annotations == (Annotation("old", (1.0, 2.0, 3.0)),)


def test_a_status_that_is_not_known_is_refused_with_the_choices(tmp_path):
    file = tmp_path / "w.pointglass"
    write_project(file, Document(annotations=(Annotation("old", (1.0, 2.0, 3.0)),)))
    data = json.loads(file.read_text())
    data["document"]["annotations"][0]["status"] = "lost"
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match="open, in progress, done"):
        read_project(file)


def test_the_table_has_the_places_and_no_formula(seed):
    random = np.random.default_rng(seed)
    notes = [random_note(random, "=1+1"), random_note(random, 'two\n"lines", é')]
    rows = list(csv.DictReader(io.StringIO(csv_text(notes, "m"), newline="")))
    assert [row["text"] for row in rows] == ["'=1+1", 'two\n"lines", é']
    for note, row in zip(notes, rows, strict=True):
        within = 1e-14 * max(map(abs, note.position))
        assert [float(row[axis]) for axis in "xyz"] == pytest.approx(note.position, rel=0, abs=within)
        assert (row["status"], row["link"], row["made"]) == (STATUSES[note.status].name, note.link, note.made)


@pytest.mark.parametrize("metres", [None, 0.3048])
def test_an_issue_has_the_text_place_view_and_pictures_of_its_note(metres, seed):
    random = np.random.default_rng(seed)
    notes = [random_note(random, "Crack <b>\x00\ud83d\nbehind & above", "photo of it.JPG"), random_note(random, "")]
    notes.append(replace(notes[0], made="", link="file:///etc/passwd"))
    notes.append(notes[2])  # a copy
    topics = [Topic(notes[0], 0, notes[0].view, b"png", b"jpg"), Topic(notes[1], 1, notes[1].view, b"png"),
              Topic(notes[2], 2), Topic(notes[3], 3)]  # fmt: skip
    data = bcf_bytes(topics, metres_per_unit=metres, unit="ft", author="Ä", now=NOW)
    assert data == bcf_bytes(topics, metres_per_unit=metres, unit="ft", author="Ä", now=NOW)
    archive = zipfile.ZipFile(io.BytesIO(data))
    assert ElementTree.fromstring(archive.read("bcf.version")).get("VersionId") == "2.1"
    names = archive.namelist()
    assert len(names) == len(set(names)) and sum(name.endswith("markup.bcf") for name in names) == 4
    folder = notes[0].identity
    topic = ElementTree.fromstring(archive.read(f"{folder}/markup.bcf")).find("Topic")
    order = "ReferenceLink Title Index CreationDate CreationAuthor Description DocumentReference"  # of the schema
    assert [child.tag for child in topic] == order.split()
    assert topic.get("Guid") == folder and topic.get("TopicStatus") == STATUSES[notes[0].status].bcf
    assert topic.findtext("Title") == "Crack <b>\ufffd\ufffd" and "behind & above" in topic.findtext("Description")
    assert topic.findtext("CreationDate") == notes[0].made.replace("+00:00", "Z")
    file = topic.find("DocumentReference").findtext("ReferencedDocument")
    assert archive.read(f"{folder}/{file}") == b"jpg" and archive.read(f"{folder}/snapshot.png") == b"png"
    seen = ElementTree.fromstring(archive.read(f"{folder}/viewpoint.bcfv"))
    camera, scale = seen.find("PerspectiveCamera"), metres or 1.0
    view = notes[0].view.camera(100, 100)
    assert np.allclose(numbers(camera.find("CameraViewPoint")), view.position * scale, rtol=1e-15)
    assert np.allclose(numbers(camera.find("CameraDirection")), view.forward)
    assert abs(np.dot(numbers(camera.find("CameraUpVector")), view.forward)) < 1e-9
    assert float(camera.findtext("FieldOfView")) == notes[0].view.vertical_fov
    assert np.allclose(numbers(seen.find("Lines/Line/StartPoint")), np.array(notes[0].position) * scale, rtol=1e-15)
    bare = ElementTree.fromstring(archive.read(f"{notes[2].identity}/markup.bcf"))
    assert bare.find("Topic/ReferenceLink") is None and bare.find("Viewpoints") is None
    assert bare.findtext("Topic/CreationDate") == "2026-11-28T12:00:00Z"


@pytest.mark.parametrize("channels", [3, 4])
def test_a_note_lies_over_a_picture_where_its_place_is_seen(channels, seed):
    random = np.random.default_rng(seed)
    view = random_note(random, "").view
    camera = view.camera(960, 720)
    picture = random.integers(0, 60, (720, 960, channels), np.uint8)
    pixel = random.uniform([100, 100], [700, 600])
    (place,) = camera.unproject([pixel], np.array([5.0]))
    behind = camera.position - 3 * camera.forward
    notes = [Annotation("crack", vector(place), status) for status in STATUSES][:1] + [Annotation("not seen", vector(behind))]
    made = with_notes(picture, camera, notes)
    column, row = pixel.astype(int)
    assert np.abs(made[row, column, :3].astype(int) - STATUSES["open"].rgb).max() <= 2
    rows, columns = np.nonzero((made != picture).any(axis=2))
    assert rows.min() > row - 60 and rows.max() < row + 60 and columns.max() < column + 120
    assert (made[..., :3].min(axis=2) > 180).sum() > 10, "the title is written"
    assert with_notes(picture, camera, []) is picture


def test_an_attached_picture_is_read_only_if_it_is_one(tmp_path, seed):
    random = np.random.default_rng(seed)
    picture = random.integers(0, 256, (30, 50, 3), np.uint8)
    Image.fromarray(picture).save(tmp_path / "a.png")
    shown, full = attached_picture(str(tmp_path / "a.png"), 100)
    assert np.array_equal(shown, picture) and full == (50, 30)
    assert attached_picture(str(tmp_path / "a.png"), 25)[0].shape == (15, 25, 3)
    (tmp_path / "a.png").rename(tmp_path / "a.txt")
    (tmp_path / "b.png").write_bytes(b"not a picture")
    (tmp_path / "c.jpg").write_bytes(b"\xff\xd8 broken")
    (tmp_path / "d.png").mkdir()
    for name, told in (("a.txt", "attach one of"), ("b.png", "neither JPEG nor PNG"), ("c.jpg", "cannot be decoded"),
                       ("d.png", "not there"), ("e.png", "not there"), ("f\x00.png", "")):
        with pytest.raises(InputError, match=told):
            attached_picture(str(tmp_path / name), 100)
