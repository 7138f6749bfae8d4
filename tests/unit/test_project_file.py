"""Project files: opened exactly as left, moved with their scans, and damaged ones refused in one line."""

import json
import shutil

import numpy as np
import pytest
from documents import random_document

from pointglass.viewer.errors import InputError
from pointglass.viewer.tools.document import Document, ScanFile
from pointglass.viewer.tools.project import VERSION, read_project, write_project


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
    write_project(old / "work" / "p.pointglass", Document(scans))
    shutil.move(old, tmp_path / "new")
    near, far = read_project(tmp_path / "new" / "work" / "p.pointglass").scans
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
])
def test_bad_projects_say_what_is_wrong(tmp_path, text, said):
    path = tmp_path / "p.pointglass"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        read_project(path)
    assert str(path) in str(caught.value)


def test_a_missing_project_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.pointglass: cannot be read"):
        read_project(tmp_path / "none.pointglass")
