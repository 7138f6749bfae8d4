"""The virtual scanner over a triangle mesh: the hierarchy against brute force, and a scan that lies on the mesh."""

import numpy as np
import pytest

from model.synth.mesh import Mesh
from model.synth.scanner import IDEAL, VirtualScanner


def _soup(seed, count=300):
    rng = np.random.default_rng(seed)
    vertices = (rng.uniform(-3, 3, (count, 1, 3)) + rng.normal(0, 0.4, (count, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(3 * count).reshape(-1, 3), rng.integers(0, 256, (3 * count, 3)).astype(np.uint8)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_hits_are_those_of_brute_force(seed, scale):
    vertices, triangles, colours = _soup(seed)
    rng = np.random.default_rng(seed + 100)
    rays = rng.normal(size=(400, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    rays[:3] = np.eye(3)  # along the axes: a division by zero for every box
    origins = rng.uniform(-4, 4, (400, 3)) * scale
    seen = Mesh(vertices * scale, triangles, colours).trace(origins, rays)
    a, u, v = (vertices[triangles[:, k]] * scale for k in range(3))
    u, v = u - a, v - a
    best = np.full(400, np.inf)
    for j in range(400):
        matrix = np.stack([u, v, np.broadcast_to(-rays[j], u.shape)], 2)
        p, q, t = np.linalg.solve(matrix, (origins[j] - a)[..., None])[..., 0].T
        good = (p >= 0) & (q >= 0) & (p + q <= 1) & (t > 1e-9)
        best[j] = t[good].min(initial=np.inf)
    assert np.isfinite(best).sum() > 50
    assert np.array_equal(np.isfinite(best), np.isfinite(seen.t))
    assert np.allclose(best[np.isfinite(best)], seen.t[np.isfinite(best)], rtol=1e-9)
    assert (np.einsum("ij,ij->i", seen.normal, rays) <= 0).all()


def test_a_scan_of_a_mesh_lies_on_it_with_its_colours():
    """A room of twelve triangles, its colour running with height."""
    corners = np.array([[x, y, z] for x in (-2.0, 2.0) for y in (-3.0, 3.0) for z in (0.0, 2.5)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    colours = np.repeat((50 + 80 * corners[:, 2:]).astype(np.uint8), 3, axis=1)
    mesh = Mesh(corners, triangles, colours)
    scan = VirtualScanner(mesh.trace, IDEAL, mesh.ranges).scan([[0.3, -0.5, 1.4]], 20_000, np.random.default_rng(0))
    off = np.abs(np.abs(scan.xyz - (0, 0, 1.25)) / (2, 3, 1.25) - 1).min(1)
    assert len(scan) > 19_000 and off.max() < 1e-9
    assert np.abs(scan.rgb - (50 + 80 * scan.xyz[:, 2:])).max() <= 1


@pytest.mark.parametrize("broken, said", [
    ({"vertices": np.zeros((3, 2))}, "vertices"), ({"triangles": np.array([[0, 1, 9]])}, "there are 3"),
    ({"triangles": np.zeros((0, 3), int)}, "T > 0"), ({"colours": np.zeros((2, 3))}, "one for each"),
])
def test_what_does_not_fit_is_named(broken, said):
    good = {"vertices": np.eye(3), "triangles": np.array([[0, 1, 2]]), "colours": np.zeros((3, 3))}
    with pytest.raises(ValueError, match=said):
        Mesh(**{**good, **broken})
