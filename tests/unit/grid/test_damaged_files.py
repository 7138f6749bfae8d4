"""Damaged grids: in the cache they are built again, in a folder made by convert refused in one line; neither is drawn."""

import json
import os
import signal

import numpy as np
import pytest
from cloud_files import surface, write_ply

from pointglass.viewer.cli import main
from pointglass.viewer.commands.convert import convert
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid import cache
from pointglass.viewer.grid.open_scene import open_scene

ARRAYS = ("points", "offsets", "cell_coords", "boxes", "faces", "checksums", "noise")


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    """An empty cache of the test's own."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def scan(tmp_path):
    return write_ply(tmp_path / "floor.ply", *surface(3000))


def damaged(path, how: str) -> None:
    """Damages the .npy file at ``path``."""
    raw, array = path.read_bytes(), np.load(path)
    match how:
        case "empty":
            path.write_bytes(b"")
        case "torn header":
            path.write_bytes(raw[:40])
        case "torn":
            path.write_bytes(raw[:-1])
        case "zip":
            path.write_bytes(b"PK\x03\x04" + raw[4:])
        case "garbled header":
            path.write_bytes(raw[:10] + b"('''(" + raw[15:])
        case "dtype":
            np.save(path, array.astype(np.float64))
        case "shape":
            np.save(path, np.concatenate([array, array[:1]]))


def array_of(scene, name):
    return scene.noise.sigma if name == "noise" else getattr(scene, name)


def both(scan, tmp_path, damage) -> None:
    """Applies ``damage`` to the folder of ``scan`` in the cache and to a converted one: neither may be read."""
    scene = open_scene(scan)
    fresh = {name: np.array(array_of(scene, name)) for name in ARRAYS}  # copies, since the files are truncated
    kept, out = cache.folder_of([scan]), tmp_path / "grid"
    convert([scan], out)
    damage(kept)
    damage(out)
    assert cache.load(kept, [scan]) is None
    again = open_scene(scan)
    for name, array in fresh.items():
        np.testing.assert_array_equal(array_of(again, name), array)
    assert cache.load(kept, [scan]) is not None, "it was not built again"
    with pytest.raises(InputError, match=r"grid: damaged grid \(.+\); convert the scan again$") as error:
        open_scene(out)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name, how", [
    *(("points", how) for how in ("empty", "torn header", "zip", "garbled header")),
    *((name, how) for name in ARRAYS for how in ("torn", "dtype", "shape")),
])  # fmt: skip
def test_an_invalid_array_is_never_read(scan, tmp_path, name, how):
    both(scan, tmp_path, lambda folder: damaged(folder / f"{name}.npy", how))


@pytest.mark.parametrize("name", [name for name in ARRAYS if name != "points"])
def test_a_small_array_with_other_values_is_never_read(scan, tmp_path, name):
    """One value differs; type, shape and order are right."""
    def changed(folder):
        array = np.load(folder / f"{name}.npy")
        array.reshape(-1).view(np.uint8)[array.nbytes // 2] ^= 1
        np.save(folder / f"{name}.npy", array)

    both(scan, tmp_path, changed)


def test_boxes_of_zeros_are_never_read(scan, tmp_path):
    both(scan, tmp_path, lambda folder: np.save(folder / "boxes.npy", np.zeros_like(np.load(folder / "boxes.npy"))))


def test_a_folder_without_checksums_still_opens(scan, tmp_path):
    """Earlier versions wrote no checksums."""
    fresh, out = open_scene(scan), tmp_path / "grid"
    convert([scan], out)
    for folder in (cache.folder_of([scan]), out):
        head = json.loads((folder / "meta.json").read_text())
        del head["sums"], head["sum"]
        (folder / "meta.json").write_text(json.dumps(head))
    assert cache.load(cache.folder_of([scan]), [scan]) is not None
    np.testing.assert_array_equal(np.asarray(open_scene(out).boxes), np.asarray(fresh.boxes))


@pytest.mark.parametrize("said, parts", [({}, 1), ({"spread": False}, 1), ({"spread": True}, 8), ({"parts": 64}, 64)])
def test_a_folder_is_read_in_the_parts_that_its_version_made(scan, tmp_path, said, parts):
    """The first version stored nothing about parts, the second one a flag that points are spread."""
    out = tmp_path / "grid"
    convert([scan], out)
    head = json.loads((out / "meta.json").read_text())
    del head["parts"], head["sum"]
    (out / "meta.json").write_text(json.dumps(head | said))
    assert open_scene(out).parts == parts


def test_arrays_are_not_changed_by_later_changes_of_their_files(scan, tmp_path):
    convert([scan], tmp_path / "grid")
    scene = open_scene(tmp_path / "grid")
    small = {name: np.array(getattr(scene, name)) for name in ARRAYS if name != "points"}
    for name in small:
        path = tmp_path / "grid" / f"{name}.npy"
        raw = path.read_bytes()
        with path.open("r+b") as file:  # in place, so that a memory map would show the change
            file.write(bytes(byte ^ 255 for byte in raw))
    for name, array in small.items():
        np.testing.assert_array_equal(getattr(scene, name), array)


def test_an_array_in_fortran_order_is_refused(scan, tmp_path):
    def transposed(folder):
        np.save(folder / "points.npy", np.asfortranarray(np.load(folder / "points.npy")))

    both(scan, tmp_path, transposed)


@pytest.mark.parametrize("change", [
    {"count": float("inf")}, {"meta": []}, {"shapes": []}, {"parts": None}, {"parts": 3}, {"spacing": 0}, {"cell_size": 0.0},
    {"origin": [0, 0, float("nan")]}, {"bounds": [[0, 0, 0]]},
])
def test_invalid_header_values_are_never_read(scan, tmp_path, change):
    def changed(folder):
        head = json.loads((folder / "meta.json").read_text())
        del head["sum"]
        (folder / "meta.json").write_text(json.dumps(head | change))

    both(scan, tmp_path, changed)


@pytest.mark.parametrize("change", [
    {"scans": [[0, 0]]}, {"scans": [{"name": "a", "count": 1, "position": [0, "x", [1]]}]}, {"metres_per_unit": "feet"},
    {"warnings": [None]}, {"colour": 5},
])  # fmt: skip
def test_a_changed_description_of_the_scan_is_detected(scan, tmp_path, change):
    """Rendering and ``info`` rely on it without further checks."""
    def changed(folder):
        head = json.loads((folder / "meta.json").read_text())
        head["meta"] |= change
        (folder / "meta.json").write_text(json.dumps(head))

    both(scan, tmp_path, changed)


def test_a_meta_json_of_nested_brackets_is_damaged(scan, tmp_path):
    fresh, out = open_scene(scan), tmp_path / "grid"
    convert([scan], out)
    for folder in (cache.folder_of([scan]), out):
        (folder / "meta.json").write_text("[" * 200_000)
    assert cache.load(cache.folder_of([scan]), [scan]) is None
    assert open_scene(scan).count == fresh.count
    with pytest.raises(InputError, match=r"grid: is a folder, but not one made by convert"):
        open_scene(out)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
@pytest.mark.parametrize("name", ["faces.npy", "points.npy", "meta.json"])
def test_a_pipe_in_place_of_a_file_does_not_block(scan, tmp_path, name):
    out = tmp_path / "grid"
    convert([scan], out)
    (out / name).unlink()
    os.mkfifo(out / name)

    def waited(*_):
        raise AssertionError("it waits for somebody to write")

    before = signal.signal(signal.SIGALRM, waited)
    signal.alarm(10)
    try:
        with pytest.raises(InputError, match=r"grid: (damaged grid \(.* is no file\)|is a folder, but not one made)"):
            open_scene(out)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def test_the_command_reports_a_damaged_folder_in_one_line(scan, tmp_path, capsys):
    convert([scan], tmp_path / "grid")
    (tmp_path / "grid" / "boxes.npy").write_bytes(b"")
    capsys.readouterr()
    assert main(["info", str(tmp_path / "grid")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "boxes.npy" in said and "convert the scan again" in said
