"""Compiled loops of culling: blocks, then cells.  Serial, without the interpreter's lock, as in
viewer.grid.building.kernels.

They write into arrays of the caller, allocate nothing, and keep the order of every sum, so that NumPy with the same expressions
gives the same bits.
"""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled
from ...grid.cell_boxes import SHARE_BITS, SHARES, WHOLE
from ...grid.projected_coverage import SQUARES, UNKNOWN
from .culled_grid import block_middle, cell_middle, frustum_of, turned

SLACK = 1e-8
"""Relative margin of a block's extent in its frustum test, so that no cell is lost with its block: larger than WIDER's 1e-9."""
ROUNDING = 1e-12
"""Relative margin of coordinates: above the float64 rounding between a block's test and those of its cells (2.2e-16 each)."""
WIDER = 1 + 1e-9
"""Factor of a cell's box in its frustum test: above the float64 rounding of the test."""

FEW = 2.0
"""Points wanted of a cell below which cells stand for each other: a share of them is drawn, each with FEW points.  600 files of
a campus seen from above at one point a pixel: the picture differs by 46, 45 and 41 dB with 1, 2 and 4 from that with all cells
(without it 34 dB from that of all points), and has 12, 20 and 33 % fewer cells."""
FEW_HIDDEN = 64.0
"""The same, at most, of what is thinned because it is hidden (viewer.render.culling.crowding): by the share that is left."""
STEPS = 1 << 16
"""Shares of cells that can be told apart."""
NEAREST = 1e-9
"""In cells: the least depth that a cell's nearest corner is given, so that points wanted stay finite around the camera."""
OUTSIDE, PARTLY, INSIDE = 0, 1, 2
"""Where a block lies: with all of its cells beyond a side of the frustum; unknown; or with all of them within."""


class FoundCells(NamedTuple):
    """Cells in view, as many rows as there are cells: rows (C,) int32 of the scene's cells.  cell_view: (C, 4) float32 as in
    DrawList.  wanted: (C,) float64 points of the cell."""

    rows: np.ndarray
    cell_view: np.ndarray
    wanted: np.ndarray


@compiled(inline="always")
def code_of_box(x0, y0, z0, x1, y1, z1):
    """The w of DrawList.cell_view: an integer below 2**24, which float32 stores exactly."""
    low = x0 | y0 << SHARE_BITS | z0 << 2 * SHARE_BITS
    return low | (x1 | y1 << SHARE_BITS | z1 << 2 * SHARE_BITS) << 3 * SHARE_BITS


WHOLE_CODE = code_of_box(*(int(side) for side in WHOLE))


@compiled(inline="always")
def place_in_turn(row):
    """The place of a cell among STEPS, by its row with the bits reversed: the cells that come first are spread evenly (van der
    Corput's sequence) over successive rows, which lie side by side."""
    turned = (row & 0x00FF) << 8 | (row & 0xFF00) >> 8
    turned = (turned & 0x0F0F) << 4 | (turned & 0xF0F0) >> 4
    turned = (turned & 0x3333) << 2 | (turned & 0xCCCC) >> 2
    return (turned & 0x5555) << 1 | (turned & 0xAAAA) >> 1


@compiled(inline="always")
def _side_of(frustum, side):
    """(a, b, c) of the distance a * x + b * y + c * z, in pixels at depth 1, to the left, right, top and bottom of the picture,
    and of depth."""
    if side < 2:
        return frustum.fx if side == 0 else -frustum.fx, 0.0, frustum.left if side == 0 else frustum.right
    if side < 4:
        return 0.0, frustum.fy if side == 2 else -frustum.fy, frustum.top if side == 2 else frustum.bottom
    return 0.0, 0.0, 1.0


@compiled(inline="always")
def _block_state(frustum, middle, half):
    """OUTSIDE, PARTLY or INSIDE: where a block lies; ``middle`` and ``half`` extent in world axes."""
    rotation, parallel, (hx, hy, hz) = frustum.rotation, frustum.parallel, half
    x, y, z = turned(rotation, middle)
    rounding = ROUNDING * (abs(middle[0]) + abs(middle[1]) + abs(middle[2]) + hx + hy + hz)
    state = INSIDE
    for side in range(5):
        a, b, c = _side_of(frustum, side)
        distance = a * x + b * y + c * (parallel if parallel > 0.0 and side < 4 else z)
        tilt = 0.0 if parallel > 0.0 and side < 4 else c
        extent = (
            abs(a * rotation[0][0] + b * rotation[1][0] + tilt * rotation[2][0]) * hx
            + abs(a * rotation[0][1] + b * rotation[1][1] + tilt * rotation[2][1]) * hy
            + abs(a * rotation[0][2] + b * rotation[1][2] + tilt * rotation[2][2]) * hz
        )
        slack = SLACK * extent + rounding * (abs(a) + abs(b) + abs(c))
        if distance + extent + slack < 0.0:
            state = OUTSIDE
            break
        if distance - extent - slack < 0.0:
            state = PARTLY
    return state


@compiled(inline="always")
def _stride(frustum, middle, half, lod, few, size, per):
    """Every how many rows of a block a cell can be drawn: where few points are wanted of any of its cells, only those whose
    row's lowest bits are 0.  lod: points wanted per pixel of this block."""
    row, (hx, hy, hz), depth = frustum.rotation[2], half, turned(frustum.rotation, middle)[2]
    near = max(depth - (abs(row[0]) * hx + abs(row[1]) * hy + abs(row[2]) * hz), 0.5 * size)
    most = lod * (size * frustum.fx / near) * (size * frustum.fy / near)
    most *= max(1.0, (abs(middle[0]) + abs(middle[1]) + abs(middle[2]) + hx + hy + hz) / near)
    stride = 1
    while stride < per and 2.0 * most * stride < few:
        stride *= 2
    return stride


@compiled(inline="always")
def _row_of(boxes, row):
    return (np.int64(boxes[row, 0]), np.int64(boxes[row, 1]), np.int64(boxes[row, 2]),
            np.int64(boxes[row, 3]), np.int64(boxes[row, 4]), np.int64(boxes[row, 5]))


@compiled(inline="always")
def _points_box(box, part):
    """The box of a cell's points: its code, its middle from the cell's, and its half extent.  box: a row of Scene.boxes.  part:
    half of a sixteenth of a cell, file units."""
    x0, y0, z0, x1, y1, z1 = box
    middle = (x0 + x1 + 1 - SHARES) * part, (y0 + y1 + 1 - SHARES) * part, (z0 + z1 + 1 - SHARES) * part
    return code_of_box(x0, y0, z0, x1, y1, z1), middle, ((x1 - x0 + 1) * part, (y1 - y0 + 1) * part, (z1 - z0 + 1) * part)


@compiled(inline="always")
def _reach(side, half):
    """How far a box extends towards a side of Frustum.sides."""
    return side[0] * half[0] + side[1] * half[1] + side[2] * half[2]


@compiled(inline="always")
def _box_in_view(frustum, middle, half):
    """Whether a box touches the frustum.  middle: in view axes.  half: its half extent in world axes."""
    x, y, z = middle
    fx, fy, sides, away = frustum.fx, frustum.fy, frustum.sides, frustum.parallel if frustum.parallel > 0.0 else z
    return (
        fx * x + frustum.left * away + _reach(sides[0], half) >= 0.0
        and frustum.right * away - fx * x + _reach(sides[1], half) >= 0.0
        and fy * y + frustum.top * away + _reach(sides[2], half) >= 0.0
        and frustum.bottom * away - fy * y + _reach(sides[3], half) >= 0.0
        and z + _reach(sides[4], half) >= 0.0
    )


@compiled(inline="always")
def _nearest(frustum, depth, half, size):
    """The least depth of a box, or an orthographic camera's depth of scale.  depth: of its middle.  size: of a cell."""
    return frustum.parallel if frustum.parallel > 0.0 else max(depth - _reach(frustum.sides[4], half), NEAREST * size)


@compiled(inline="always")
def _share_seen(frustum, face, middle, depth):
    """Which share of a face of a cell, seen at a right angle, its surfaces cover.  face: a row of Scene.faces.  middle: of the
    box of its points, from the camera, in world axes.  depth: of it."""
    x, y, z = frustum.rotation[2] if frustum.parallel > 0.0 else middle
    seen = face[0] * abs(x) + face[1] * abs(y) + face[2] * abs(z)
    return seen / (SQUARES if frustum.parallel > 0.0 else SQUARES * depth)


@compiled(nogil=True)
def visible_cells(grid, camera, lod, share, found):
    """Cells that intersect the frustum, by ascending row.  Returns how many.

    grid: BlockedCells.  camera: FrustumArrays.  lod: points wanted per pixel, 0 for all.
    share: (B,) float64, which share of the points wanted of each block is drawn (viewer.render.culling.crowding), or (0,): all.
    Cells of which fewer than FEW points are wanted stand for each other: so many are left out that as many points as are
    wanted of all remain; those drawn from far are drawn from nearer, too.
    found: FoundCells, written as far as there are cells; ``wanted`` only with a lod.
    """
    frustum, count = frustum_of(camera), 0
    corner = frustum.corner
    # arrays are read here and functions given numbers: numba counts references to arrays that it hands to functions, and its
    # atomic operations took a quarter of the time
    coords, blocks, faces, boxes, size, per = grid.coords, grid.blocks, grid.faces, grid.boxes, grid.size, grid.per
    rows, cell_view, wanted_of = found.rows, found.cell_view, found.wanted
    for block in range(blocks.shape[0]):
        middle = block_middle(blocks, block, size, frustum.shift)
        half = blocks[block, 3] * size, blocks[block, 4] * size, blocks[block, 5] * size
        state = _block_state(frustum, middle, half)
        if state == OUTSIDE:
            continue
        drawn, first, stride = share[block] if share.size > 0 else 1.0, block * per, 1
        few = min(FEW / drawn, FEW_HIDDEN)
        if drawn < 1.0:
            stride = _stride(frustum, middle, half, lod * drawn, few, size, per)
            first = (first + stride - 1) // stride * stride
        for row in range(first, min((block + 1) * per, coords.shape[0]), stride):
            place = cell_middle(coords, row, size, frustum.shift)
            view = turned(frustum.rotation, place)
            code, offset, (hx, hy, hz) = WHOLE_CODE, (0.0, 0.0, 0.0), (0.5 * size, 0.5 * size, 0.5 * size)
            if row < boxes.shape[0]:
                code, offset, (hx, hy, hz) = _points_box(_row_of(boxes, row), 0.5 * size / SHARES)
            box_offset, extent = turned(frustum.rotation, offset), (hx * WIDER, hy * WIDER, hz * WIDER)
            box = view[0] + box_offset[0], view[1] + box_offset[1], view[2] + box_offset[2]
            if state != INSIDE and not _box_in_view(frustum, box, extent):
                continue
            if lod > 0.0:
                nearest = _nearest(frustum, box[2], extent, size)
                wanted = lod * ((size * frustum.fx / nearest) * (size * frustum.fy / nearest))
                if row < faces.shape[0] and faces[row, 0] != UNKNOWN:
                    centre = place[0] + offset[0], place[1] + offset[1], place[2] + offset[2]
                    face = faces[row, 0], faces[row, 1], faces[row, 2]
                    wanted *= _share_seen(frustum, face, centre, max(box[2], nearest))
                wanted *= drawn
                if wanted < few:
                    if wanted * (STEPS / few) <= place_in_turn(row):
                        continue
                    wanted = few
                wanted_of[count] = wanted
            rows[count] = row
            cell_view[count, 0], cell_view[count, 1] = view[0] + corner[0], view[1] + corner[1]
            cell_view[count, 2], cell_view[count, 3] = view[2] + corner[2], code
            count += 1
    return count
