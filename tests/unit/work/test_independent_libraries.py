"""Computations of a working day against libraries that share no code with them, besides their references and known truths.

===================  ===============================================================  =======================================
what                 reference, or truth                                              independent library
===================  ===============================================================  =======================================
fits                 finite differences, repeated fits, synthetic pipes (test_fits,   scipy.optimize (here)
                     test_fit_parts)
pieces of a fit      plain flood fill, plain masks (test_fit_parts)                   scipy.spatial trees
values, areas        plain geometry, repeated measuring (test_measure, test_planes)   Qhull (here)
volumes              heaps, pits and steps of known volume (test_volume)              Qhull's triangles (here)
profiles             known ground (test_profile)                                      Matplotlib's triangles (here)
c2c, m3c2            plain_distances: SciPy's trees, one place at a time              py4dgeo (test_compare, where installed)
distances of meshes  distance field of a box (test_compare_model)                     trimesh (here)
pairs of points      Horn's quaternions (test_registration)                           trimesh (here)
ICP                  stations moved by known motions (test_registration)              Open3D does the coarse steps
selections           plain tests of each point (test_select_points)                   Matplotlib's paths, scipy.ndimage
===================  ===============================================================  =======================================
"""

import numpy as np
import pytest
import trimesh
from matplotlib.tri import LinearTriInterpolator, Triangulation
from scipy.optimize import least_squares
from scipy.spatial import ConvexHull, Delaunay
from test_fit_parts import half_pipe, random_surface

from pointglass.viewer.picture.clip import vector
from pointglass.viewer.work.comparing.model_distances import distances_from_model
from pointglass.viewer.work.fits.least_squares import TUKEY, fitted
from pointglass.viewer.work.fits.measured import in_cloud
from pointglass.viewer.work.fits.surfaces import Circle, Cylinder, Plane, frame_of
from pointglass.viewer.work.measuring.height_grid import MOST, measured_volume
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.measuring.profile import measured_profile
from pointglass.viewer.work.measuring.values import evaluate
from pointglass.viewer.work.registration.point_pairs import fit_pairs

UP = np.array([0.0, 0.0, 1.0])


def tukey(squares):
    """Tukey's loss of z = (distance / (sigma TUKEY))^2 and its two derivatives, as scipy.optimize takes it."""
    inside = np.minimum(squares, 1.0)
    return np.array([(1 - (1 - inside) ** 3) / 3, (1 - inside) ** 2, -2 * (1 - inside)])


@pytest.mark.parametrize("kind", [Plane, Cylinder, Circle])
def test_a_fit_is_the_minimum_that_scipy_finds(kind, seed):
    random = np.random.default_rng(seed)
    truth = random_surface(random, kind)
    if kind is Plane:
        points = truth.place + random.uniform(-1, 1, (600, 2)) @ frame_of(truth.direction)[:2]
        normals = np.broadcast_to(truth.direction, points.shape)
    else:
        points, normals = half_pipe(random, truth, 600, 1.0)
    points = points + random.normal(0, 0.003, (600, 1)) * normals
    points[:30] += random.uniform(0.02, 0.05, (30, 1)) * normals[:30]  # something that lies before it
    found = fitted(truth, points, 1e-9)
    scale = found.sigma * TUKEY

    def away(change):
        return found.surface.changed(change).distances(points)

    theirs = least_squares(away, np.full(len(kind.parameters), 1e-4), loss=tukey, f_scale=scale, xtol=1e-15, ftol=1e-15,
                           gtol=1e-15)  # fmt: skip
    # ours stops where a step moves nothing by more than a thousandth of the scatter
    assert np.abs(away(theirs.x) - away(np.zeros(len(theirs.x)))).max() < 0.005 * found.sigma


def test_areas_and_lengths_are_those_of_convex_hulls(seed):
    random = np.random.default_rng(seed)
    flat = random.normal(size=(30, 2))
    hull = ConvexHull(flat)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    ring = flat[hull.vertices] @ axes[:2] + random.uniform(-1e5, 1e5, 3)

    def value(kind: str, places) -> float:
        return evaluate(Measurement(kind, tuple(MeasuredPoint(vector(place)) for place in places), kind)).value

    assert value("area", ring) == pytest.approx(hull.volume, rel=1e-6)
    assert value("polyline", [*ring, ring[0]]) == pytest.approx(hull.area, rel=1e-6)


def test_a_volume_is_that_of_the_triangles_between_its_points(seed):
    random = np.random.default_rng(seed)
    flat = random.uniform(-1.2, 1.2, (15_000, 2))
    height = 0.4 + 0.2 * np.sin(2 * flat[:, 0]) * np.cos(3 * flat[:, 1])
    corners = np.array([(-1.0, -1.0, 0), (1.0, -1.0, 0), (1.0, 1.0, 0), (-1.0, 1.0, 0)])
    xyz = np.c_[flat, height]
    found = measured_volume(in_cloud(xyz, np.zeros(3), MOST), corners, np.zeros(4), 0.02, UP, "level")
    inside = (np.abs(flat) < 1).all(axis=1)
    edge = np.linspace(-1, 1, 200)
    rims = [np.c_[edge, np.full(200, side)] for side in (-1, 1)]
    rim = np.concatenate([*rims, *(each[1:-1, ::-1] for each in rims)])
    places = np.concatenate([flat[inside], rim])
    heights = np.concatenate([height[inside], LinearTriInterpolator(Triangulation(*flat.T), height)(*rim.T)])
    faces = Delaunay(places).simplices
    a, b, c = places[faces.T]
    areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    theirs = float((areas * heights[faces].mean(axis=1)).sum())
    assert areas.sum() == pytest.approx(4.0, rel=1e-9)
    assert abs(found.net - theirs) <= found.uncertainty < 0.03 * theirs


def test_a_profile_is_the_ground_between_its_points(seed):
    random = np.random.default_rng(seed)
    flat = random.uniform(-3, 3, (30_000, 2))
    height = 0.3 * np.sin(1.5 * flat[:, 0]) + 0.1 * flat[:, 1]
    triangles = LinearTriInterpolator(Triangulation(*flat.T), height)

    def between(places) -> np.ndarray:
        return np.asarray(triangles(*places.T))

    ends = np.array([(-2.0, -0.7), (2.0, 1.1)])
    ends = np.c_[ends, between(ends)]
    found = measured_profile(in_cloud(np.c_[flat, height], ends[0], MOST), ends - ends[0], 0.02, UP)
    share = np.array(found.stations)[:, None] / np.linalg.norm(np.diff(ends[:, :2], axis=0))
    theirs = between(ends[0, :2] + share * (ends[1, :2] - ends[0, :2])) - ends[0, 2]
    off = np.abs(np.array(found.heights) - theirs)  # ours are means of the points in a step, which do not lie in its middle
    assert off.max() < 0.05 and np.median(off) < 0.005 and len(theirs) > 60


def test_distances_from_a_mesh_are_those_of_trimesh(seed):
    random = np.random.default_rng(seed)
    mesh = trimesh.creation.icosphere(2)
    vertices = mesh.vertices * random.uniform(0.8, 1.2, (len(mesh.vertices), 1))  # hills and hollows, seen from the middle
    xyz = random.normal(size=(80, 3))
    xyz *= (random.uniform(0.5, 1.6, 80) / np.linalg.norm(xyz, axis=1))[:, None]
    found = distances_from_model(vertices, np.asarray(mesh.faces), xyz).distance
    triangles = vertices[mesh.faces]
    for place, distance in zip(xyz, found, strict=True):
        nearest = trimesh.triangles.closest_point(triangles, np.broadcast_to(place, (len(triangles), 3)))
        assert abs(distance) == pytest.approx(np.linalg.norm(nearest - place, axis=1).min(), abs=1e-6)
    radius = np.linalg.norm(xyz, axis=1)
    assert (found[radius > 1.2] > 0).all() and (found[radius < 0.7] < 0).all()  # also beside sharp edges


def test_pairs_give_the_motion_of_trimesh(seed):
    random = np.random.default_rng(seed)
    moving = random.uniform(-5, 5, (6, 3))
    turn = trimesh.transformations.random_rotation_matrix(random.random(3))
    fixed = trimesh.transform_points(moving, turn) + random.uniform(-50, 50, 3) + random.normal(0, 0.01, (6, 3))
    theirs, _, cost = trimesh.registration.procrustes(moving, fixed, reflection=False, scale=False)
    found = fit_pairs(moving, fixed)
    np.testing.assert_allclose(np.array(found.transform), theirs, atol=1e-9)
    assert found.rms == pytest.approx(np.sqrt(cost), rel=1e-6)
