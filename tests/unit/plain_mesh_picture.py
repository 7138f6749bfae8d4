"""Plain reference of viewer.render.meshes: every pixel's ray against every triangle, in NumPy."""

import numpy as np

from pointglass.viewer.picture.clip import contains
from pointglass.viewer.render.meshes.shade_loops import AMBIENT, LAMP


def nearest(camera, layer, mesh, clips=()):
    """(H, W) depth, +inf where no triangle is, (H, W) number of the triangle, -1, and (H, W, 3) weights of its corners; in the
    document's frame, by Moeller and Trumbore."""
    corners = (mesh.vertices @ layer.matrix[:3, :3].T + layer.matrix[:3, 3])[mesh.faces]
    depth = np.full((camera.height, camera.width), np.inf)
    number, weights = np.full(depth.shape, -1), np.zeros((*depth.shape, 3))
    for row in range(camera.height):
        for column in range(camera.width):
            origin, way = camera.ray((column + 0.5, row + 0.5))
            a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
            across, from_a = np.cross(way, v), origin - a
            with np.errstate(divide="ignore", invalid="ignore"):
                volume = (u * across).sum(1)
                second = (from_a * across).sum(1) / volume
                other = np.cross(from_a, u)
                third = (other @ way) / volume
                along = (v * other).sum(1) / volume
            hit = (second >= 0) & (third >= 0) & (second + third <= 1) & (along > 0)
            places = origin + np.where(np.isfinite(along), along, 0)[:, None] * way
            hit &= contains(clips, places)
            z = np.where(hit, (places - camera.position) @ camera.forward, np.inf)
            z[z <= 0] = np.inf
            if np.isfinite(z.min(initial=np.inf)):
                face = int(z.argmin())
                depth[row, column], number[row, column] = z[face], face
                weights[row, column] = 1 - second[face] - third[face], second[face], third[face]
    return depth, number, weights


def colours(camera, layer, mesh, number, weights):
    """(H, W, 3) float sRGB of the pixels of ``nearest``, of a mesh without pictures."""
    turned = layer.matrix[:3, :3] / layer.scale
    corners = (mesh.vertices @ layer.matrix[:3, :3].T + layer.matrix[:3, 3])[mesh.faces]
    lamp = np.array(LAMP) @ camera.view_rotation
    made = np.zeros((*number.shape, 3))
    for row, column in np.argwhere(number >= 0):
        face, share = number[row, column], weights[row, column]
        own = np.cross(corners[face, 1] - corners[face, 0], corners[face, 2] - corners[face, 0])
        normal = share @ (mesh.normals[face] @ turned.T)
        way = camera.ray((column + 0.5, row + 0.5))[1]
        falls = normal @ lamp / np.linalg.norm(normal) * (-1 if own @ way > 0 else 1)
        base = mesh.rgb[mesh.faces[face]].astype(float) if layer.colour is None else np.tile(layer.colour, (3, 1))
        made[row, column] = share @ base * (AMBIENT + (1 - AMBIENT) * max(falls, 0.0))
    return made
