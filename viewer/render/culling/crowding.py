"""Depth complexity: how many surfaces lie in front of a block of cells, from which its points are thinned.

In a place of many buildings a line of sight crosses hundreds of surfaces, of which the picture shows the first few.  The
picture is divided into tiles.  Blocks are looked at from near to far; each adds the pixels that its surfaces cover to its
tiles; those around the camera, such as the walls of its room, do so cell by cell, and are not thinned.  Where a tile has been
covered ENOUGH times over, what lies behind gets points by the square of the share that is left, so that a frame has at most
about 2 * ENOUGH times the points of one surface, however large the place is; and these come from fewer cells (FEW_HIDDEN of
viewer.render.culling.cull_kernels), since a cell costs as much as forty points.  Frame: as there.

It is a statistic: what is seen through a gap narrower than a tile between covered ones has fewer points than are wanted, never
none.  Nothing is thinned without a level of detail.
"""

import numpy as np

from ....model.common.jit import compiled
from ...grid.projected_coverage import SQUARES, UNKNOWN
from .culled_grid import block_middle, cell_middle, frustum_of, turned

ENOUGH = 4.0
"""Times that a tile is covered before what lies behind is thinned.  Of 600 files of a campus, 640x480, one point a pixel, the
picture from within a room is the same with 8, 4 and 3; from outside the walls it differs by 47, 40 and 38 dB from that without
thinning (which differs by 38 dB from that of all points) and has 10, 23 and 29 % fewer points.  Of 1,000, with what is around
the camera counted and 4 or 3: from within a room 55 dB or more, 52; from outside 51 and 49; from above 45 and 42."""
TILE = 16
"""Pixels of a tile's side."""
SPARSE = 4.0
"""Squares of a face that a cell with too few points to tell counts as."""
_BINS = 512
"""Depths that are told apart; eight for each factor of two."""
_OCTAVE = 8.0


@compiled(nogil=True)
def faces_of_blocks(faces, per, found):
    """found: (B, 3) float64, receives the sums of faces (C, 3) uint8 over each ``per`` consecutive cells, in cell faces."""
    found[:] = 0.0
    for cell in range(faces.shape[0]):
        for axis in range(3):
            face = np.float64(faces[cell, axis]) if faces[cell, 0] != UNKNOWN else SPARSE
            found[cell // per, axis] += face / SQUARES


def scratch_of(blocks: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arrays that :func:`crowded` writes into, kept from frame to frame: depth of each block (B,) and their order (B,) int64,
    how many have each depth, and where each lies in the picture (B, 5) float64."""
    return np.empty(blocks, np.int64), np.empty(blocks, np.int64), np.empty(_BINS + 1, np.int64), np.empty((blocks, 5))


@compiled(inline="always")
def tiles_of(u, v, half_u, half_v, wide, tall):
    """First and last tile that a rectangle touches, column then row, before they are cut to the picture."""
    return (
        int(np.floor((u - half_u) / wide)), int(np.floor((u + half_u) / wide)),
        int(np.floor((v - half_v) / tall)), int(np.floor((v + half_v) / tall)),
    )  # fmt: skip


@compiled(nogil=True)
def cover_by_cells(grid, frustum, block, tiles):
    """Adds to tiles the pixels that the cells of a block cover.  Others as in :func:`crowded`."""
    fx, fy, left, right, top, bottom = frustum.fx, frustum.fy, frustum.left, frustum.right, frustum.top, frustum.bottom
    coords, coverage, size, (rows, columns) = grid.coords, grid.faces, grid.size, tiles.shape
    wide, tall, reach = (left + right) / columns, (top + bottom) / rows, 0.5 * np.sqrt(3.0) * size
    for cell in range(block * grid.per, min((block + 1) * grid.per, coords.shape[0])):
        px, py, pz = cell_middle(coords, cell, size, frustum.shift)
        x, y, z = turned(frustum.rotation, (px, py, pz))
        if z < 2.0 * reach or coverage[cell, 0] == UNKNOWN:
            continue
        x0, x1, y0, y1 = tiles_of(fx * x / z + left, fy * y / z + top, fx * reach / z, fy * reach / z, wide, tall)
        seen = coverage[cell, 0] * abs(px) + coverage[cell, 1] * abs(py) + coverage[cell, 2] * abs(pz)
        more = size * fx / z * (size * fy / z) * seen / (SQUARES * z * ((x1 - x0 + 1) * (y1 - y0 + 1) * wide * tall))
        for row in range(max(y0, 0), min(y1, rows - 1) + 1):
            for column in range(max(x0, 0), min(x1, columns - 1) + 1):
                tiles[row, column] += more


@compiled(nogil=True)
def _place_blocks(grid, frustum, faces, tiles, scratch, share):
    """Where each block lies in the picture, and how many have each depth; adds those around the camera to tiles, cell by
    cell.  As in :func:`crowded`."""
    key, _, count, place = scratch
    fx, fy, left, right, top, bottom = frustum.fx, frustum.fy, frustum.left, frustum.right, frustum.top, frustum.bottom
    blocks, size, (rows, columns) = grid.blocks, grid.size, tiles.shape
    wide, tall = (left + right) / columns, (top + bottom) / rows
    count[:] = 0
    for block in range(blocks.shape[0]):
        share[block], key[block] = 1.0, -1
        px, py, pz = block_middle(blocks, block, size, frustum.shift)
        x, y, z = turned(frustum.rotation, (px, py, pz))
        reach = size * np.sqrt(blocks[block, 3] ** 2 + blocks[block, 4] ** 2 + blocks[block, 5] ** 2)
        if z < 2.0 * reach:  # around the camera, or behind it: too near to be one depth, and in front of all that is not
            if z > -reach:
                cover_by_cells(grid, frustum, block, tiles)
            continue
        u, v, half_u, half_v = fx * x / z + left, fy * y / z + top, fx * reach / z, fy * reach / z
        if u + half_u < 0 or v + half_v < 0 or u - half_u > left + right or v - half_v > top + bottom:
            continue
        seen = faces[block, 0] * abs(px) + faces[block, 1] * abs(py) + faces[block, 2] * abs(pz)
        place[block, 0], place[block, 1], place[block, 2], place[block, 3] = u, v, half_u, half_v
        x0, x1, y0, y1 = tiles_of(u, v, half_u, half_v, wide, tall)
        touched = (x1 - x0 + 1) * (y1 - y0 + 1)
        place[block, 4] = size * fx / z * (size * fy / z) * seen / z / (touched * wide * tall)  # share of each tile
        key[block] = min(max(int(_OCTAVE * np.log2(z / size)) + _BINS // 2, 0), _BINS - 1)
        count[key[block] + 1] += 1


@compiled(nogil=True)
def _sort_by_depth(key, order, count):
    """A counting sort of the blocks that have a depth.  Returns how many they are."""
    for number in range(_BINS):
        count[number + 1] += count[number]
    total = count[_BINS]
    for block in range(key.shape[0]):
        if key[block] >= 0:
            order[count[key[block]]] = block
            count[key[block]] += 1
    return total


@compiled(nogil=True)
def crowded(grid, camera, faces, tiles, scratch, share):
    """Writes share (B,) float64, which share of the points wanted of a block is drawn: 1 where few surfaces are in front.

    grid, camera: as in visible_cells; of a pinhole camera, and a scene with faces.  faces: of faces_of_blocks.
    tiles: (Y, X) float64, receives how often each is covered.  scratch: of :func:`scratch_of`.
    """
    frustum = frustum_of(camera)
    key, order, count, place = scratch
    rows, columns = tiles.shape
    wide, tall = (frustum.left + frustum.right) / columns, (frustum.top + frustum.bottom) / rows
    tiles[:] = 0.0
    _place_blocks(grid, frustum, faces, tiles, scratch, share)
    for number in range(_sort_by_depth(key, order, count)):
        block = order[number]
        u, v, half_u, half_v = place[block, 0], place[block, 1], place[block, 2], place[block, 3]
        x0, x1, y0, y1 = tiles_of(u, v, half_u, half_v, wide, tall)
        least, more = np.inf, place[block, 4]
        for row in range(max(y0, 0), min(y1, rows - 1) + 1):
            for column in range(max(x0, 0), min(x1, columns - 1) + 1):
                least = min(least, tiles[row, column])
                tiles[row, column] += more
        if ENOUGH < least < np.inf:
            share[block] = (ENOUGH / least) ** 2
