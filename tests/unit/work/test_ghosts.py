"""Passers-by: what one station measured and another one looked through is found, hidden and exported, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from swept_room import PLACES, ROOM, hits
from untyped import read_las

from pointglass.viewer.commands.exporting.command import export
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.grid.scene import packed, unpack
from pointglass.viewer.picture.edits import GHOSTS, Edits
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary
from pointglass.viewer.stream.chunk_source import ChunkSource
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.ghosts import find_ghosts, prepared, with_ghosts
from pointglass.viewer.work.selection import Selection


def swept(seed: int, *, rays: int = 60_000, radius: float = 0.25, height: float = 1.7, scale: float = 1.0,
          origin=(0.0, 0.0, 0.0)):
    """The room from three stations; a cylinder stands in the scan of the first only.  Returns the scene and (n,) bool, which of
    its points are the cylinder's."""
    rng = np.random.default_rng(seed)
    xyz, station, ghost = [], [], []
    for number, place in enumerate(PLACES):
        ray = rng.normal(size=(rays, 3))
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        found = hits(place, ray)
        range_ = np.linalg.norm(found - place, axis=1)
        met = np.zeros(rays, bool)
        if number == 0:
            flat, start = ray[:, :2], place[:2] - np.array([0.3, 0.4])
            a, b, c = (flat**2).sum(axis=1), flat @ start, start @ start - radius**2
            with np.errstate(invalid="ignore"):
                t = (-b - np.sqrt(b * b - a * c)) / a
            up = place[2] + t * ray[:, 2]
            met = (t > 0) & (t < range_) & (up > -ROOM[2]) & (up < height - ROOM[2])
            range_ = np.where(met, t, range_)
        xyz.append(place + ray * (range_ + rng.normal(0, 0.002, rays))[:, None])
        station.append(np.full(rays, number))
        ghost.append(met)
    places = PLACES * scale + origin
    xyz, ghost = np.concatenate(xyz) * scale + origin, np.concatenate(ghost)
    rgb = rng.integers(40, 256, (len(xyz), 3), dtype=np.uint8)
    rgb[:, 2] = np.where(ghost, 255, np.minimum(rgb[:, 2], 254))  # tells it in the scene
    meta = ScanDescription(scans=tuple(ScanSummary(f"tripod {n}", 0, tuple(place)) for n, place in enumerate(places.tolist())))
    scene = scene_from_arrays(xyz, rgb, scan=np.concatenate(station).astype(np.uint8), meta=meta, noise=False)
    return scene, unpack(scene)[1][:, 2] == 255


@pytest.mark.parametrize(("scale", "origin"), [(1.0, (0.0, 0.0, 0.0)), (1000.0, (4e8, 5.7e9, 2e5))])
def test_a_person_in_one_scan_is_found_and_nothing_else(seed, scale, origin):
    scene, ghost = swept(seed, scale=scale, origin=np.array(origin))
    found = np.zeros(scene.count, bool)
    found[find_ghosts(scene)] = True
    assert ghost.sum() > 500
    assert (found & ghost).sum() > 0.7 * ghost.sum()  # near floor and ceiling the surface behind is too near
    assert (found & ~ghost).sum() < 1e-4 * scene.count


def test_a_room_without_passers_by_and_a_thin_pole_stay_whole(seed):
    for radius, height in ((0.25, 0.0), (0.01, 1.7)):
        scene, _ = swept(seed, radius=radius, height=height)
        assert len(find_ghosts(scene)) < 1e-4 * scene.count


def test_what_another_station_measured_as_well_is_no_ghost(seed):
    scene, ghost = swept(seed)
    rng = np.random.default_rng(seed)
    xyz, rgb, _, station = unpack(scene)
    confirmed = xyz[ghost] + rng.normal(0, 0.002, (ghost.sum(), 3))
    both = scene_from_arrays(np.concatenate([xyz, confirmed]), np.concatenate([rgb, rgb[ghost]]), noise=False, meta=scene.meta,
                             scan=np.concatenate([station, np.full(len(confirmed), 1, np.uint8)]))
    assert len(find_ghosts(both)) < 0.3 * ghost.sum()


def test_marks_are_the_same_in_slices_arrays_and_chunks_and_leave_the_points_alone(seed):
    scene, _ = swept(seed, rays=40_000)
    before = np.array(scene.points)
    marked = with_ghosts(scene)
    assert np.array_equal(scene.points, before) and marked.points is scene.points
    number = marked.marked.station
    assert number == 3 and len(marked.meta.scans) == 4 and len(scene.meta.scans) == 3
    whole = packed(marked)
    assert np.array_equal(np.flatnonzero(whole[:, 2] >> 24 == number), marked.marked.numbers)
    assert np.array_equal(whole[:, :2], before[:, :2]) and np.array_equal(whole[:, 2] & 0xFFFFFF, before[:, 2] & 0xFFFFFF)
    rng = np.random.default_rng(seed)
    some, mask = rng.integers(-scene.count, scene.count, 5000), rng.random(scene.count) < 0.3
    for index in (slice(1000, 70_000), slice(500, 90_000, 7), some, mask):
        assert np.array_equal(packed(marked, index), whole[index])
    source = ChunkSource(marked, 1 << 12)
    into = np.empty((1 << 12, 3), np.uint32)
    assert all(np.array_equal(source.read(chunk, into), whole[chunk << 12 : chunk + 1 << 12]) for chunk in range(source.chunks))
    source.close()
    assert prepared(scene, "shown") is scene and prepared(marked, "hidden") is marked


@pytest.mark.parametrize("suffix", [".ply", ".laz"])
def test_an_export_leaves_hidden_ghosts_out_and_gives_shown_ones_their_own_station(tmp_path, seed, suffix):
    scene, _ = swept(seed, rays=30_000)
    marked = with_ghosts(scene)
    hidden = frozenset({marked.marked.station})
    assert export(Selection(marked, hidden=hidden), tmp_path / f"left{suffix}") == scene.count - len(marked.marked.numbers)
    assert export(Selection(marked), tmp_path / f"all{suffix}") == scene.count
    if suffix == ".laz":

        assert np.array_equal(np.bincount(read_las(tmp_path / "all.laz").point_source_id)[1:], [30_000] * 3)
    left = open_scene([tmp_path / f"left{suffix}"], cache=False, match=False)
    kept = np.ones(scene.count, bool)
    kept[marked.marked.numbers] = False
    assert np.array_equal(np.sort(unpack(left)[1].astype(int) @ [65536, 256, 1]),
                          np.sort(unpack(scene)[1][kept].astype(int) @ [65536, 256, 1]))


def test_a_scan_without_two_known_positions_is_refused_in_one_line(seed):
    scene, _ = swept(seed, rays=2000)
    with pytest.raises(InputError, match="this scan has 1 station with a known position"):
        find_ghosts(replace(scene, meta=ScanDescription(scans=(scene.meta.scans[0], ScanSummary("b", 0), ScanSummary("c", 0)))))
    with pytest.raises(InputError, match="255 stations"):
        find_ghosts(replace(scene, meta=replace(scene.meta, scans=scene.meta.scans * 85)))
    for made in (Document, Edits):
        with pytest.raises(InputError, match="ghosts 'gone': expected one of shown, dimmed, hidden"):
            made(ghosts="gone")
    assert Document().ghosts == GHOSTS[0]
