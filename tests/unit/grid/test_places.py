"""A place of many files: a grid for each file in the cache, joined when opened."""

import contextlib
import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import pytest
from cloud_files import surface, write_las, write_ply

from pointglass.viewer.commands.convert import convert
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.progress import set_sink
from pointglass.viewer.common.workers.worker_choice import Workers
from pointglass.viewer.grid import grid_header
from pointglass.viewer.grid.build_scene import build_scene, in_memory
from pointglass.viewer.grid.building import histogram
from pointglass.viewer.grid.cache import load, load_folder
from pointglass.viewer.grid.density_layers import Lattice
from pointglass.viewer.grid.gathered_rows import gathered
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.place import many_files, open_place
from pointglass.viewer.grid.place.convert_files import PlaceOptions, convert_one
from pointglass.viewer.grid.place.relaid_grid import with_cells
from pointglass.viewer.grid.records.file_records import FileRecords
from pointglass.viewer.grid.scene import CHUNK, attributes_of, colours, packed, unpack
from pointglass.viewer.stream.chunk_source import ChunkFile
from pointglass.viewer.stream.joined_chunks import JoinedChunks, chunks_of

ROOT = Path(__file__).resolve().parents[3]
parsed_header = grid_header._parsed


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    """An empty cache of the test's own; two files are a place."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("POINTGLASS_CACHE", str(folder))
    monkeypatch.setattr(many_files, "BYTES_AS_ONE", 0)
    return folder


def grids_in(store) -> dict[str, int]:
    """The grids in the cache, with the time at which each was written."""
    metas = (folder / "meta.json" for folder in store.iterdir())
    return {meta.parent.name: meta.stat().st_mtime_ns for meta in metas if meta.is_file()}


def tiles(folder, count, points=3000, seed=0):
    return [write_las(folder / f"tile{k:03}.laz", *surface(points + 100 * k, seed + k, (3.0 * k, 0.0, 0.0)))
            for k in range(count)]


def in_order(scene):
    """Positions and colours of all points, in the order of the files."""
    xyz, rgb, _, _ = unpack(scene)
    order = np.argsort(scene.records.numbers(slice(0, scene.count)))
    return xyz[order], rgb[order]


def test_a_place_has_the_points_of_its_files_in_any_order_they_are_asked_for(tmp_path, seed):
    files = tiles(tmp_path, 5, seed=seed)
    scene = open_scene(files, match=False)
    xyz, rgb = in_order(scene)
    stated = [laspy.read(file) for file in files]
    np.testing.assert_allclose(xyz, np.concatenate([las.xyz for las in stated]), atol=scene.step)
    np.testing.assert_array_equal(rgb[:, 1], np.concatenate([np.asarray(las.green) for las in stated]))
    assert len({tuple(cell) for cell in scene.cell_coords.tolist()}) < len(scene.cell_coords)  # tiles overlap by a metre
    random = np.random.default_rng(seed)
    some = random.integers(0, scene.count, 500)
    whole = packed(scene)
    for index in (some, some - scene.count, slice(17, scene.count - 5, 7), slice(900, 7000), np.arange(scene.count) % 3 == 0):
        np.testing.assert_array_equal(np.asarray(scene.points[index]), whole[index])
    rows = random.permutation(len(scene.cell_coords))[:7]
    cells = gathered(scene, rows)
    numbers = cells.numbers(np.arange(len(cells.points)))
    np.testing.assert_array_equal(cells.points, whole[numbers])
    assert set((np.searchsorted(scene.offsets, numbers, "right") - 1) % len(scene.cell_coords)) == set(rows.tolist())
    values = FileRecords(scene).of(some)
    assert values.exact
    np.testing.assert_array_equal(values.source, values.station)
    np.testing.assert_allclose(values.xyz, unpack(scene, some)[0], atol=scene.step)


@pytest.mark.parametrize("chunk_points", [256, CHUNK])
@pytest.mark.parametrize("earlier", [False, True])
def test_the_chunks_that_are_streamed_are_the_points(tmp_path, seed, chunk_points, earlier, monkeypatch):
    if earlier:  # grids without checksums of their layers
        monkeypatch.setattr(grid_header, "_parsed", lambda head: replace(parsed_header(head), head_checksums=None))
    scene = open_scene(tiles(tmp_path, 3, 70_000, seed))
    source, whole = chunks_of(scene, chunk_points), packed(scene)
    assert isinstance(source, JoinedChunks)
    into = np.empty((chunk_points, 3), np.uint32)
    for chunk in np.random.default_rng(seed).permutation(source.chunks).tolist():
        np.testing.assert_array_equal(source.read(chunk, into), whole[chunk * chunk_points : (chunk + 1) * chunk_points])
    read, direct = [], ChunkFile._read_at
    monkeypatch.setattr(ChunkFile, "_read_at", lambda self, place, raw: read.append(len(raw)) or direct(self, place, raw))
    chunks_of(scene, 256).read(0, into[:256])
    assert sum(read) / 12 > 3 * 65_000 if earlier else sum(read) / 12 < 0.1 * scene.count
    damaged = Path(scene.points.files[1])
    for place, last in ((-100, source.chunks), (-12 * 70_100, 1)):  # the last points, and the coarsest
        kept = damaged.read_bytes()
        with damaged.open("r+b") as file:
            file.seek(place, os.SEEK_END)
            file.write(bytes(byte ^ 1 for byte in kept[place : place + 50]))
        with pytest.raises(InputError, match="do not match their checksum"):
            for chunk in range(last):
                chunks_of(scene, chunk_points).read(chunk, into)
        damaged.write_bytes(kept)


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="no /proc")
def test_no_file_of_the_grids_stays_open_while_a_place_is_opened(tmp_path, store, monkeypatch):
    """A place has more grids than a process may have open files, 1,024 by default."""
    files, held, join = tiles(tmp_path, 3), [], open_place.scene_of_grids

    def joining(*given, **more):
        for number in os.listdir("/proc/self/fd"):
            with contextlib.suppress(OSError):  # closed meanwhile
                held.append(os.readlink(f"/proc/self/fd/{number}"))
        return join(*given, **more)

    monkeypatch.setattr(open_place, "scene_of_grids", joining)
    assert open_scene(files).count == open_scene(files).count
    assert held and not [file for file in held if file.endswith(".npy")]


def test_only_what_changed_is_converted(tmp_path, store):
    files = tiles(tmp_path, 4)
    open_scene(files)
    first = grids_in(store)
    assert len(first) == 4
    more = [*files, write_las(tmp_path / "new.laz", *surface(2500, 9, (1.0, 3.0, 0.0)))]
    assert open_scene(more).meta.scans[-1].count == 2500
    assert first.items() <= grids_in(store).items() and len(grids_in(store)) == 5
    fewer = open_scene([files[3], files[0]])
    assert [Path(file).name for file in fewer.meta.sources] == ["tile003.laz", "tile000.laz"]
    write_las(files[1], *surface(1234, 5, (3.0, 0.0, 0.0)))
    replaced = open_scene(files)
    assert [scan.count for scan in replaced.meta.scans] == [3000, 1234, 3200, 3300]
    assert first.items() <= grids_in(store).items() and len(grids_in(store)) == 6
    assert len({load_folder(store / name).cell_size for name in grids_in(store)}) == 1


def test_a_file_that_cannot_be_read_is_left_out_and_named(tmp_path):
    files = tiles(tmp_path, 3)
    files[1].write_bytes(files[1].read_bytes()[:2000])
    scene = open_scene(files)
    assert len(scene.meta.sources) == 2
    assert [text for text in scene.meta.warning_texts if "left out" in text and "tile001.laz" in text]
    for file in files:
        file.write_bytes(b"nothing")
    with pytest.raises(InputError, match="none of the 3 files"):
        open_scene(files)


def test_progress_names_the_file(tmp_path):
    labels = []
    set_sink(lambda label, done, total: labels.append(label) or True)
    try:
        open_scene(tiles(tmp_path, 3))
    finally:
        set_sink(None)
    assert any(label.startswith("tile000.laz (") and "of 3)" in label for label in labels)


def test_stations_of_different_brightness_become_equal_across_grids(tmp_path):
    """Each file is of one station; no file knows another one when it is converted."""
    random = np.random.default_rng(3)
    xyz, _ = surface(120_000, 3, size=6.0)
    true = 90 + 50 * np.sin(xyz[:, 0]) * np.cos(xyz[:, 1])
    station = random.integers(0, 3, len(xyz))
    factor = np.array([1.0, 1.25, 0.85])
    grey = np.clip(np.rint(true * factor[station]), 1, 255).astype(np.uint8)
    rgb = np.repeat(grey[:, None], 3, axis=1)
    files = [write_ply(tmp_path / f"s{k}.ply", xyz[station == k], rgb[station == k]) for k in range(3)]
    scene = open_scene(files)
    assert scene.meta.exposures is not None and scene.meta.exposures.applied and scene.meta.exposures.matched == 3
    shown = in_order(scene)[1][:, 0].astype(float)
    truth = np.concatenate([true[station == k] for k in range(3)])
    parts = np.split(np.arange(len(truth)), np.cumsum(np.bincount(station))[:-1])
    ratio = [np.median(shown[own] / truth[own]) for own in parts]
    assert np.ptp(ratio) < 0.02
    plain = open_scene(files, match=False)
    np.testing.assert_array_equal(in_order(plain)[1][:, 0], np.concatenate([grey[station == k] for k in range(3)]))
    with pytest.raises(TypeError):
        np.asarray(scene.points)


def test_attributes_of_files_with_and_without_classes_have_one_layout(tmp_path):
    (a, ca), (b, cb) = surface(3000, 1), surface(3000, 2, (3.0, 0.0, 0.0))
    first = write_las(tmp_path / "a.las", a, ca, np.arange(3000) % 200, classes=np.arange(3000) % 3)
    second = write_las(tmp_path / "b.las", b, cb, np.arange(3000) * 20)
    scene = open_scene([first, second])
    values = FileRecords(scene).of(slice(0, scene.count))
    drawn = attributes_of(scene)
    np.testing.assert_array_equal(drawn.classification, values.columns["classification"])
    assert np.abs(drawn.intensity.astype(float) - values.columns["intensity"]).max() <= scene.attributes.step / 2 + 0.5


def test_a_file_is_converted_by_another_process(tmp_path, store):
    files = tiles(tmp_path, 2)
    options = pickle.loads(pickle.dumps(PlaceOptions(cell_size=2.0)))
    folder = convert_one(files[0], store, options)
    assert load(folder, [files[0]]).cell_size == 2.0
    script = ("import pickle, sys; from pathlib import Path; sys.path.insert(0, sys.argv[1]); import pointglass;"
              "from pointglass.viewer.grid.place.convert_files import PlaceOptions, convert_one;"
              "print(convert_one(Path(sys.argv[2]), Path(sys.argv[3]), PlaceOptions(cell_size=2.0)))")
    run = subprocess.run([sys.executable, "-c", script, ROOT, files[1], store], capture_output=True, text=True, check=True)
    assert Path(run.stdout.strip()).is_dir()
    before = grids_in(store)
    scene = open_scene(files)
    assert scene.cell_size == 2.0 and grids_in(store) == before


def test_colours_of_single_points_are_those_of_the_place(tmp_path):
    scene = open_scene(tiles(tmp_path, 2), match=False)
    np.testing.assert_array_equal(colours(packed(scene, slice(5, 50))), unpack(scene, np.arange(5, 50))[1])


def test_files_converted_by_workers_give_the_same_grids(tmp_path, monkeypatch):
    files = tiles(tmp_path, 4)
    (bad := tmp_path / "tile9.laz").write_bytes(files[1].read_bytes()[:9000])
    made = []
    for name, workers in ("one", None), ("two", Workers(2)):
        monkeypatch.setenv("POINTGLASS_CACHE", str(store := tmp_path / name))
        scene = open_scene([*files, bad], workers=workers)
        grids = {str(path.relative_to(store)): path.read_bytes() for path in store.glob("*/*") if path.parent.name != "places"}
        made.append((grids, packed(scene).tobytes(), scene.meta.warnings))
    assert sorted(made[0][0]) == sorted(made[1][0])
    assert [name for name, data in made[0][0].items() if made[1][0][name] != data] == []
    assert made[0][1:] == made[1][1:] and len(made[0][0]) > 4 * 5
    assert "tile9.laz" in str(made[0][2])


def shaded(folder, name, seed, factor):
    """A file in a place of 6 x 6 units whose brightness all of them see, times ``factor``."""
    xyz, _ = surface(40_000, seed, size=6.0)
    grey = np.clip(np.rint(factor * (90 + 50 * np.sin(xyz[:, 0]) * np.cos(xyz[:, 1]))), 1, 255).astype(np.uint8)
    return write_las(folder / name, xyz, np.repeat(grey[:, None], 3, axis=1) * np.uint16(257))


def measured_in(store) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in (store / "places" / "grids").iterdir()}


def test_of_a_replaced_file_only_its_own_grid_is_measured_and_the_place_is_that_of_a_fresh_cache(tmp_path, store, monkeypatch):
    factors = 1.0, 1.2, 0.85, 0.95, 1.1
    files = [shaded(tmp_path, f"s{k}.las", k, factor) for k, factor in enumerate(factors)]
    before = open_scene(files)
    first = measured_in(store)
    assert len(first) == before.meta.exposures.matched == 5
    shaded(tmp_path, "s2.las", 77, 1.3)
    replaced = open_scene(files)
    added = measured_in(store).items() - first.items()
    assert first.items() <= measured_in(store).items() and len(added) == 1
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "fresh"))
    fresh = open_scene(files)
    assert fresh.meta.exposures == replaced.meta.exposures != before.meta.exposures
    assert fresh.spacing == replaced.spacing
    np.testing.assert_array_equal(packed(fresh), packed(replaced))
    monkeypatch.setenv("POINTGLASS_CACHE", str(store))
    for path in (store / "places").rglob("*.*"):  # damage: everything is measured again
        path.write_bytes(path.read_bytes()[:-100] + b"\1" * 100)
    again = open_scene(files)
    assert again.meta.exposures == fresh.meta.exposures
    np.testing.assert_array_equal(packed(again), packed(fresh))


@pytest.mark.parametrize("power", [-3, 2])
def test_a_grid_laid_again_is_that_of_its_file_with_such_cells(tmp_path, seed, power):
    """Larger cells: to the byte.  Smaller ones: but for positions, which are known to a step of the larger cells."""
    xyz, rgb = surface(150_000, seed, (-7.0, 5e6, 3.0), size=40.0)
    file = write_las(tmp_path / "a.laz", xyz, rgb, np.arange(len(xyz)) % 999, classes=np.arange(len(xyz)) % 3)
    made = convert([file], tmp_path / "grid", match=False)
    size = made.cell_size * 2.0**power
    laid, folder = with_cells(made, tmp_path / "grid", size)
    expected = build_scene([file], in_memory, match=False, lattice=Lattice(size, made.layers))
    for name in "cell_coords", "offsets", "origin", "bounds", "cell_size", "parts", "layers":
        np.testing.assert_array_equal(getattr(laid, name), getattr(expected, name), err_msg=name)
    np.testing.assert_array_equal(laid.records.low, expected.records.low)
    np.testing.assert_array_equal(laid.points[:, 2], expected.points[:, 2])
    np.testing.assert_array_equal(laid.points[:, 1] >> 16, expected.points[:, 1] >> 16)
    if power > 0:
        for name in "points", "faces", "boxes":
            np.testing.assert_array_equal(getattr(laid, name), getattr(expected, name), err_msg=name)
    assert np.abs(unpack(laid)[0] - unpack(expected)[0]).max() <= max(made.step, laid.step)
    assert with_cells(load_folder(tmp_path / "grid"), tmp_path / "grid", size)[1] == folder != tmp_path / "grid"
    assert with_cells(made, tmp_path / "grid", made.cell_size) == (made, tmp_path / "grid")


def test_folders_of_convert_and_files_are_opened_together(tmp_path, store, caplog):
    """A folder of two files, one of a much denser file, whose cells are smaller, and a file."""
    wide = [shaded(tmp_path, f"wide{k}.las", k, factor) for k, factor in enumerate((1.0, 1.25))]
    convert(wide, tmp_path / "wide", match=False)
    xyz, rgb = surface(20_000, 5, (2.0, 2.0, 0.0), size=0.3)
    dense = write_las(tmp_path / "dense.laz", xyz, rgb)
    convert([dense], tmp_path / "dense")
    assert load_folder(tmp_path / "dense").cell_size < load_folder(tmp_path / "wide").cell_size
    extra = shaded(tmp_path, "extra.las", 8, 0.9)
    given = [tmp_path / "dense", extra, tmp_path / "wide"]
    with caplog.at_level("WARNING"):
        scene = open_scene(given)
    assert [record.message.split(": ")[0] for record in caplog.records] == [str(tmp_path / "dense")]
    assert "is laid again in cells of" in caplog.text
    assert [Path(file).name for file in scene.meta.sources] == ["dense.laz", "extra.las", "wide0.las", "wide1.las"]
    assert scene.meta.exposures.matched == 3 and scene.cell_size == load_folder(tmp_path / "wide").cell_size
    values, drawn = FileRecords(scene).of(slice(0, scene.count)), unpack(scene)
    assert values.exact
    np.testing.assert_allclose(values.xyz, drawn[0], atol=2 * scene.step)
    np.testing.assert_array_equal(values.source, values.station)
    written = grids_in(store)
    caplog.clear()
    again = open_scene(given)
    np.testing.assert_array_equal(packed(again), packed(scene))
    assert grids_in(store) == written and caplog.records == []
    for file in (*wide, dense):
        file.unlink()
    np.testing.assert_array_equal(packed(open_scene(given)), packed(scene))  # the folders are enough
    damaged = tmp_path / "wide" / "points.npy"
    damaged.write_bytes(damaged.read_bytes()[:-100])
    with pytest.raises(InputError, match="wide: damaged grid"):
        open_scene(given)


@pytest.mark.parametrize("order", [1, -1])
def test_a_wide_sparse_file_and_a_room_get_the_cells_that_the_wide_one_needs(tmp_path, monkeypatch, order):
    """The room's grid is in the cache already; the most cells of a grid are fewer here, so that few points are too many."""
    room = write_las(tmp_path / "room.laz", *surface(20_000, 1))
    natural = open_scene([room]).cell_size
    site = write_las(tmp_path / "site.laz", np.random.default_rng(2).uniform(0, 40 * natural, (4000, 3)),
                     np.full((4000, 3), 90, np.uint8))  # fmt: skip
    monkeypatch.setattr(histogram, "MAX_CELLS", 1024)
    scene, errors = open_place.open_place([room, site][::order])
    assert not errors and scene.count == 24_000
    assert scene.cell_size > natural
    again, errors = open_place.open_place([room, site][::order])
    assert not errors and again.cell_size == scene.cell_size
