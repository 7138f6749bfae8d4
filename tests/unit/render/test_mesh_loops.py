"""The compiled loops of meshes against a plain reference, on random triangles, cameras and clips."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pointglass.viewer.common.rigid_transform import rigid, rotation_about
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import Box, Slab
from pointglass.viewer.picture.meshes.clip_rows import clip_rows
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.readers.meshes.mesh_data import mesh_data
from pointglass.viewer.readers.meshes.ray_loops import ray_hit
from pointglass.viewer.render.meshes.mesh_layers import composed, draw_meshes

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from plain_mesh_picture import colours, nearest

FAR = np.array([500_000.0, 5_400_000.0, 300.0])  # as in UTM


def soup(random, count=40):
    """Random triangles around the origin, some of them behind or through the camera's plane."""
    corners = random.normal(0, 2.5, (count, 1, 3)) + random.normal(0, 1.2, (count, 3, 3))
    return mesh_data(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3),
                     random.integers(0, 256, (3 * count, 3)).astype(np.uint8))


@pytest.mark.parametrize("orthographic", [None, 4.0])
def test_each_pixel_shows_the_nearest_triangle_that_its_ray_meets(seed, orthographic):
    random = np.random.default_rng(seed)
    mesh = soup(random)
    place = rigid(rotation_about(random.normal(size=3), 50.0), FAR)
    layer = MeshLayer("m", transform=place, up="y", scale=1.3)
    eye = FAR + random.normal(0, 1, 3)
    pose = look_at(eye, eye + random.normal(size=3))
    camera = from_fov(40, 30, 70, pose)
    if orthographic:
        camera = type(camera)(40, 30, camera.fx, camera.fy, 20, 15, pose, orthographic=orthographic)
    clips = (Box(tuple(FAR), (2.5, 2.5, 2.5)), Slab(tuple(FAR), (0.0, 0.6, 0.8), 0.7, removes=True)) if seed % 2 else ()
    made = draw_meshes(camera, (layer,), clips, lambda path: mesh)
    depth, number, weights = nearest(camera, layer, mesh, clips)
    found = np.isfinite(made.opaque_depth)
    # on an edge, or where two triangles meet, either may be chosen
    same = found == np.isfinite(depth)
    assert (~same).sum() <= 3  # the camera may look past the mesh
    both = found & np.isfinite(depth)
    close = same.copy()
    close[both] = np.abs(made.opaque_depth[both] - depth[both]) <= 1e-5 * depth[both]
    assert (~close).sum() <= 3
    words = made.opaque.view(np.uint8).reshape(30, 40, 4)
    expected = colours(camera, layer, mesh, number, weights)
    off = np.abs(words[..., :3] - expected).max(axis=2)
    assert (off[close & found] > 0.51 + 1e-4).sum() <= 3 and (words[..., 3] == 255 * found).all()


def test_a_surface_of_many_triangles_has_no_gaps(seed):
    random = np.random.default_rng(seed)
    side = 30
    x, y = np.meshgrid(np.linspace(-50, 50, side), np.linspace(-50, 50, side))
    corners = np.stack([x, y, random.uniform(-0.5, 0.5, x.shape)], axis=2).reshape(-1, 3) + FAR
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.stack([first, first + 1, first + side], 1),
                            np.stack([first + side + 1, first + side, first + 1], 1)])
    mesh = mesh_data(corners, faces)
    pose = look_at(FAR + [0, 0, 6], FAR + [*random.uniform(-3, 3, 2), 0])
    made = draw_meshes(from_fov(301, 201, 80, pose), (MeshLayer("m"),), (), lambda path: mesh)
    assert np.isfinite(made.opaque_depth).all()


def test_a_ray_meets_the_triangle_that_the_picture_shows(seed):
    random = np.random.default_rng(seed)
    mesh, layer = soup(random), MeshLayer("m")
    eye = random.normal(0, 1, 3)
    camera = from_fov(48, 36, 60, look_at(eye, eye + random.normal(size=3)))
    depth, _, _ = nearest(camera, layer, mesh)
    none = clip_rows((), np.eye(3), np.zeros(3))
    wrong = 0
    for row, column in random.integers(0, 36, (200, 2)):
        begin, way = camera.ray((column + 0.5, row + 0.5))
        face, along = ray_hit(mesh.vertices, mesh.faces, begin, way, *none)
        z = along * (way @ camera.forward) if face >= 0 else np.inf
        wrong += not (z == depth[row, column] or abs(z - depth[row, column]) < 1e-9 * z)
    assert wrong == 0


def test_what_is_nearer_covers_what_is_farther_by_its_opacity():
    camera = from_fov(8, 8, 60, look_at((0, 0, 0), (0, 1, 0)))
    def wall(y):
        return mesh_data(np.array([(-9, y, -9), (9, y, -9), (9, y, 9), (-9, y, 9)], float), np.array([(0, 1, 2), (0, 2, 3)]))
    walls = {"near": wall(2.0), "far": wall(4.0)}
    picture = np.full((8, 8, 4), (0, 100, 0, 255), np.uint8)
    def seen(depth, **opacity):
        layers = tuple(MeshLayer(name, colour=(255, 0, 0) if name == "near" else (0, 0, 255), opacity=share)
                       for name, share in opacity.items())
        made = draw_meshes(camera, layers, (), walls.get)
        return composed(picture, np.full((8, 8), depth, np.float32), made)[4, 4].astype(int)
    assert seen(1.0, near=1.0, far=1.0).tolist() == [0, 100, 0, 255]  # points before both
    assert seen(3.0, far=1.0).tolist() == [0, 100, 0, 255]
    red = seen(3.0, near=1.0, far=1.0)
    assert red[0] > 150 and red[1] == red[2] == 0
    half = seen(3.0, near=0.5)  # through glass the points
    assert abs(half[0] - red[0] / 2) <= 1 and abs(half[1] - 50) <= 1
    blue = seen(0.0, near=0.5, far=1.0)  # no depth: behind everything
    assert blue[1] == 0 and blue[0] > 80 and blue[2] > 80
    between = seen(3.0, far=0.5, near=1.0)
    assert between.tolist() == red.tolist()
