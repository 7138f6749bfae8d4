"""The synthetic place and its scanner: the kernel against a plain reference, the scanner's mistakes against their claims."""

import dataclasses
import itertools
import threading
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from untyped import read_las

from pointglass.model.common.linear_light import to_linear, to_srgb
from pointglass.model.common.process import processors
from pointglass.model.synth import demo, shapes
from pointglass.model.synth.builder import frame_along
from pointglass.model.synth.place import Place, pixel_rays
from pointglass.model.synth.scanner import IDEAL, ScannerModel, VirtualScanner


@pytest.fixture(scope="module")
def place() -> Place:
    return Place(1, probe_rays=0)


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def wall(distance: float = 3.0, slant: float = 0.0):
    """A trace callable: the plane x = distance + slant * y and all around an endless room, in grey."""

    def trace(origins, rays):
        normal = unit(np.array([-1.0, slant, 0.0]))
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (np.array([distance, 0, 0]) - origins) @ normal / (rays @ normal)
        t = np.where(t > 0, t, np.inf)
        n = len(t)
        return SimpleNamespace(t=t, rgb=np.full((n, 3), 0.5), normal=np.broadcast_to(normal, (n, 3)),
                               shininess=np.zeros(n), darkness=np.full(n, 0.3))

    return trace


def shell(radius: float):
    """A trace callable: a grey sphere around the scanner."""

    def trace(origins, rays):
        n = len(rays)
        return SimpleNamespace(t=np.full(n, radius), rgb=np.full((n, 3), 0.5), normal=-rays, shininess=np.zeros(n),
                               darkness=np.full(n, 0.3))

    return trace


# --- the kernel -----------------------------------------------------------------------------------------------------


def reference(kind, params, origins, rays):
    """(N,) first t > 0 of local rays on one local shape, by all candidate roots in float64 NumPy; inf for none."""
    p = params
    roots = []

    def quadratic(a, b, c):
        with np.errstate(all="ignore"):
            root = np.sqrt(b * b - a * c)
            return [(-b - root) / a, (-b + root) / a]

    def at(t):
        with np.errstate(all="ignore"):
            return origins + t[:, None] * rays

    def plane(axis, value):
        with np.errstate(all="ignore"):
            return (value - origins[:, axis]) / rays[:, axis]

    def accept(t, inside):
        with np.errstate(all="ignore"):
            roots.append(np.where(np.isfinite(t) & (t > 1e-6) & inside(at(t)), t, np.inf))

    def sphere(z, r):
        o = origins - [0, 0, z]
        return quadratic((rays**2).sum(1), (o * rays).sum(1), (o**2).sum(1) - r * r)

    if kind == shapes.BOX:
        for axis in range(3):
            other = [a for a in range(3) if a != axis]
            for side in (-1, 1):
                accept(plane(axis, side * p[axis]), lambda x, other=other: (np.abs(x[:, other]) <= p[other]).all(1))
    elif kind == shapes.QUAD:
        outlines = (
            lambda x: (np.abs(x[:, :2]) <= p[:2]).all(1),
            lambda x: ((x[:, :2] / p[:2]) ** 2).sum(1) <= 1,
            lambda x: (np.abs(x[:, 0]) <= p[0]) & (np.abs(x[:, 1]) <= p[1] * (1 - (x[:, 0] / p[0]) ** 2)),
        )
        accept(plane(2, 0.0), outlines[int(p[2])])
    elif kind == shapes.CYLINDER:
        m, k = (p[0] + p[1]) / 2, (p[1] - p[0]) / 2 / p[2]
        w, g = m + k * origins[:, 2], k * rays[:, 2]
        a = rays[:, 0] ** 2 + rays[:, 1] ** 2 - g * g
        b = (origins[:, :2] * rays[:, :2]).sum(1) - w * g
        for t in quadratic(a, b, (origins[:, :2] ** 2).sum(1) - w * w):
            accept(t, lambda x: np.abs(x[:, 2]) <= p[2])
        if p[3] > 0:
            for side, r in ((-1, p[0]), (1, p[1])):
                accept(plane(2, side * p[2]), lambda x, r=r: (x[:, :2] ** 2).sum(1) <= r * r)
    elif kind == shapes.CAPSULE:
        a, b = (rays[:, :2] ** 2).sum(1), (origins[:, :2] * rays[:, :2]).sum(1)
        for t in quadratic(a, b, (origins[:, :2] ** 2).sum(1) - p[0] ** 2):
            accept(t, lambda x: np.abs(x[:, 2]) <= p[1])
        for side in (-1, 1):
            for t in sphere(side * p[1], p[0]):
                accept(t, lambda x, side=side: side * x[:, 2] >= p[1])
    else:
        o, d = origins / p[:3], rays / p[:3]
        for t in quadratic((d**2).sum(1), (o * d).sum(1), (o**2).sum(1) - 1):
            accept(t, lambda x: np.ones(len(x), bool))
    return np.min(roots, axis=0)


def random_shapes(rng, count: int) -> shapes.Shapes:
    kinds = rng.choice([shapes.BOX, shapes.CYLINDER, shapes.CAPSULE, shapes.SPHERE, shapes.QUAD], count)
    params = rng.uniform(0.05, 0.6, (count, 4))
    params[:, 3] = rng.integers(0, 2, count)
    params[kinds == shapes.QUAD, 2] = rng.integers(0, 3, (kinds == shapes.QUAD).sum())
    axes = np.array([frame_along(d) for d in rng.normal(size=(count, 3))])
    axes[: count // 4] = np.eye(3)
    return shapes.make_shapes(kinds, params, rng.uniform(-2, 2, (count, 3)), np.transpose(axes, (0, 2, 1)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_kernel_equals_the_plain_loop(seed):
    rng = np.random.default_rng(seed)
    scene = random_shapes(rng, 60)
    origins, rays = rng.uniform(-3, 3, (3000, 3)), unit(rng.normal(size=(3000, 3)))
    rays[:50] = np.eye(3)[rng.integers(0, 3, 50)]  # along the axes: divisions by zero
    t, primitive, normal, _ = scene.trace(origins, rays)
    each = np.stack([
        reference(k, p, (origins - c) @ r.T, rays @ r.T)
        for k, p, c, r in zip(scene.kind, scene.params, scene.centre, scene.rotation)
    ])
    expected = each.min(0)
    hit = np.isfinite(expected)
    assert hit.mean() > 0.2
    assert np.array_equal(hit, np.isfinite(t))
    np.testing.assert_allclose(t[hit], expected[hit], rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(each[primitive[hit], np.flatnonzero(hit)], expected[hit], rtol=1e-7, atol=1e-8)
    assert (primitive[~hit] == -1).all()
    np.testing.assert_allclose(np.linalg.norm(normal[hit], axis=1), 1, atol=1e-9)
    assert (np.einsum("ij,ij->i", normal[hit], rays[hit]) <= 1e-12).all()


def test_rounded_box_is_hit_on_its_surface():
    rng = np.random.default_rng(4)
    half, r = np.array([0.5, 0.3, 0.2]), 0.1
    scene = shapes.make_shapes([shapes.ROUND], [[*half, r]], [[0, 0, 0]], [np.eye(3)])
    origins = unit(rng.normal(size=(2000, 3))) * 2
    aim = unit(rng.uniform(-0.1, 0.1, (2000, 3)) - origins)
    t, _, normal, _ = scene.trace(origins, aim)
    points = origins + t[:, None] * aim
    gap = np.linalg.norm(np.maximum(np.abs(points) - half + r, 0), axis=1) - r
    assert np.abs(gap).max() < 1e-4
    assert (np.einsum("ij,ij->i", normal, points) > 0).all()  # outward, and the box is convex around 0


def test_hits_lie_on_the_first_surface_from_inside_and_outside():
    scene = shapes.make_shapes([shapes.BOX], [[1, 1, 1, 0]], [[0, 0, 0]], [np.eye(3)])
    t, _, normal, uv = scene.trace(np.array([[0, 0.25, -0.5], [3, 0.25, -0.5]]), np.array([[1.0, 0, 0], [-1, 0, 0]]))
    np.testing.assert_allclose(t, [1, 2])
    np.testing.assert_allclose(normal, [[-1, 0, 0], [1, 0, 0]])
    np.testing.assert_allclose(uv, [[0.25, -0.5]] * 2)


# --- the place ------------------------------------------------------------------------------------------------------


def test_truth_depth_equals_noiseless_ranges(place):
    width, height, focal = 64, 48, 50.0
    pose = demo.camera_towards((4.5, 3.0, 1.5), (1.0, 1.0, 1.0))
    rgb, depth = place.render(pose, focal, focal, 32, 24, width, height, samples=1)
    assert rgb.shape == (height, width, 3) and rgb.dtype == np.uint8 and depth.dtype == np.float32
    scan = VirtualScanner(place.trace, IDEAL, place.ranges).scan([pose[:3, 3]], 20000, np.random.default_rng(0))
    local = (scan.xyz - pose[:3, 3]) @ pose[:3, :3]
    z = -local[:, 2]
    with np.errstate(all="ignore"):
        u, v = focal * local[:, 0] / z + 32, -focal * local[:, 1] / z + 24
    seen = (z > 0.1) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
    assert seen.sum() > 800
    # The very ray of each point, asked of the truth renderer through a camera centred on that point.
    picks = np.flatnonzero(seen)[:: seen.sum() // 60]
    for i in picks:
        _, exact = place.render(pose, focal, focal, 0.5 - (u[i] - 32), 0.5 - (v[i] - 24), 1, 1, samples=1)
        np.testing.assert_allclose(exact[0, 0], z[i], rtol=2e-6)
    near = np.abs(depth[v[seen].astype(int), u[seen].astype(int)] - z[seen])
    assert np.median(near) < 0.02


@pytest.mark.slow
def test_a_true_pixel_is_the_mean_of_the_light_of_its_rays(place):
    """As the soft z-buffer averages, and as :mod:`model.synth.outdoors` does."""
    camera = demo.camera_towards((4.5, 3.0, 1.5), (1.0, 1.0, 1.0)), 50.0, 50.0, 32, 24, 64, 48
    rgb, _ = place.render(*camera, samples=2)
    rays = [place.trace(*pixel_rays(*camera, du, dv)[:2]).rgb for du in (0.25, 0.75) for dv in (0.25, 0.75)]
    expected, of_values = (255 * mean.reshape(48, 64, 3) for mean in (to_srgb(to_linear(rays).mean(0)), np.mean(rays, 0)))
    assert np.abs(rgb - expected).max() <= 0.51 < 10 < np.abs(rgb - of_values).max()


@pytest.mark.slow
def test_thin_objects_are_hit(place):
    radius = np.where(np.isin(place.shapes.kind, [shapes.CYLINDER, shapes.CAPSULE]), place.shapes.params[:, 0], 9)
    thin = (radius < 0.007) & ~place.finish.outdoors
    assert thin.sum() > 100
    seen = set()
    for station in demo.STATIONS:
        middles = place.shapes.centre[thin]
        hits = place.trace(np.broadcast_to(station, middles.shape).copy(), unit(middles - station))
        seen |= set(hits.primitive[thin[hits.primitive]])
    assert len(seen) > 0.5 * thin.sum()
    scan = VirtualScanner(place.trace, IDEAL, place.ranges).scan(demo.STATIONS[2:], 60000, np.random.default_rng(1))
    hits = place.trace(np.broadcast_to(demo.STATIONS[2], scan.xyz.shape).copy(), unit(scan.xyz - demo.STATIONS[2]))
    assert thin[hits.primitive].sum() > 150


def test_every_station_and_view_stands_in_the_open(place):
    spots = np.array([*demo.STATIONS, *(position for _, position, _, _ in demo.VIEWS)])
    sphere = unit(np.random.default_rng(0).normal(size=(400, 3)))
    t = place.ranges(np.repeat(spots, 400, 0), np.tile(sphere, (len(spots), 1))).reshape(len(spots), 400)
    assert (t.min(1) > 0.12).all()
    assert (np.median(t, axis=1) > 0.8).all()


def test_colours_do_not_depend_on_the_company_of_a_ray(place):
    rng = np.random.default_rng(3)
    origins = np.broadcast_to(demo.STATIONS[0], (500, 3)).copy()
    rays = unit(rng.normal(size=(500, 3)))
    whole, part = place.trace(origins, rays), place.trace(origins[100:200], rays[100:200])
    assert np.array_equal(whole.rgb[100:200], part.rgb)
    assert whole.rgb.min() >= 0 and whole.rgb.max() <= 1 and np.ptp(whole.rgb) > 0.3


def test_rays_on_several_threads_meet_the_same_to_the_bit(place, monkeypatch):
    """With what last stood before a light looked at first: that depends on the slices, the light does not."""
    rng = np.random.default_rng(4)
    origins = np.broadcast_to(demo.STATIONS[0], (9001, 3)).copy()
    rays = unit(rng.normal(size=(9001, 3)))
    threads = set()

    def traced(count):
        monkeypatch.setattr(processors, "_threads", [count])
        hits = place.trace(origins, rays)
        return [getattr(hits, name) for name in ("t", "rgb", "normal", "primitive")]

    def seen(*arguments):
        threads.add(threading.get_ident())
        return trace_rays(*arguments)

    trace_rays = shapes.trace_rays
    monkeypatch.setattr(shapes, "trace_rays", seen)
    alone = traced(1)
    assert threads == {threading.get_ident()}
    assert all(np.array_equal(a, b) for a, b in zip(alone, traced(3), strict=True)) and len(threads) > 1


def test_what_shades_a_point_does_not_depend_on_the_point_before(place):
    rng = np.random.default_rng(5)
    origins = np.broadcast_to(demo.STATIONS[1], (400, 3)).copy()
    rays = unit(rng.normal(size=(400, 3)))
    together = place.trace(origins, rays).rgb
    each = np.concatenate([place.trace(origins[i : i + 1], rays[i : i + 1]).rgb for i in range(400)])
    assert np.array_equal(together, each)


# --- the scanner ----------------------------------------------------------------------------------------------------


def test_blind_cone_and_field_limits_are_empty(place):
    model = ScannerModel(turn=0, shift=0)
    scan = VirtualScanner(place.trace, model, place.ranges).scan(demo.STATIONS, 8000, np.random.default_rng(5))
    arm = scan.xyz - scan.positions[scan.station]
    elevation = np.degrees(np.arcsin(arm[:, 2] / np.linalg.norm(arm, axis=1)))
    assert elevation.min() > model.lowest and elevation.max() < model.highest
    assert elevation.min() < model.lowest + 3  # and not emptier than claimed


@pytest.mark.parametrize(("distance", "slant"), [(2.0, 0.0), (10.0, 0.0), (4.0, 1.5)])
def test_range_noise_has_the_stated_deviation(distance, slant):
    model = ScannerModel(divergence=0, dropout=0)
    trace = wall(distance, slant)
    scan = VirtualScanner(trace, model).scan([[0, 0, 0]], 60000, np.random.default_rng(6))
    ranges = np.linalg.norm(scan.xyz, axis=1)
    rays = scan.xyz / ranges[:, None]
    true = trace(np.zeros_like(rays), rays)
    cosine = np.abs(np.einsum("ij,ij->i", true.normal, rays))
    scaled = (ranges - true.t) / VirtualScanner(trace, model).range_sigma(true.t, cosine)
    assert len(scaled) > 10000
    assert abs(scaled.mean()) < 0.05 and abs(scaled.std() - 1) < 0.03
    far = VirtualScanner(trace, model).range_sigma(np.array([1.0, 10.0, 10.0]), np.array([1.0, 1.0, 0.2]))
    assert far[0] < far[1] < far[2]


def test_mixed_pixels_lie_between_foreground_and_background():
    near, far = 2.0, 2.5

    def trace(origins, rays):
        """Concentric shells: the nearer one where the azimuth is in a bar, in a comb of bars."""
        bar = np.sin(40 * np.arctan2(rays[:, 1], rays[:, 0])) > 0
        n = len(rays)
        return SimpleNamespace(t=np.where(bar, near, far), rgb=np.where(bar[:, None], 0.2, 0.8) * np.ones((n, 3)),
                               normal=-rays, shininess=np.zeros(n), darkness=np.full(n, 0.3))

    model = ScannerModel(noise=0, noise_per_metre=0, dropout=0, colour_noise=0, white_balance=0)
    scan = VirtualScanner(trace, model).scan([[0, 0, 0]], 100000, np.random.default_rng(7))
    ranges = np.linalg.norm(scan.xyz, axis=1)
    assert 200 < scan.mixed.sum() < 0.1 * len(scan)
    between = ranges[scan.mixed]
    assert between.min() > near and between.max() < far and between.std() > 0.05
    assert np.allclose(np.minimum(np.abs(ranges - near), np.abs(ranges - far))[~scan.mixed], 0, atol=1e-9)
    values = scan.rgb[scan.mixed][:, 0]
    assert values.min() >= 51 and values.max() <= 204
    wide = ScannerModel(mixed_span=0.4)
    assert not VirtualScanner(trace, wide).scan([[0, 0, 0]], 20000, np.random.default_rng(7)).mixed.any()


def test_dark_and_shiny_surfaces_lose_points():
    def kept(darkness, shininess):
        def trace(origins, rays):
            n = len(rays)
            hits = wall(3.0, 0.8)(origins, rays)
            hits.darkness, hits.shininess = np.full(n, darkness), np.full(n, shininess)
            return hits

        return len(VirtualScanner(trace).scan([[0, 0, 0]], 20000, np.random.default_rng(8)))

    assert kept(0.995, 0.0) < 0.9 * kept(0.4, 0.0) and kept(0.4, 0.9) < 0.9 * kept(0.4, 0.0)


def test_station_exposure_scales_linear_light():
    scan = VirtualScanner(wall(), ScannerModel(white_balance=0, colour_noise=0)).scan(
        [[0, 0, 0], [0, 1, 0]], 5000, np.random.default_rng(9), [0.9, 1.1]
    )
    levels = [scan.rgb[scan.station == k].mean() / 255 for k in (0, 1)]
    linear = [((v + 0.055) / 1.055) ** 2.4 for v in levels]
    assert linear[1] / linear[0] == pytest.approx(1.1 / 0.9, rel=0.02)


def test_all_stations_but_the_first_are_registered_a_little_off():
    """Turned about themselves and shifted, and nothing else: lengths stay, and one turn explains every point."""
    position, radius = np.array([100.0, -50.0, 3.0]), 5.0

    def arms(number, **off):
        scanner = VirtualScanner(shell(radius), dataclasses.replace(IDEAL, **off))
        return scanner.station(position, 2000, np.random.default_rng(10), 1.0, number)[0] - position

    true = arms(0, turn=0.5, shift=0.1)
    assert np.allclose(np.linalg.norm(true, axis=1), radius) and np.array_equal(true, arms(1))
    moved = arms(1, shift=0.1) - true
    assert np.allclose(moved, moved[0]) and 0.01 < np.linalg.norm(moved[0]) < 1
    turned = arms(1, turn=0.5) - true
    skew = np.stack([np.cross(axis, true) for axis in np.eye(3)], -1).reshape(-1, 3)
    turn, *_ = np.linalg.lstsq(skew, turned.reshape(-1), rcond=None)
    assert np.allclose(skew @ turn, turned.reshape(-1), atol=1e-9) and 0.05 < np.degrees(np.linalg.norm(turn)) < 3


def test_no_two_stations_sample_the_same_grid():
    scan = VirtualScanner(shell(5.0), IDEAL).scan([[0, 0, 0]] * 6, 3000, np.random.default_rng(11))
    across = [np.sort(scan.xyz[scan.station == k][:, 0]) for k in range(6)]
    assert not any(np.allclose(a, b) for a, b in itertools.combinations(across, 2))


# --- the demo -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_same_seed_same_bytes(tmp_path: Path, place, monkeypatch):
    monkeypatch.setattr(demo, "Place", partial(Place, probe_rays=4))
    for name in ("a", "b"):
        demo.main(tmp_path / f"{name}.laz", 6000, 3)
    assert (tmp_path / "a.laz").read_bytes() == (tmp_path / "b.laz").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.laz", "a_cameras.json", "b.laz", "b_cameras.json"]
    scans = [demo.simulate(3000, seed, place=place) for seed in (1, 2)]
    assert not np.array_equal(scans[0].xyz, scans[1].xyz)
    las = read_las(tmp_path / "a.laz")
    assert 5000 <= len(las.points) <= 6000 and set(np.unique(las.point_source_id)) == {0, 1, 2}
    assert np.all(np.asarray(las.red) % 257 == 0) and np.allclose(las.header.scales, demo.SCALE)
    assert not las.header.offsets.any()
