"""Splats of points: the compiled loops equal their plain reference, the budget holds, and surfaces get no holes."""

import numpy as np
from plain_splats import cells_by_number, chosen_cells, plain_splat
from splat_raster import draw_splats

from pointglass.model.common.linear_light import to_srgb
from pointglass.viewer.work.splats.make_splats import splats_of_points
from pointglass.viewer.work.splats.shape_loops import shapes
from pointglass.viewer.work.splats.splat_budget import Chosen, choose
from pointglass.viewer.work.splats.splat_cell_loops import gathered_bits
from pointglass.viewer.work.splats.splat_cells import levels_of
from pointglass.viewer.work.splats.splat_cloud import matrices_of, quaternion_of
from pointglass.viewer.work.splats.splat_shapes import FAINT, OPACITY, shapes_of

NONE = np.zeros((0, 3))


def clutter(rng, count=3000):
    """Two planes that meet, a wire, and stray points, none below 0, with colours, some of them missing."""
    flat = rng.random((count, 2))
    floor, wall = np.c_[flat, np.full(count, 0.02)], np.c_[flat[:, 0], np.zeros(count), flat[:, 1]]
    planes = np.where(rng.random((count, 1)) < 0.5, floor, wall)
    planes += rng.normal(0, 0.002, planes.shape)
    wire = np.c_[rng.random((60, 1)), np.full((60, 2), 0.5)]
    xyz = np.abs(np.concatenate([planes, wire, rng.random((40, 3))]))
    coloured = np.c_[rng.integers(0, 256, (len(xyz), 3)), np.ones(len(xyz))].astype(np.uint8)
    return xyz, coloured


def numbers_of(level):
    return list(zip(*(gathered_bits.py_func(level.keys >> axis).tolist() for axis in range(3))))


def test_moments_of_every_level_are_those_of_the_points_inside(seed):
    rng = np.random.default_rng(seed)
    xyz, coloured = clutter(rng)
    coloured[rng.random(len(xyz)) < 0.2, 3] = 0
    levels = levels_of(xyz, coloured, 0.03, 10**6)
    assert len(levels[-1]) == 1 and levels[-1].places[0, 0] == len(xyz)
    for level in levels:
        cells = cells_by_number(xyz, level.side)
        found = numbers_of(level)
        assert set(found) == set(cells)
        for row in rng.choice(len(found), min(len(found), 40), replace=False):
            inside = cells[found[row]]
            middle = xyz[inside].mean(axis=0)
            centre = (np.array(found[row]) + 0.5) * level.side
            assert np.allclose(level.places[row, 1:4] + centre, middle, atol=1e-5 * level.side)
            about = (xyz[inside] - middle).T @ (xyz[inside] - middle)
            slack = 1e-5 * level.side**2 * len(inside)
            assert np.allclose(level.places[row, 4:], about[np.triu_indices(3)], rtol=1e-3, atol=slack)
            srgb = coloured[inside][coloured[inside, 3] > 0, :3] / 255.0
            assert level.colours[row, 0] == len(srgb)
            if len(srgb):
                assert np.allclose(level.colours[row, 4:7], srgb.mean(axis=0), atol=1e-5)
                assert np.isclose(level.colours[row, 7], ((srgb - srgb.mean(axis=0)) ** 2).sum(), rtol=1e-3, atol=1e-4)


def test_the_chosen_cells_are_the_reference_s_hold_every_point_once_and_keep_the_budget(seed):
    rng = np.random.default_rng(seed)
    xyz, coloured = clutter(rng)
    levels = levels_of(xyz, coloured, 0.03, 10**6)
    errors = [rng.lognormal(size=len(level)) for level in levels]
    for budget in (1, 7, 150, 10**6):
        chosen = choose(levels, errors, budget)
        cells = {(some.level, numbers_of(levels[some.level])[row]) for some in chosen for row in some.cells}
        assert 1 <= len(cells) <= budget
        assert sum(levels[some.level].places[some.cells, 0].sum() for some in chosen) == len(xyz)
        assert len(cells) == len(levels[0]) if budget == 10**6 else len(cells) < len(levels[0])
    # the threshold lies between the worst of the chosen and the best of the divided cells; the reference divides by it
    chosen = choose(levels, errors, 150)
    named = [dict(zip(numbers_of(level), error.tolist())) for level, error in zip(levels, errors)]
    cells = {(some.level, numbers_of(levels[some.level])[row]) for some in chosen for row in some.cells}
    thresholds = sorted({value for error in errors for value in error.tolist()})
    low, high = 0, len(thresholds) - 1
    while low < high:  # the lowest threshold that keeps the budget
        middle = (low + high) // 2
        fits = len(chosen_cells(xyz, levels[0].side, len(levels) - 1, named, thresholds[middle])) <= 150
        low, high = (low, middle) if fits else (middle + 1, high)
    best = chosen_cells(xyz, levels[0].side, len(levels) - 1, named, thresholds[low])
    assert len(cells) <= len(best) and len(cells ^ best) <= 16  # thresholds are steps of 1/8192 of the range


def test_shapes_equal_the_reference(seed):
    rng = np.random.default_rng(seed)
    xyz, coloured = clutter(rng)
    levels = levels_of(xyz, coloured, 0.04, 10**6)
    noise, tint, spread, lonely = 0.002, 0.05, 0.6, 0.05
    for number, up, reach in ((0, 0, 0), (0, 0, 1), (0, 1, 1), (1, 0, 1)):
        level, above = levels[number], levels[number + up]
        k = len(level)
        done, faint = np.zeros(k, bool), np.zeros(k, bool)
        centre, axes, deviations, linear = np.empty((k, 3)), np.empty((k, 3, 3)), np.empty((k, 3)), np.empty((k, 3))
        shapes(np.arange(k), level.keys, level.side, level.places, level.colours, up, above.keys, above.side, above.places,
               above.colours, above.table(), reach, noise, np.full(k, tint), spread, lonely, done, faint, centre, axes,
               deviations, linear, 0, k)
        own, wide, names = cells_by_number(xyz, level.side), cells_by_number(xyz, above.side), numbers_of(level)
        checked = 0
        for row in rng.choice(k, min(k, 120), replace=False):
            inside = own[names[row]]
            middle = np.array(names[row]) >> up
            around = np.concatenate([wide[place] for step in np.ndindex(*(2 * reach + 1,) * 3)
                                     if (place := tuple((middle + step - reach).tolist())) in wide])
            plain = plain_splat(xyz[inside], coloured[inside, :3], xyz[around], coloured[around, :3], side=level.side,
                                widest=(2 * reach + 1) * above.side, alone=reach == 0, noise=noise, colour_noise=tint,
                                spread=spread, lonely=lonely)
            turned = axes[row] * deviations[row]
            if (faint[row], done[row]) != (plain.faint, plain.done):
                continue  # float32 moments beside a threshold
            checked += 1
            assert np.allclose(axes[row].T @ axes[row], np.eye(3)) and np.isclose(np.linalg.det(axes[row]), 1)
            assert np.allclose(centre[row], plain.centre, atol=2e-3 * level.side)
            sizes = np.sort(deviations[row] ** 2)
            assert np.allclose(sizes, np.linalg.eigvalsh(plain.covariance), rtol=2e-2, atol=1e-9)
            if plain.done:  # else axes are those of a few points, any
                assert np.allclose(turned @ turned.T, plain.covariance, atol=1e-2 * sizes[2])
            assert np.allclose(linear[row], plain.linear, atol=2e-3)
        assert checked > 0.9 * min(k, 120)


def test_a_wall_has_no_hole_at_any_budget_and_texture_gets_more_splats_than_paint(seed):
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes *= np.sign(np.linalg.det(axes))
    flat = rng.random((60_000, 2)) * [4, 2]
    xyz = (np.c_[flat - [2, 1], rng.normal(0, 0.002, len(flat))]) @ axes.T + 100
    checks = np.where(((flat * 20).astype(int).sum(axis=1) % 2)[:, None] == 1, 230, 30)  # squares of 5 cm on the left half
    rgb = np.where(flat[:, :1] < 2, np.repeat(checks, 3, axis=1), 128)
    coloured = np.c_[rgb, np.ones(len(rgb))].astype(np.uint8)
    view = np.eye(4)
    view[:3, :3] = np.diag([1, -1, -1]) @ axes.T
    view[:3, 3] = -view[:3, :3] @ (100 + axes @ [0, 0, 3.0])
    for budget in (2_000, 8_000, 50_000):
        splats = splats_of_points(xyz, coloured, budget, NONE)
        assert 0.5 * budget < len(splats) <= budget and splats.points.sum() == len(xyz)
        picture, covered = draw_splats(splats.xyz + splats.origin, matrices_of(splats.rotation), splats.scale, splats.rgb,
                                       splats.opacity, world_to_view=view, fx=150, fy=150, cx=120, cy=90, size=(240, 180))
        inside = covered[45:135, 25:215]
        assert inside.min() > 0.5 and inside.mean() > 0.96, budget  # 0.976 at least with 30 seeds
        assert abs(np.median(picture[60:120, 130:210]) - 128 / 255) < 0.02
        left = ((splats.xyz + splats.origin - 100) @ axes)[:, 0] < 0
        normals = splats.normals() @ axes[:, 2]
        assert np.quantile(np.abs(normals), 0.1) > 0.95
    # of the budget in the middle the checks take most
    splats = splats_of_points(xyz, coloured, 8_000, NONE)
    left = ((splats.xyz + splats.origin - 100) @ axes)[:, 0] < 0
    assert left.mean() > 0.7


def test_near_scanners_splats_are_finer(seed):
    rng = np.random.default_rng(seed)
    xyz = np.c_[rng.random((80_000, 2)) * [40, 4], np.zeros(80_000)]
    coloured = np.c_[rng.integers(0, 256, (len(xyz), 3)), np.ones(len(xyz))].astype(np.uint8)
    splats = splats_of_points(xyz, coloured, 20_000, np.array([[0.0, 2, 1.5]]))
    x = splats.xyz[:, 0] + splats.origin[0]
    assert (x < 10).sum() > 3 * (x > 30).sum() > 0


def test_points_without_colour_take_that_of_their_surroundings(seed):
    rng = np.random.default_rng(seed)
    xyz = np.c_[rng.random((20_000, 2)), np.zeros(20_000)]
    coloured = np.tile(np.array([200, 100, 50, 1], np.uint8), (len(xyz), 1))
    coloured[rng.random(len(xyz)) < 0.5] = 0
    splats = splats_of_points(xyz, coloured, 20_000, NONE)
    assert np.abs(splats.rgb * 255 - [200, 100, 50]).max() < 1


def test_single_points_off_a_surface_are_faint_and_small(seed):
    rng = np.random.default_rng(seed)
    wall = np.c_[rng.random((40_000, 2)), rng.normal(0, 0.0005, 40_000)]
    strays = np.c_[rng.uniform(0.1, 0.9, (12, 2)), rng.uniform(0.1, 0.3, 12)]
    xyz = np.concatenate([wall, strays])
    splats = splats_of_points(xyz, np.full((len(xyz), 4), 255, np.uint8), 10_000, NONE)
    off = splats.xyz[:, 2] + splats.origin[2] > 0.05
    assert 8 <= off.sum() <= 12 and (splats.opacity[off] <= np.float32(FAINT)).mean() > 0.9
    assert (splats.opacity[~off] == np.float32(OPACITY)).mean() > 0.99
    assert np.median(splats.scale[off, 0]) < 0.02


def test_one_point_is_one_splat():
    splats = splats_of_points(np.array([[5.0, 6, 7]]), np.full((1, 4), 255, np.uint8), 1000, NONE)
    assert len(splats) == 1 and np.isfinite(splats.xyz).all() and (splats.scale > 0).all() and (splats.rgb == 1).all()


def test_turning_splats_turns_their_gaussians(seed):
    rng = np.random.default_rng(seed)
    splats = splats_of_points(rng.random((500, 3)) * 9, np.full((500, 4), 99, np.uint8), 1000, NONE)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes *= np.sign(np.linalg.det(axes))
    turned = splats.turned(axes, 2.5)

    def covariances(of):
        stretched = matrices_of(of.rotation) * of.scale[:, None, :].astype(float)
        return stretched @ stretched.transpose(0, 2, 1)

    assert np.allclose(turned.xyz, 2.5 * splats.xyz @ axes.T)
    assert np.allclose(covariances(turned), 2.5**2 * axes @ covariances(splats) @ axes.T, rtol=1e-4, atol=1e-5)
    assert np.isclose(np.abs(quaternion_of(axes)).max() <= 1, True)


def test_the_rasteriser_draws_the_projected_gaussian_and_blends_by_depth(seed):
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    scale, place = np.array([0.3, 0.2, 0.05]), np.array([0.1, -0.2, 4.0])
    near, far = np.array([1.0, 0.2, 0.1]), np.array([0.0, 0.5, 1.0])
    wall = np.array([0.0, 0, 9])
    picture, covered = draw_splats(np.stack([wall, place]), np.stack([np.eye(3), axes]), np.stack([[50.0, 50, 1], scale]),
                                   np.stack([far, near]), np.array([1.0, 0.8]), world_to_view=np.eye(4), fx=200, fy=220, cx=60,
                                   cy=50, size=(120, 100))
    x, y, z = place
    jacobian = np.array([[200 / z, 0, -200 * x / z**2], [0, 220 / z, -220 * y / z**2]])
    spread = jacobian @ (axes * scale**2) @ axes.T @ jacobian.T + 0.3 * np.eye(2)
    v, u = np.mgrid[:100, :120] + 0.5
    off = np.stack([u - 200 * x / z - 60, v - 220 * y / z - 50], axis=-1)
    power = np.einsum("hwi,ij,hwj->hw", off, np.linalg.inv(spread), off)
    alpha = np.where(power <= 9, 0.8 * np.exp(-power / 2), 0)[..., None]
    alpha = np.where(alpha < 1 / 255, 0, alpha)
    expected = alpha * near + (1 - alpha) * 0.99 * far
    assert np.abs(picture - expected).max() < 0.01 and covered.min() > 0.98


def test_shapes_are_made_level_by_level_in_blocks(seed):
    rng = np.random.default_rng(seed)
    xyz, coloured = clutter(rng)
    levels = levels_of(xyz, coloured, 0.04, 10**6)
    every = shapes_of(levels, Chosen(0, np.arange(len(levels[0]))), 0.002, np.zeros(len(levels[0])), 0.02)
    some = shapes_of(levels, Chosen(0, np.arange(5, 25)), 0.002, np.zeros(20), 0.02)
    assert np.array_equal(every.centre[5:25], some.centre) and np.array_equal(every.rgb[5:25], some.rgb)
    assert (every.rgb >= 0).all() and (every.rgb <= 1).all() and np.isfinite(to_srgb(every.rgb)).all()
