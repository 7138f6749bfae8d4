"""Culling and level of detail against brute force."""

import numpy as np
import pytest
from clouds import camera_in, room
from hypothesis import given, settings
from hypothesis import strategies as st

from viewer.cloud import unpack
from viewer.render.cull import Culler, split_runs

SCENE = room(5, 20_000)
CULLER = Culler(SCENE)
XYZ, _, _, _ = unpack(SCENE)
CELLS = SCENE.cell_of_points()


@given(st.integers(0, 10**9), st.floats(1.0, 170.0))
@settings(max_examples=200, deadline=None)
def test_culling_never_drops_a_visible_point(seed, fov):
    camera = camera_in(SCENE, seed, (97, 61), fov)
    rows, _ = CULLER.visible(camera)
    view = (XYZ - camera.position) @ camera.view_rotation.T
    z = view[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = camera.fx * view[:, 0] / z + camera.cx, camera.fy * view[:, 1] / z + camera.cy
    inside = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    assert set(np.unique(CELLS[inside])) <= set(rows)


@pytest.mark.parametrize("seed", range(5))
def test_without_level_of_detail_every_point_of_a_visible_cell_is_drawn_once(seed):
    draw = CULLER.select(camera_in(SCENE, seed))
    drawn = np.zeros(SCENE.count, int)
    for first, count in zip(draw.first, draw.count, strict=True):
        drawn[first : first + count] += 1
    assert np.array_equal(drawn == 1, np.isin(CELLS, draw.cells)) and drawn.max() <= 1
    assert (np.diff(draw.first) > 0).all()


def test_level_of_detail_draws_fewer_points_and_whole_layers():
    scene = room(6, 400_000)
    culler = Culler(scene)
    camera = camera_in(scene, 2, (80, 60))
    counts = [culler.select(camera, lod).points for lod in (0.5, 2.0, 8.0, None)]
    assert counts[0] < counts[1] <= counts[2] <= counts[3]
    starts = {int(o) for o in scene.offsets}
    assert {int(f) for f in culler.select(camera, 0.5).first} <= starts


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(1, 700)), min_size=1, max_size=20), st.integers(1, 300),
       st.booleans())
@settings(deadline=None)
def test_split_runs_covers_each_run_once(gaps, size, aligned):
    first, at = [], 0
    for gap, count in gaps:
        first.append(at + gap)
        at += gap + count
    first, count = np.array(first), np.array([c for _, c in gaps])
    pieces = split_runs(first, count, size, aligned=aligned)
    expected = [(p, r) for r, (f, c) in enumerate(zip(first, count, strict=True)) for p in range(f, f + c)]
    got = [(p, r) for f, c, r in zip(*pieces, strict=True) for p in range(f, f + c)]
    assert got == expected
    assert pieces[1].min() > 0 and pieces[1].max() <= size
    if aligned:
        assert (pieces[0] // size == (pieces[0] + pieces[1] - 1) // size).all()
