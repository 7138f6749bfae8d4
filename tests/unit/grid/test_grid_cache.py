"""The cache: complete or absent, never read when damaged, stale or foreign; reopening imports nothing heavy."""

import json
import os
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from cloud_files import surface, write_ply

from pointglass.viewer.commands.convert import convert, convert_each
from pointglass.viewer.commands.info import facts, format_text, scene_of
from pointglass.viewer.common.errors import Cancelled, InputError
from pointglass.viewer.common.progress import set_sink
from pointglass.viewer.grid import cache
from pointglass.viewer.grid.building import two_passes as grid
from pointglass.viewer.grid.npy_column import NpyColumn
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.stream.chunk_source import CHUNK, ChunkSource

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    """An empty cache of the test's own."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("POINTGLASS_CACHE", str(folder))
    return folder


@pytest.fixture
def scan(tmp_path):
    return write_ply(tmp_path / "floor.ply", *surface(3000))


def same(a, b):
    for name in ("points", "cell_coords", "offsets", "origin", "bounds"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    for name in ("origin", "voxel", "sigma", "curve", "overall", "neighbourhoods"):
        np.testing.assert_array_equal(getattr(a.noise, name), getattr(b.noise, name))
    assert (a.cell_size, a.layers, a.count, a.spacing, a.meta) == (b.cell_size, b.layers, b.count, b.spacing, b.meta)


def test_a_cached_scene_equals_a_fresh_one(scan, store):
    fresh = open_scene(scan, cache=False)
    assert not store.exists()
    same(open_scene(scan), fresh)
    again = open_scene(scan)
    same(again, fresh)
    assert isinstance(again.points, NpyColumn)
    assert [p.name for p in store.iterdir()] == [cache.folder_of([scan]).name]


def test_reopening_imports_no_compiler_and_no_file_library(scan):
    open_scene(scan)
    code = f"""
import sys
from pointglass.viewer.grid.open_scene import open_scene
assert open_scene({str(scan)!r}).count == 3000
print([m for m in ("numba", "scipy", "laspy", "pye57", "open3d", "torch") if m in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "damage",
    ["short points", "short offsets", "no meta", "half meta", "version", "magic", "dtype", "sizes", "offsets", "checksums",
     "faces", "boxes", "noise", "noise entry"],
)
def test_a_damaged_cache_is_rebuilt_and_never_read(scan, damage):
    open_scene(scan)
    fresh = open_scene(scan, cache=False)
    folder = cache.folder_of([scan])
    meta = json.loads((folder / "meta.json").read_text())
    match damage:
        case "short points":
            os.truncate(folder / "points.npy", 5000)
        case "short offsets":
            os.truncate(folder / "offsets.npy", 100)
        case "no meta":
            (folder / "meta.json").unlink()
        case "half meta":
            os.truncate(folder / "meta.json", 50)
        case "version" | "magic":
            (folder / "meta.json").write_text(json.dumps(meta | {damage: 0}))
        case "dtype":
            np.save(folder / "points.npy", np.zeros((3000, 3), np.float32))
        case "sizes":
            (folder / "meta.json").write_text(json.dumps(meta | {"count": 2999}))
        case "offsets":
            np.save(folder / "offsets.npy", np.load(folder / "offsets.npy")[::-1])
        case "checksums":
            (folder / "checksums.npy").unlink()
        case "faces":
            np.save(folder / "faces.npy", np.zeros((1, 3), np.uint8))
        case "boxes":
            np.save(folder / "boxes.npy", np.zeros((len(fresh.cell_coords), 6), np.uint16))
        case "noise":
            np.save(folder / "noise.npy", np.load(folder / "noise.npy")[..., None])
        case "noise entry":
            meta = {key: value for key, value in meta.items() if key != "sum"}
            (folder / "meta.json").write_text(json.dumps(meta | {"noise": meta["noise"] | {"voxel": 0}}))
    assert cache.load(folder, [scan]) is None
    same(open_scene(scan), fresh)
    assert cache.load(folder, [scan]) is not None


def plain_checksums(raw: bytes) -> list[int]:
    return [zlib.crc32(raw[i : i + CHUNK * 12]) for i in range(0, len(raw), CHUNK * 12)]


@pytest.mark.parametrize("count", [1, CHUNK, 18 * CHUNK + 77])
def test_each_chunk_has_the_checksum_of_its_bytes(scan, count):
    points = np.random.default_rng(count).integers(0, 2**32, (count, 3), dtype=np.uint32)
    assert cache.checksums(points)[0].tolist() == plain_checksums(points.tobytes())
    scene = open_scene(scan)
    assert scene.checksums.tolist() == plain_checksums(np.load(scene.points.filename).tobytes())


@pytest.mark.parametrize("kept", [True, False])
def test_damaged_points_are_found_when_read_and_never_drawn(scan, tmp_path, kept):
    """One byte differs: the grid in the cache is built again, and a converted folder is refused by name."""
    out = tmp_path / "grid"
    if not kept:
        convert([scan], out)
    scene = open_scene(scan if kept else out)
    path = Path(scene.points.filename)
    raw = bytearray(path.read_bytes())
    raw[-5] ^= 4
    path.write_bytes(raw)
    source = ChunkSource(open_scene(scan if kept else out))
    remedy = "open the scan again, which builds it anew" if kept else "convert the scan again"
    with pytest.raises(InputError, match=rf"points\.npy: damaged grid \(points 0 to 3,000 .*\); {remedy}$") as error:
        source.read(0, np.empty((CHUNK, 3), np.uint32))
    assert str(path) in str(error.value)
    if kept:
        same(open_scene(scan), open_scene(scan, cache=False))
        scene = open_scene(scan)
    else:
        convert([scan], out)
        scene = open_scene(out)
    assert np.array_equal(ChunkSource(scene).read(0, np.empty((CHUNK, 3), np.uint32)), scene.points)


def test_a_changed_file_is_read_again(scan):
    assert open_scene(scan).count == 3000
    write_ply(scan, *surface(2000))
    assert open_scene(scan).count == 2000


def test_everything_that_determines_a_grid_is_part_of_its_cache_key(scan, tmp_path, monkeypatch):
    other = tmp_path / "other"
    other.mkdir()
    (other / scan.name).write_bytes(scan.read_bytes())
    times = (scan.stat().st_atime_ns, scan.stat().st_mtime_ns)
    os.utime(other / scan.name, ns=times)
    places = [cache.folder_of([scan]), cache.folder_of([scan], False), cache.folder_of([other / scan.name]),
              cache.folder_of([scan, other / scan.name]), cache.folder_of([other / scan.name, scan])]
    for name in ("VERSION", "COLOURS", "ORDER"):
        with monkeypatch.context() as later:
            later.setattr(cache, name, getattr(cache, name) + 1)
            places.append(cache.folder_of([scan]))
    os.utime(scan, ns=(times[0], times[1] + 1000))  # within the same second
    places.append(cache.folder_of([scan]))
    os.utime(scan, ns=times)
    assert len(set(places)) == len(places) and cache.folder_of([scan], True) == places[0]


def test_a_pickle_in_the_cache_is_not_loaded(scan):
    open_scene(scan)
    folder = cache.folder_of([scan])
    np.save(folder / "cell_coords.npy", np.array([{"a": 1}], object), allow_pickle=True)
    assert cache.load(folder, [scan]) is None


@pytest.mark.parametrize("calls", [1, 2])
def test_cancelling_leaves_nothing_behind(scan, store, calls):
    left = [calls]

    def stop(*_):
        left[0] -= 1
        return left[0] > 0

    set_sink(stop)
    try:
        with pytest.raises(Cancelled):
            open_scene(scan)
    finally:
        set_sink(None)
    assert list(store.iterdir()) == []


@pytest.mark.parametrize("how", ["points elsewhere", "other colours"])
def test_a_file_that_changes_between_its_readings_is_refused_and_leaves_nothing(scan, store, monkeypatch, how):
    """Changed colours are detected by the file's time only, since every point is in the same cell."""
    xyz, rgb = surface(3000)
    changed = (xyz + 3 * np.arange(3), rgb) if how == "points elsewhere" else (xyz, 255 - rgb)
    place = grid.scatter

    def later(*given):
        write_ply(scan, *changed)
        return place(*given)

    monkeypatch.setattr(grid, "scatter", later)
    with pytest.raises(InputError, match=r"floor\.ply: changed while it was read; try again"):
        open_scene(scan)
    assert list(store.iterdir()) == []
    if how == "points elsewhere":
        write_ply(scan, xyz, rgb)
        with pytest.raises(InputError, match=r"floor\.ply: changed while it was read; try again"):
            open_scene(scan, cache=False)


def test_interrupting_leaves_nothing_behind(scan, store, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(cache, "_write", interrupt)
    with pytest.raises(KeyboardInterrupt):
        open_scene(scan)
    assert list(store.iterdir()) == []


def test_an_unusable_cache_names_the_folder_and_the_remedy(scan, tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setenv("POINTGLASS_CACHE", str(blocked / "cache"))
    with pytest.raises(InputError, match=r"cannot be written .*POINTGLASS_CACHE.*--no-cache") as error:
        open_scene(scan)
    assert str(blocked) in str(error.value) and "\n" not in str(error.value)
    assert open_scene(scan, cache=False).count == 3000
    assert scene_of([scan]).count == 3000


def test_a_full_disk_is_detected_before_writing(scan, store, monkeypatch):
    import shutil

    usage = shutil.disk_usage(scan.parent)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=1000))
    with pytest.raises(InputError, match=r"no space left.*POINTGLASS_CACHE"):
        open_scene(scan)
    assert list(store.iterdir()) == []


def test_a_disk_that_fills_up_while_writing_leaves_nothing(scan, store, monkeypatch):
    import errno

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(InputError, match="no space left"):
        open_scene(scan)
    assert list(store.iterdir()) == []


def test_convert_makes_a_folder_that_opens_like_a_scan(scan, tmp_path):
    out = tmp_path / "grid"
    convert([scan], out)
    same(open_scene(out), open_scene(scan, cache=False))
    convert([scan], out)  # again: replaces the former grid
    arrays = ("boxes", "cell_coords", "checksums", "faces", "noise", "offsets", "points", "record_sums", "records")
    names = sorted(["meta.json", *(f"{array}.npy" for array in arrays)])
    assert sorted(p.name for p in out.iterdir()) == names
    for missing in ("boxes", "faces", "noise"):  # a folder of an earlier version
        (out / f"{missing}.npy").unlink()
        head = json.loads((out / "meta.json").read_text())
        del head["shapes"][missing]
        head.pop("sum", None)
        (out / "meta.json").write_text(json.dumps(head))
        assert getattr(open_scene(out), missing) is None
    os.truncate(out / "points.npy", 1000)
    with pytest.raises(InputError, match="damaged grid"):
        open_scene(out)
    assert not list(tmp_path.glob(".*"))


def test_convert_into_a_folder_that_cannot_be_written_is_refused(scan, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match=r"cannot be written .*--out"):
        convert([scan], tmp_path / "file" / "grid")


def test_convert_refuses_a_folder_with_other_files(scan, tmp_path):
    out = tmp_path / "mine"
    out.mkdir()
    (out / "thesis.txt").write_text("years")
    with pytest.raises(InputError, match="holds other files"):
        convert([scan], out)
    with pytest.raises(InputError, match="not one made by convert"):
        open_scene(out)
    with pytest.raises(InputError, match="is a file"):
        convert([scan], out / "thesis.txt")
    assert (out / "thesis.txt").read_text() == "years"


def test_files_of_file_managers_do_not_prevent_replacing_a_folder(scan, tmp_path):
    out = tmp_path / "grid"
    out.mkdir()
    for _ in range(2):  # into a folder that was only viewed in a file manager, and over a grid
        (out / ".DS_Store").write_bytes(b"looked at")
        convert([scan], out)
        assert open_scene(out).count and not (out / ".DS_Store").exists()


def test_a_folder_of_scans_is_converted_in_independent_shards(tmp_path):
    scans = tmp_path / "scans"
    scans.mkdir()
    files = [write_ply(scans / f"hall{k}.ply", *surface(400 + k)) for k in range(5)]
    (scans / "notes.txt").write_text("no scan")
    made = [convert_each([scans], tmp_path / "grids", shard=(part, 2)) for part in (0, 1)]
    assert [[folder.name for folder in part] for part in made] == [["hall0", "hall2", "hall4"], ["hall1", "hall3"]]
    for k, file in enumerate(files):
        same(open_scene(tmp_path / "grids" / f"hall{k}"), open_scene(file, cache=False))
    before = (tmp_path / "grids" / "hall0" / "meta.json").stat().st_mtime_ns
    write_ply(files[2], *surface(900))
    convert_each([scans], tmp_path / "grids")  # again: only what has changed
    assert (tmp_path / "grids" / "hall0" / "meta.json").stat().st_mtime_ns == before
    assert open_scene(tmp_path / "grids" / "hall2").count == 900


def test_other_scans_are_converted_if_one_cannot_be_read(tmp_path):
    scans = tmp_path / "scans"
    scans.mkdir()
    write_ply(scans / "a.ply", *surface(300))
    (scans / "b.ply").write_text("nonsense")
    write_ply(scans / "c.ply", *surface(300))
    with pytest.raises(InputError, match=r"b\.ply: .*; 2 grids in ") as caught:
        convert_each([scans], tmp_path / "grids")
    assert "\n" not in str(caught.value) and "d.ply" not in str(caught.value)
    (scans / "d.ply").write_text("nonsense")
    with pytest.raises(InputError, match=r"b\.ply: .* \(and d\.ply\); 0 grids of this shard in "):
        convert_each([scans], tmp_path / "grids", shard=(1, 2))
    assert sorted(p.name for p in (tmp_path / "grids").iterdir()) == ["a", "c"]
    write_ply(tmp_path / "c.ply", *surface(300))
    with pytest.raises(InputError, match="would have the same folder"):
        convert_each([scans, tmp_path / "c.ply"], tmp_path / "other")
    with pytest.raises(InputError, match="a folder made by convert is not a scan; give the scans"):
        convert_each([tmp_path / "grids" / "a"], tmp_path / "other")


def test_several_files_make_one_scene(scan, tmp_path):
    xyz, rgb = surface(1000, seed=4, origin=(5, 0, 0))
    other = write_ply(tmp_path / "next.ply", xyz, rgb)
    scene = open_scene([scan, other])
    assert scene.count == 4000
    assert [s.count for s in scene.meta.scans] == [3000, 1000]
    got, _, _, number = unpack(scene)
    assert (number == 1).sum() == 1000 and got[number == 1, 0].min() > 4.9


def test_info_can_be_written_as_json_and_as_text(scan):
    scene = scene_of([scan])
    found = json.loads(json.dumps(facts(scene, full=True), allow_nan=False))
    assert found["points"] == 3000 and sum(found["grid"]["layers"]) == 3000
    text = format_text(scene, full=True)
    assert "3,000" in text and "PLY" in text


def test_the_log_has_the_reason_why_a_grid_is_built_again(scan, caplog):
    with caplog.at_level("INFO", logger="pointglass.viewer.grid.cache"):
        open_scene(scan)
        open_scene(scan)
        assert not caplog.records, "a complete cache is used silently, a missing one is no damage"
        folder = cache.folder_of([scan])
        (folder / "offsets.npy").write_bytes(b"torn")
        open_scene(scan)
    [record] = caplog.records
    assert record.levelname == "WARNING" and str(folder) in record.getMessage() and "offsets.npy" in record.getMessage()


@pytest.mark.parametrize("error", [TypeError, ValueError, KeyError, OSError])
def test_a_bug_in_reading_the_cache_is_not_treated_as_damage(scan, monkeypatch, error):
    open_scene(scan)

    def broken(*_, **__):
        raise error("a bug")

    monkeypatch.setattr(cache, "Scene", broken)
    with pytest.raises(error, match="a bug"):
        open_scene(scan)
