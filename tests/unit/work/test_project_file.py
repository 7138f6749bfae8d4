"""Project files: opened exactly as left, moved with their scans, and damaged ones refused in one line."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from documents import random_document

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.moved_scans import MissingScans, difference
from pointglass.viewer.work.project import VERSION, places_in, read_project, scans_of, write_project


def test_a_project_opens_as_it_was_left(tmp_path, seed):
    random = np.random.default_rng(seed)
    for number in range(10):
        document = random_document(random, [str(tmp_path / "a.laz"), str(tmp_path / "sub" / "b ü.e57")])
        path = tmp_path / f"{number}.pointglass"
        write_project(path, document)
        assert read_project(path) == document


def test_paths_follow_a_project_moved_with_its_scans(tmp_path):
    old = tmp_path / "old"
    (old / "work").mkdir(parents=True)
    (old / "scans").mkdir()
    (old / "scans" / "a.laz").touch()
    scans = ScanFile(str(old / "scans" / "a.laz")), ScanFile("/far/away/b.laz")
    write_project(old / "work" / "p.pointglass", Document(scans, settings=Settings(photos=str(old / "taken"))))
    shutil.move(old, tmp_path / "new")
    read = read_project(tmp_path / "new" / "work" / "p.pointglass")
    near, far = read.scans
    assert Path(read.settings.photos).resolve() == tmp_path / "new" / "taken"
    assert (tmp_path / "new" / "scans" / "a.laz").samefile(near.path)
    assert far.path == "/far/away/b.laz"


def test_a_failed_write_leaves_the_older_file(tmp_path, monkeypatch):
    path = tmp_path / "p.pointglass"
    write_project(path, Document())
    before = path.read_bytes()
    monkeypatch.setattr("pathlib.Path.replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(InputError, match="No space left"):
        write_project(path, Document((ScanFile("x.laz"),)))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["p.pointglass"]


def changed(data, random):
    """A JSON value with one random place in it replaced by something of another kind, or removed."""
    spots = []

    def walk(node):
        for key in list(node) if isinstance(node, dict) else range(len(node)):
            spots.append((node, key))
            if isinstance(node[key], (dict, list)):
                walk(node[key])

    walk(data)
    node, key = spots[int(random.integers(len(spots)))]
    odd = [None, "x", -1, 1e308, 10**400, True, [], {}, [[]], float("nan"), {"type": "Box"}]
    if random.random() < 0.2:
        del node[key]
    else:
        node[key] = odd[int(random.integers(len(odd)))]
    return data


def test_damaged_projects_are_refused_in_one_line_or_read(tmp_path, seed):
    random = np.random.default_rng(seed)
    path = tmp_path / "p.pointglass"
    write_project(path, random_document(random, ["a.laz"]))
    good, refused = path.read_bytes(), 0
    for _ in range(400):
        if random.random() < 0.3:
            data = bytearray(good)
            data[int(random.integers(len(data)))] = int(random.integers(256))
            path.write_bytes(bytes(data[: int(random.integers(len(data)))] if random.random() < 0.3 else data))
        else:
            path.write_text(json.dumps(changed(json.loads(good), random)))
        try:
            assert isinstance(read_project(path), Document)
        except InputError as error:
            refused += 1
            assert str(path) in str(error) and "\n" not in str(error) and len(str(error)) < 1000
    assert refused > 100


@pytest.mark.parametrize("text, said", [
    ("", "damaged"), ("[1]", "no project file"), ("[" * 100_000, "damaged"), ('{"pointglass_project": true}', "version number"),
    ('{"pointglass_project": 1}', "document: null: expected an object"),
    (f'{{"pointglass_project": {VERSION + 1}, "document": {{}}}}', "update pointglass"),
    ('{"pointglass_project": 1, "document": {"shoe": 1}}', "document.shoe: unknown"),
    ('{"pointglass_project": 1, "document": {"scans": [{"path": 3}]}}', r"document.scans\[0\].path: 3: expected a text"),
    ('{"pointglass_project": 1, "document": {"settings": {"view": "xray"}}}', "document.settings: view 'xray'"),
    ('{"pointglass_project": 1, "document": {"clips": [{"type": "Ball"}]}}', "'Ball': expected one of Box, Slab"),
    ('{"pointglass_project": 1, "document": {"clips": [{"type": "Box", "half": [1, 1, 1]}]}}', "centre is missing"),
    ('{"pointglass_project": 1, "document": {"clips": [{"type": "Box", "centre": [0, 0, 0], "half": [1e30, 1, 1]}]}}',
     "above 0 and up to 1e.12"),
])
def test_bad_projects_say_what_is_wrong(tmp_path, text, said):
    path = tmp_path / "p.pointglass"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        read_project(path)
    assert str(path) in str(caught.value)


def test_half_a_character_in_a_name_is_escaped_so_that_every_name_can_be_drawn_and_written(tmp_path, seed):
    """JSON can hold an unpaired surrogate, which imgui refuses with a TypeError."""
    path = tmp_path / "a.pointglass"
    document = random_document(np.random.default_rng(seed), [str(tmp_path / "odd\udce9.ply")])
    write_project(path, document)
    text = path.read_text("utf-8")
    data = json.loads(text)
    changed = 0

    def halved(value):
        nonlocal changed
        if isinstance(value, dict):
            for key, item in value.items():
                if key in ("name", "text", "scan") and isinstance(item, str):
                    value[key], changed = "x\ud800" + item, changed + 1
                else:
                    halved(item)
        elif isinstance(value, list):
            for item in value:
                halved(item)

    halved({key: value for key, value in data["document"].items() if key not in ("scans", "settings")})
    path.write_text(json.dumps(data))
    read = read_project(path)
    assert changed > 10 and read.scans[0].path.endswith("odd\udce9.ply"), "a path is not changed"
    names = [*(item.name for item in (*read.measurements, *read.viewpoints, *read.clips)),
             *(point.scan for item in read.measurements for point in item.points),
             *(key.view.name for key in read.path.keyframes), *(note.text for note in read.annotations)]  # fmt: skip
    for name in names:
        assert name.startswith("x\\ud800") and name.encode()


def test_a_missing_project_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.pointglass: cannot be read"):
        read_project(tmp_path / "none.pointglass")


def moved_scan(tmp_path, *, size=5):
    """A project in ``job`` and its scan in ``far``, both absolute, and the scan moved away."""
    scan, project = tmp_path / "far" / "scans" / "a.laz", tmp_path / "job" / "p.pointglass"
    scan.parent.mkdir(parents=True)
    project.parent.mkdir()
    scan.write_bytes(b"x" * size)
    write_project(project, Document((ScanFile(str(scan)),)))
    return scan, project


@pytest.mark.parametrize("where", ["job/a.laz", "job/scans/a.laz", "scans/a.laz", "a.laz"])
def test_a_moved_scan_is_found_beside_the_project_and_below_its_folders(tmp_path, where, caplog):
    scan, project = moved_scan(tmp_path)
    (tmp_path / where).parent.mkdir(exist_ok=True)
    scan.rename(tmp_path / where)
    document = read_project(project)
    assert [one.path for one in document.scans] == [str(tmp_path / where)]
    assert scans_of(project, document) == [tmp_path / where]
    assert f"found as {tmp_path / where}" in caplog.text and caplog.text.count("found as") == 1


def test_another_file_of_the_same_name_is_not_taken_for_the_scan(tmp_path):
    scan, project = moved_scan(tmp_path)
    scan.unlink()
    other = tmp_path / "job" / "a.laz"
    other.write_bytes(b"another scan")
    document = read_project(project)
    with pytest.raises(MissingScans, match=r"a\.laz is not there; move it back, or open the project in the window"):
        scans_of(project, document)
    place = places_in(project)[document.scans[0].path]
    assert "12 bytes" in difference(other, document.scans[0].path, place)
    assert difference(scan, document.scans[0].path, place) == ""
    data = json.loads(project.read_text())
    ends = hashlib.sha256(b"xxxxx" * 2).hexdigest()  # the first and the last 64 KiB are the same five bytes
    assert data["places"] == [{"absolute": str(scan), "relative": "../far/scans/a.laz", "size": 5, "ends": ends}]
    del data["places"]  # as older versions wrote it: the name is all there is
    project.write_text(json.dumps(data))
    assert read_project(project).scans[0].path == str(other)


@pytest.mark.parametrize("at", [0, 100_000, 199_999])
def test_another_scan_of_the_same_name_and_size_is_told_apart_by_its_ends(tmp_path, at):
    scan, project = moved_scan(tmp_path, size=200_000)
    content = bytearray(scan.read_bytes())
    content[at] ^= 1
    scan.unlink()
    other = tmp_path / "job" / "a.laz"
    other.write_bytes(content)
    (place,), inside = places_in(project).values(), at == 100_000
    assert ("contents are others" in difference(other, str(scan), place)) != inside, "the middle is not compared"
    assert (read_project(project).scans[0].path == str(other)) == inside
    data = json.loads(project.read_text())
    del data["places"][0]["ends"]  # as older versions wrote it
    project.write_text(json.dumps(data))
    assert read_project(project).scans[0].path == str(other)


@pytest.mark.parametrize("places", [3, [None], [{"absolute": 3, "size": -1}], [{"absolute": "\0", "relative": "a\0b"}], "x"])
def test_damaged_places_only_help_less(tmp_path, places):
    scan, project = moved_scan(tmp_path)
    project.write_text(json.dumps(json.loads(project.read_text()) | {"places": places}))
    assert scan.samefile(read_project(project).scans[0].path)
    scan.unlink()
    with pytest.raises(MissingScans):
        scans_of(project, read_project(project))


def test_an_older_version_reads_it(tmp_path):
    """It knows "pointglass_project" and "document", and takes no notice of the rest."""
    scan, project = moved_scan(tmp_path)
    data = json.loads(project.read_text())
    assert set(data) == {"pointglass_project", "document", "places"} and data["pointglass_project"] == 1
    assert set(data["document"]["scans"][0]) == {"path", "visible", "metres_per_unit", "crs"} and scan.exists()
