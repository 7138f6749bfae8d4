"""A joined place that is kept in the cache gives the scene that its grids give, and is not used once anything has changed."""

import os
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from cloud_files import surface, write_las

from pointglass.viewer.grid.open_scene import is_cached, open_scene
from pointglass.viewer.grid.place import kept_place, many_files
from pointglass.viewer.grid.scene import packed


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """A cache of the test's own; two files are a place, which is kept."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(many_files, "BYTES_AS_ONE", 0)
    monkeypatch.setattr(kept_place, "LEAST_GRIDS", 2)


@pytest.fixture
def files(tmp_path):
    return [write_las(tmp_path / f"{k}.las", *surface(4000 + 500 * k, k, (3.0 * k, 0.0, 0.0))) for k in range(3)]


def stations_of_one_room(folder: Path) -> list[Path]:
    """Two files of one surface at different brightness, one of them with classes."""
    xyz, _ = surface(120_000, 3, size=6.0)
    shade = 90 + 50 * np.sin(xyz[:, 0]) * np.cos(xyz[:, 1])
    made = []
    for k, factor in enumerate((1.0, 1.25)):
        grey = np.clip(np.rint(shade * factor), 1, 255).astype(np.uint8)[k::2]
        levels = np.arange(len(grey)) % (1000 * (k + 1))
        made.append(write_las(folder / f"room{k}.las", xyz[k::2], np.repeat(grey[:, None], 3, axis=1), levels,
                              **({"classes": np.arange(len(grey)) % 3} if k else {})))
    return made


def kept_file() -> Path:
    found = list((Path(os.environ["POINTGLASS_CACHE"]) / "places").glob("joined-*"))
    return found[0]


def opened(files, monkeypatch):
    """The scene of files, and whether it came from what was kept."""
    found, read = [], kept_place.kept_scene
    with monkeypatch.context() as patch:
        patch.setattr(kept_place, "kept_scene", lambda asked: found.append(read(asked)) or found[-1])
        return open_scene(files), found[0] is not None


def assert_same(one, other):
    """Every field of two scenes, and what their points and running numbers are read as."""
    same(one, other, {"points", "records"})
    same(vars(one.points.table), vars(other.points.table))
    same(one.points.changes, other.points.changes)
    same(one.points.checked, other.points.checked)
    assert one.points.files == other.points.files and one.points.first_stations == other.points.first_stations
    same(one.records.first, other.records.first)
    same(one.records.scans, other.records.scans)
    same(one.records._sums, other.records._sums)
    assert np.array_equal(packed(one), packed(other))
    assert np.array_equal(one.records.numbers(slice(None)), other.records.numbers(slice(None)))


def same(one, other, but=frozenset()):
    if isinstance(one, np.ndarray):
        assert np.array_equal(one, other)
    elif isinstance(one, (list, tuple)):
        assert len(one) == len(other)
        for a, b in zip(one, other):
            same(a, b)
    elif isinstance(one, dict):
        same(list(one.items()), list(other.items()))
    elif hasattr(one, "__dataclass_fields__"):
        for field in fields(one):
            if field.name not in but:
                same(getattr(one, field.name), getattr(other, field.name))
    else:
        assert one == other


def test_what_is_kept_gives_the_scene_of_the_grids_and_reads_none_of_their_headers(tmp_path, monkeypatch):
    files = stations_of_one_room(tmp_path)
    joined, was_kept = opened(files, monkeypatch)
    assert not was_kept and is_cached(files)
    with monkeypatch.context() as patch:
        patch.setattr("pointglass.viewer.grid.grid_header._read_and_checked", None)
        assert is_cached(files)
        again, was_kept = opened(files, monkeypatch)
    assert was_kept
    with monkeypatch.context() as patch:  # samples are taken of what is kept
        patch.setattr("pointglass.viewer.grid.place.joined_points.column_of", None)
        some = slice(0, again.coarse_points(4 * len(again.cell_coords)))
        first = packed(again, some)
    assert np.array_equal(first, packed(joined, some))
    assert any(change.colours is not None for change in joined.points.changes)
    assert any(change.attributes is not None for change in joined.points.changes)
    assert_same(again, joined)
    raw = open_scene(files, match=False)
    assert all(change.colours is None for change in raw.points.changes)
    assert opened(files, monkeypatch)[1]  # each is kept by itself


def test_a_file_or_grid_that_changed_is_seen(files, tmp_path, monkeypatch):
    opened(files, monkeypatch)
    write_las(files[2], *surface(700, 9))
    changed, was_kept = opened(files, monkeypatch)
    assert not was_kept and changed.count == 4000 + 4500 + 700
    again, was_kept = opened(files, monkeypatch)
    assert was_kept
    assert_same(again, changed)
    grid = changed.points.files[0].parent
    raw = bytearray((grid / "offsets.npy").read_bytes())
    raw[-8] ^= 1
    (grid / "offsets.npy").write_bytes(raw)
    mended, was_kept = opened(files, monkeypatch)  # the damaged grid is built again
    assert not was_kept
    assert_same(mended, changed)
    opened(files, monkeypatch)
    (grid / "meta.json").unlink()  # as of a grid whose points were damaged
    assert not is_cached(files)
    assert not opened(files, monkeypatch)[1]
    monkeypatch.setattr(kept_place, "_VERSIONS", [])
    assert not opened(files, monkeypatch)[1]
    fewer, was_kept = opened(files[:2], monkeypatch)
    assert not was_kept and fewer.count == 4000 + 4500


def test_a_damaged_file_is_not_used_and_written_again(files, monkeypatch):
    joined, _ = opened(files, monkeypatch)
    assert opened(files, monkeypatch)[1]
    kept, rng = kept_file(), np.random.default_rng()
    whole = kept.read_bytes()
    for place in (0, 4, 7, 8, len(whole) - 1, *rng.integers(0, len(whole), 4).tolist()):
        raw = bytearray(whole)
        raw[place] ^= 1 << int(rng.integers(8))
        kept.write_bytes(raw)
        assert not opened(files, monkeypatch)[1], place
        assert kept.read_bytes() == whole
    for length in (0, 5, 8, len(whole) // 2):
        kept.write_bytes(whole[:length])
        again, was_kept = opened(files, monkeypatch)
        assert not was_kept and kept.read_bytes() == whole
    assert_same(again, joined)


def test_what_another_window_replaces_while_it_is_joined_is_not_kept_as_its_state(files, monkeypatch):
    opened(files, monkeypatch)
    kept_file().unlink()
    load = kept_place.stored.load
    with monkeypatch.context() as patch:
        def loading(folder, *given, **options):
            scene = load(folder, *given, **options)
            os.utime(folder / "offsets.npy", ns=(1, 1))  # another window has renamed its grid over this one
            return scene

        patch.setattr(kept_place.stored, "load", loading)
        opened(files, monkeypatch)
    assert not opened(files, monkeypatch)[1]
    assert opened(files, monkeypatch)[1]


def test_the_places_written_last_are_kept(files, monkeypatch):
    monkeypatch.setattr(kept_place, "MOST_KEPT", 2)
    places = [files, files[:2], files[1:]]
    for number, place in enumerate(places):
        opened(place, monkeypatch)
        for kept in kept_file().parent.glob("joined-*"):
            if kept.stat().st_mtime_ns > 10:
                os.utime(kept, ns=(number, number))  # clocks of file systems are coarse
    assert [opened(place, monkeypatch)[1] for place in (files[1:], files[:2], files)] == [True, True, False]
