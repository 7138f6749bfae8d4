"""Walking in a synthetic room whose floor, walls, stair, table and gap are known."""

from dataclasses import replace

import numpy as np
import pytest

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.clip import box_around
from pointglass.viewer.window.flight.navigation import FlyState, Motion, view_along
from pointglass.viewer.window.flight.walking import EYE_HEIGHT, PACE, stand, walk
from pointglass.viewer.work.places.up_axis import upright_axes
from pointglass.viewer.work.places.walk_map import BODY, build_walk_map
from pointglass.viewer.work.selection import Selection

RISER, TREAD, STEPS = 0.18, 0.28, 5
FLOOR = 0.3
ROOM = (8.0, 6.0)
DENSITY = 900.0
"""Points a square metre."""


def patch(rng, low, high) -> np.ndarray:
    """Points of the axis-aligned rectangle between two corners that share one coordinate."""
    low, high = np.array(low, float), np.array(high, float)
    area = np.prod([side for side in high - low if side > 0])
    return low + rng.random((int(area * DENSITY), 3)) * (high - low)


def points(rng) -> np.ndarray:
    """A room of 8 x 6 m with its floor at 0.3: a gap of 0.7 m radius around (2, 1.5), a table of 0.75 m around (4, 4.5), a step
    of 0.3 m at x > 6.5 and y < 1, a stair along x = 0 .. 1.4 up to a platform at its end (y 4.5 to 6), a doorway of 0.9 m in
    the wall x = 8 around y = 3, and nothing behind that.  Noise: 3 mm."""
    width, depth = ROOM
    floor = patch(rng, (0, 0, FLOOR), (width, depth, FLOOR))
    floor = floor[np.hypot(floor[:, 0] - 2.0, floor[:, 1] - 1.5) > 0.7]
    wall = patch(rng, (width, 0, FLOOR), (width, depth, 3.0))
    parts = [floor, wall[np.abs(wall[:, 1] - 3.0) > 0.45], patch(rng, (0, 0, FLOOR), (0, depth, 3.0)),
             patch(rng, (0, 0, FLOOR), (width, 0, 3.0)), patch(rng, (0, depth, FLOOR), (width, depth, 3.0)),
             patch(rng, (3.5, 4.0, FLOOR + 0.75), (4.5, 5.0, FLOOR + 0.75)),
             patch(rng, (6.5, 0, FLOOR + 0.3), (width, 1.0, FLOOR + 0.3)), patch(rng, (6.5, 0, FLOOR), (6.5, 1.0, FLOOR + 0.3))]
    for number in range(STEPS):
        y, z = 3.1 + number * TREAD, FLOOR + number * RISER
        parts += [patch(rng, (0, y, z), (1.4, y, z + RISER)), patch(rng, (0, y, z + RISER), (1.4, y + TREAD, z + RISER))]
    top = FLOOR + STEPS * RISER
    parts += [patch(rng, (0, 3.1 + STEPS * TREAD, top), (1.4, depth, top)),
              patch(rng, (1.4, 3.1, FLOOR), (1.4, depth, top + 1.0))]
    made = np.concatenate(parts)
    return made + rng.normal(0, 0.003, made.shape)


def scene_of(xyz):
    return scene_from_arrays(xyz, np.full((len(xyz), 3), 90, np.uint8))


@pytest.fixture(scope="module")
def world():
    return points(np.random.default_rng(3))


@pytest.fixture(scope="module")
def walk_map(world):
    made = build_walk_map(Selection(scene_of(world)), np.eye(3), 1.0)
    assert made is not None
    return made


def go(walk_map, start, heading, seconds=3.0, feet=FLOOR, fps=30):
    """The states of a walk from ``start`` (2,) along ``heading`` (2,), and its last height of the feet; ends where it ends."""
    state = view_along((*start, feet + EYE_HEIGHT), (*heading, -0.3), PACE)
    walker = stand(walk_map, state)
    assert walker is not None
    states = [state]
    for _ in range(int(seconds * fps)):
        after = walker.step(states[-1], Motion(forward=1.0), 1 / fps)
        if after is None:
            return states, None
        states.append(after)
    return states, walker.feet


def test_the_floor_is_where_it_was_made(walk_map, seed):
    rng = np.random.default_rng(seed)
    for x, y in rng.uniform((1.8, 2.6), (7.6, 3.6), (50, 2)):
        assert walk_map.floor_below(x, y, FLOOR + rng.uniform(-0.3, 0.3)) == pytest.approx(FLOOR, abs=0.02)
    assert walk_map.floor_below(7.3, 0.5, FLOOR) == pytest.approx(FLOOR + 0.3, abs=0.02)
    assert walk_map.floor_below(12.0, 3.0, FLOOR) is None and walk_map.floor_below(-1e7, 1e9, FLOOR) is None


def test_the_eye_stays_at_its_height_on_a_level_floor(walk_map):
    states, _ = go(walk_map, (3.0, 3.0), (1.0, 0.1), 2.0)
    heights = np.array([state.position[2] for state in states])
    assert np.abs(heights - FLOOR - EYE_HEIGHT).max() < 0.03
    assert np.linalg.norm(states[-1].position - states[0].position) == pytest.approx(2.0 * PACE, abs=0.3)
    assert states[-1].pitch == states[0].pitch


def test_walls_are_not_passed_and_one_slides_along_them(walk_map, seed):
    rng = np.random.default_rng(seed)
    for turn in rng.uniform(-np.pi, np.pi, 12):
        states, feet = go(walk_map, rng.uniform((4.8, 2.0), (6.2, 3.9)), (np.cos(turn), np.sin(turn)), 5.0)
        if feet is None:  # through the doorway
            assert states[-1].position[0] > 8.0 and abs(states[-1].position[1] - 3.0) < 0.5
            continue
        x, y, _ = np.transpose([state.position for state in states])
        assert x.min() > BODY / 2 and y.min() > BODY / 2 and y.max() < 6.0 - BODY / 2
        assert x[np.abs(y - 3.0) > 0.5].max(initial=0.0) < 8.0 - BODY / 2
    states, _ = go(walk_map, (5.0, 5.0), (0.3, 1.0), 4.0)
    assert states[-1].position[0] > 5.6 and states[-1].position[1] > 5.4, "it slides along the wall y = 6"


def test_a_stair_is_climbed_and_a_table_is_not(walk_map):
    states, feet = go(walk_map, (0.7, 2.4), (0.0, 1.0), 3.0)
    assert feet == pytest.approx(FLOOR + STEPS * RISER, abs=0.03)
    heights = np.diff([state.position[2] for state in states])
    assert heights.max() < 0.1, "the eye rises smoothly"
    down, feet = go(walk_map, states[-1].position[:2], (0.0, -1.0), 3.0, FLOOR + STEPS * RISER)
    assert feet == pytest.approx(FLOOR, abs=0.03) and down[-1].position[1] < 3.0
    states, feet = go(walk_map, (4.0, 3.0), (0.0, 1.0))
    assert feet == pytest.approx(FLOOR, abs=0.02) and states[-1].position[1] < 4.0 - BODY / 2
    _, feet = go(walk_map, (7.3, 2.0), (0.0, -1.0), 1.2)
    assert feet == pytest.approx(FLOOR + 0.3, abs=0.03), "a step of 0.3 m"


def test_what_is_clipped_away_is_in_nobodys_way(world):
    table = replace(box_around((3.3, 3.8, FLOOR + 0.1), (4.7, 5.2, 2.5), "table"), removes=True)
    without = build_walk_map(Selection(scene_of(world), (table,)), np.eye(3), 1.0)
    assert without is not None
    states, feet = go(without, (4.0, 3.0), (0.0, 1.0))
    assert feet == pytest.approx(FLOOR, abs=0.02) and states[-1].position[1] > 5.4, "up to the wall"
    elsewhere = box_around((-50, -50, -50), (-40, -40, -40), "elsewhere")
    for sight in (Selection(scene_of(world), (elsewhere,)), Selection(scene_of(world), hidden=frozenset({0}))):
        assert build_walk_map(sight, np.eye(3), 1.0) is None, "nothing is left"


def test_a_gap_under_the_tripod_is_walked_over(walk_map):
    states, feet = go(walk_map, (2.0, 0.5), (0.0, 1.0), 2.0)
    assert feet == pytest.approx(FLOOR, abs=0.02) and states[-1].position[1] > 2.5
    assert np.abs([state.position[2] - FLOOR - EYE_HEIGHT for state in states]).max() < 0.05


def test_a_walk_ends_where_there_is_no_floor(walk_map):
    states, feet = go(walk_map, (6.0, 3.0), (1.0, 0.0), 8.0)
    assert feet is None and 8.0 < states[-1].position[0] < 9.0, "through the doorway, where nothing was measured"
    assert stand(walk_map, view_along((12.0, 3.0, 1.5), (1.0, 0.0, 0.0), 1.0)) is None
    assert stand(walk_map, view_along((4.0, 3.0, 20.0), (1.0, 0.0, 0.0), 1.0)) is None, "too high above the floor"
    assert stand(walk_map, view_along((4.0, 3.0, 2.8), (1.0, 0.0, 0.0), 1.0)).feet == pytest.approx(FLOOR, abs=0.02)


def test_a_long_stride_does_not_jump_through_a_wall(walk_map):
    place, feet, met = walk(walk_map, np.array([7.0, 1.8]), FLOOR, np.array([4.0, 0.0]))
    assert place[0] < 8.0 and feet is not None and met


def test_the_path_is_the_same_with_another_direction_up_units_and_origin(world, seed):
    """The world turned so that y is up, in feet, far from the origin."""
    upright, metre, shift = upright_axes((0.0, 1.0, 0.0)), 1 / 0.3048, np.random.default_rng(seed).uniform(-5e6, 5e6, 3)
    turned = build_walk_map(Selection(scene_of(world * metre @ upright.T + shift)), upright, metre)
    plain = build_walk_map(Selection(scene_of(world)), np.eye(3), 1.0)
    assert turned is not None and plain is not None
    states = []
    for walk_map, axes, unit, origin in ((plain, np.eye(3), 1.0, np.zeros(3)), (turned, upright, metre, shift)):
        state = FlyState(axes @ np.array([2.0, 3.0, FLOOR + 1.6]) * unit + origin, 0.1, -0.2, PACE * unit, upright=axes)
        walker = stand(walk_map, state)
        assert walker is not None
        for _ in range(60):
            after = walker.step(state, Motion(forward=1.0, up=1.0, look=(2.0, 0.0)), 1 / 30)
            assert after is not None
            state = after
        states.append(axes.T @ ((state.position - origin) / unit))
    assert np.allclose(*states, atol=0.05)


def test_a_coarse_scan_has_no_map():
    rng = np.random.default_rng(0)
    assert build_walk_map(Selection(scene_of(rng.random((400, 3)) * (20, 20, 0.01))), np.eye(3), 1.0) is None
