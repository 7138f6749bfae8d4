"""Compiled loop that colours the pixels of a mesh: the file's colour or picture at the place, shaded by one lamp.

The lamp stands at the camera, a little above and to its left, so that walls at a right angle differ.  Normals are two-sided.
"""

import numpy as np

from ....model.common.jit import compiled
from .mesh_loops import edge_functions

LAMP = (-0.30, -0.45, -0.84113)
"""Towards the lamp, view frame (x right, y down, z forward), unit length: chosen by eye on a box, a pipe and a terrain."""
AMBIENT = 0.35
"""Share of a colour where no light falls."""


@compiled(nogil=True)
def _texel(texels, offset, width, height, u, v, out):
    """The colour of a picture at (u, v), v upwards, repeated beyond its edges, interpolated between four pixels."""
    x, y = u * width - 0.5, (1.0 - v) * height - 0.5
    column, row = int(np.floor(x)), int(np.floor(y))
    right, down = x - column, y - row
    for channel in range(3):
        out[channel] = 0.0
    for corner in range(4):
        across, along = corner & 1, corner >> 1
        share = (right if across else 1.0 - right) * (down if along else 1.0 - down)
        at = offset + ((row + along) % height) * width + (column + across) % width
        for channel in range(3):
            out[channel] += share * texels[at, channel]


@compiled(nogil=True)
def shade_rows(view, faces, to_view, normals, rgb, of_face, uv, texels, levels, lens, chosen, alpha, number, colour, start,
               stop):
    """Colours of rows of the picture where ``number`` (H, W) names a triangle.

    to_view: (3, 3) float64, rotation from the mesh's file to the view frame, with a mirror image where it has one.  normals,
    rgb, of_face, uv, texels, levels: of viewer.readers.meshes.mesh_data.  chosen: (3,) int64 sRGB in place of the file's,
    negative: the file's.  alpha: 1 to 255.  colour: (H, W) uint32 RGBA8, premultiplied, written.
    """
    edges, parallel, own = np.empty((3, 3)), lens[4] > 0.0, chosen[0] < 0
    weight, found, base = np.empty(3), np.empty(3), np.empty(3)
    factor = lens[4] if parallel else 1.0
    for row in range(start, stop):
        y = (row + 0.5 - lens[3]) * factor / lens[1]
        for column in range(number.shape[1]):
            face = number[row, column]
            if face < 0:
                continue
            x = (column + 0.5 - lens[2]) * factor / lens[0]
            edge_functions(view, faces[face], parallel, edges)
            whole = 0.0
            for corner in range(3):
                weight[corner] = max(edges[corner, 0] * x + edges[corner, 1] * y + edges[corner, 2], 0.0)
                whole += weight[corner]
            for corner in range(3):
                weight[corner] /= whole
            if not own:
                for channel in range(3):
                    base[channel] = chosen[channel]
            elif len(of_face) > 0 and of_face[face] >= 0:
                _picture_colour(faces[face], edges, weight, x, y, factor / lens[0], factor / lens[1], uv, texels,
                                levels[of_face[face]], base)
            else:
                for channel in range(3):
                    base[channel] = 0.0
                    for corner in range(3):
                        base[channel] += weight[corner] * rgb[faces[face, corner], channel]
            light = _light(view, faces[face], to_view, normals[face], weight, x, y, parallel, found)
            word = np.uint32(alpha) << np.uint32(24)
            for channel in range(3):
                value = np.uint32(min(base[channel] * light + 0.5, 255.0))
                word |= (value * np.uint32(alpha) + np.uint32(127)) // np.uint32(255) << np.uint32(8 * channel)
            colour[row, column] = word


@compiled(nogil=True)
def _light(view, face, to_view, normals, weight, x, y, parallel, found):
    """The share of a colour that is seen at a place of a triangle."""
    a, b, c = view[face[0]], view[face[1]], view[face[2]]
    ux, uy, uz, vx, vy, vz = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    away = nz if parallel else nx * x + ny * y + nz
    found[0], found[1], found[2] = 0.0, 0.0, 0.0
    for corner in range(3):
        normal = normals[corner]
        mx = to_view[0, 0] * normal[0] + to_view[0, 1] * normal[1] + to_view[0, 2] * normal[2]
        my = to_view[1, 0] * normal[0] + to_view[1, 1] * normal[1] + to_view[1, 2] * normal[2]
        mz = to_view[2, 0] * normal[0] + to_view[2, 1] * normal[1] + to_view[2, 2] * normal[2]
        found[0] += weight[corner] * mx
        found[1] += weight[corner] * my
        found[2] += weight[corner] * mz
    length = np.sqrt(found[0] * found[0] + found[1] * found[1] + found[2] * found[2])
    falls = (found[0] * LAMP[0] + found[1] * LAMP[1] + found[2] * LAMP[2]) / max(length, 1e-300)
    return AMBIENT + (1.0 - AMBIENT) * max(-falls if away > 0.0 else falls, 0.0)


@compiled(nogil=True)
def _picture_colour(face, edges, weight, x, y, right, down, uv, texels, levels, out):
    """The colour of a triangle's picture, from the level whose pixels are about as far apart as those of the picture drawn."""
    u, v, longest = 0.0, 0.0, 0.0
    for corner in range(3):
        u += weight[corner] * uv[face[corner], 0]
        v += weight[corner] * uv[face[corner], 1]
    for way in range(2):
        px, py, whole, nu, nv = x + (right if way == 0 else 0.0), y + (down if way == 1 else 0.0), 0.0, 0.0, 0.0
        for corner in range(3):
            share = edges[corner, 0] * px + edges[corner, 1] * py + edges[corner, 2]
            whole += share
            nu += share * uv[face[corner], 0]
            nv += share * uv[face[corner], 1]
        if whole > 0.0:
            longest = max(longest, np.hypot((nu / whole - u) * levels[0, 1], (nv / whole - v) * levels[0, 2]))
    level = min(max(int(np.floor(np.log2(max(longest, 1.0)) + 0.5)), 0), len(levels) - 1)
    _texel(texels, levels[level, 0], levels[level, 1], levels[level, 2], u, v, out)
