"""Lines traced along walls: where the walls are, as long as they are, and nowhere else."""

from itertools import pairwise

import numpy as np
import pytest

from pointglass.viewer.work.sheets.cut_lines import Polyline, Trace, trace

THICK = 0.2
"""Metres, of the slab."""
DOOR = (2.0, 2.9)
"""Between these y the partition at x = 5 m is open."""
WALLS = [((0, 0), (8, 0)), ((8, 0), (8, 6)), ((8, 6), (0, 6)), ((0, 6), (0, 0))]
WALLS += [part for x in (5.0, 5.12) for part in (((x, 0), (x, DOOR[0])), ((x, DOOR[1]), (x, 6)))]
"""A room of 8 x 6 m with a partition of 12 cm, both of whose faces were measured."""


def turn(rng):
    """A rotation (2, 2) and an offset (2,) as of a national grid."""
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]), rng.uniform(-1, 1, 2) * 6e5


def slab(rng, noise, spacing, walls=WALLS, density=1.0):
    """(n, 2): points at random places along the walls, as a slab of THICK at ``spacing`` holds, with noise across and along."""
    parts = []
    for begin, end in np.array(walls, np.float64):
        count = rng.poisson(density * THICK / spacing**2 * np.linalg.norm(end - begin))
        parts.append(begin + rng.random((count, 1)) * (end - begin))
    points = np.concatenate(parts)
    return points + rng.normal(0, noise, points.shape)


def along(lines: list[Polyline] | tuple[Polyline, ...], step=0.01) -> np.ndarray:
    """(n, 2): places on lines, ``step`` apart."""
    parts = []
    for line in lines:
        ring = np.concatenate([line.vertices, line.vertices[:1]]) if line.closed else line.vertices
        for begin, end in pairwise(ring):
            share = np.linspace(0, 1, max(2, int(np.linalg.norm(end - begin) / step)))[:, None]
            parts.append(begin + share * (end - begin))
    return np.concatenate(parts) if parts else np.empty((0, 2))


def away(places, walls=WALLS) -> np.ndarray:
    """(n,): distance of places from the nearest wall."""
    nearest = np.full(len(places), np.inf)
    for begin, end in np.array(walls, np.float64):
        way = end - begin
        share = np.clip((places - begin) @ way / (way @ way), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(places - begin - share[:, None] * way, axis=1))
    return nearest


def found_share(trace: Trace, back, walls=WALLS, within=0.005) -> float:
    """The share of the walls' length that has a line within ``within``."""
    from scipy.spatial import KDTree

    places = along([Polyline(np.array(wall, np.float64), False) for wall in walls])
    return float((KDTree(back(along(trace.lines, 0.002))).query(places)[0] <= within).mean())


@pytest.mark.parametrize("noise", [0.001, 0.002, 0.003, 0.005])
@pytest.mark.parametrize("spacing", [0.005, 0.012])
def test_walls_are_traced_within_a_fraction_of_the_noise_and_doors_stay_open(noise, spacing, seed):
    rng = np.random.default_rng(seed)
    rotation, offset = turn(rng)
    lines = trace(slab(rng, noise, spacing) @ rotation.T + offset, spacing)

    def back(places):
        return (places - offset) @ rotation

    places = back(along(lines.lines))
    distance = away(places)
    assert np.sqrt((distance**2).mean()) <= 0.0002 + 0.1 * noise, "root mean square"
    assert np.quantile(distance, 0.99) <= 0.0005 + 0.2 * noise and distance.max() <= 0.002 + 3.5 * noise
    assert found_share(lines, back) > 0.98
    assert abs(lines.length / sum(np.linalg.norm(np.subtract(*wall)) for wall in WALLS) - 1) < 0.02
    in_door = (np.abs(places[:, 0] - 5.06) < 0.2) & (places[:, 1] > DOOR[0] + 4 * noise) & (places[:, 1] < DOOR[1] - 4 * noise)
    assert not in_door.any()
    assert lines.sigma == pytest.approx(noise, rel=0.15)


def test_corners_are_one_vertex_where_both_walls_meet(seed):
    rng = np.random.default_rng(seed)
    lines = trace(slab(rng, 0.002, 0.01, WALLS[:4]), 0.01)
    (line,) = lines.lines
    assert line.closed and len(line.vertices) == 4
    corners = np.array([[0, 0], [8, 0], [8, 6], [0, 6]])
    assert np.linalg.norm(line.vertices[:, None] - corners, axis=2).min(axis=1).max() < 0.0015


def test_no_line_is_drawn_where_nothing_was_measured(seed):
    """Of walls with gaps of random lengths and of clutter: a measured point lies within the stated gap of every place."""
    from scipy.spatial import KDTree

    rng = np.random.default_rng(seed)
    walls = []
    for y in np.arange(0, 6, 0.7):
        edges = np.cumsum(rng.uniform(0.05, 1.5, 8))
        walls += [((a, y), (b, y + 0.1)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    points = np.concatenate([slab(rng, 0.002, 0.01, walls), rng.random((30_000, 2)) * [2, 3] + [3, 1]])
    lines = trace(points, 0.01)
    assert len(lines.lines) > 5
    assert KDTree(points).query(along(lines.lines))[0].max() <= lines.gap / 2 + lines.tolerance


def test_what_fills_an_area_has_no_lines(seed):
    rng = np.random.default_rng(seed)
    points = rng.random((40_000, 2)) * [3.0, 1.2]  # a table's top
    inside = trace(points, 0.01)
    places = along(inside.lines)
    assert not ((places > 0.1) & (places < [2.9, 1.1])).all(axis=1).any()
    assert inside.length < 0.5


def test_a_round_column_is_a_polygon_around_its_circle(seed):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi, 40_000)
    points = 0.3 * np.stack([np.cos(angle), np.sin(angle)], axis=1) + rng.normal(0, 0.001, (40_000, 2))
    lines = trace(points, 0.006)  # at most 12.6 mm away in 60 runs, at a corner of the polygon
    radii = np.linalg.norm(along(lines.lines), axis=1)
    assert np.abs(radii - 0.3).max() < 0.016 and lines.length > 0.8 * 2 * np.pi * 0.3


@pytest.mark.parametrize("points", [np.empty((0, 2)), np.ones((1, 2)), np.ones((500, 2)),
                                    np.random.default_rng(0).random((9, 2))])
def test_too_few_points_have_no_lines(points):
    lines = trace(points, 0.01)
    assert lines.lines == () and lines.count == len(points) and lines.length == 0.0


def test_the_same_points_give_the_same_lines(seed):
    points = slab(np.random.default_rng(seed), 0.003, 0.012)
    first, second = trace(points, 0.012), trace(points, 0.012)
    assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(first.lines, second.lines, strict=True))
