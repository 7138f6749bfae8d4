"""Compiled loops of culling: blocks, cells, layers.  Serial, without the interpreter's lock, as in
viewer.grid.building.kernels.

They write into arrays of the caller, allocate nothing, and keep the order of every sum, so that NumPy with the same expressions
gives the same bits.
"""

import numpy as np

from ....model.common.jit import compiled
from ...grid.cell_boxes import SHARE_BITS, SHARES, WHOLE
from ...grid.projected_coverage import SQUARES, UNKNOWN

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


@compiled(nogil=True)
def visible_cells(coords, blocks, per, size, shift, rotation, lens, parallel, sides, corner, lod, faces, boxes, share, cells,
                  cell_view, need):
    """Cells that intersect the frustum, by ascending row.  Returns how many.

    coords: (C, 3) int32.  blocks: (B, 6) float64, middle and half extent of each ``per`` consecutive cells, in cells.
    size: of a cell.  shift: (3,) from the camera to the grid's origin.  rotation: (3, 3) world to view.  lens: (6,) fx, fy
    and the four sides' distances from the middle of the picture in pixels (left, right, top, bottom).  parallel: of an
    orthographic camera, the depth at which the lens gives its scale; 0 of a pinhole.
    sides: (5, 3), change of the distance to each of the four sides, and of depth, per unit along x, y and z.
    corner: (3,) view vector from a cell's middle to its first step's.  lod: points wanted a pixel, 0 for all.
    faces: (C, 3) uint8 as in Scene, or (0, 3): each cell is taken for a wall across all of it, seen at a right angle.
    boxes: (C, 6) uint8 as in Scene, or (0, 6): the cells'.
    share: (B,) float64, which share of the points wanted of each block is drawn (viewer.render.culling.crowding), or (0,): all.
    Cells of which fewer than FEW points are wanted stand for each other: so many are left out that as many points as are
    wanted of all remain; those drawn from far are drawn from nearer, too.
    Writes cells (C,) int32, cell_view (C, 4) float32, need (C,) float64, the points wanted of the cell.
    """
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    fx, fy, left, right, top, bottom = lens[0], lens[1], lens[2], lens[3], lens[4], lens[5]
    found, part, half = 0, 0.5 * size / SHARES, 0.5 * size
    for block in range(blocks.shape[0]):
        px = blocks[block, 0] * size + shift[0]
        py = blocks[block, 1] * size + shift[1]
        pz = blocks[block, 2] * size + shift[2]
        hx, hy, hz = blocks[block, 3] * size, blocks[block, 4] * size, blocks[block, 5] * size
        x = r00 * px + r01 * py + r02 * pz
        y = r10 * px + r11 * py + r12 * pz
        z = r20 * px + r21 * py + r22 * pz
        far = ROUNDING * (abs(px) + abs(py) + abs(pz) + hx + hy + hz)
        outside, inside = False, True
        for side in range(5):
            if side < 2:
                a, b, c = fx if side == 0 else -fx, 0.0, left if side == 0 else right
            elif side < 4:
                a, b, c = 0.0, fy if side == 2 else -fy, top if side == 2 else bottom
            else:
                a, b, c = 0.0, 0.0, 1.0
            distance = a * x + b * y + c * (parallel if parallel > 0.0 and side < 4 else z)
            tilt = 0.0 if parallel > 0.0 and side < 4 else c
            extent = (
                abs(a * r00 + b * r10 + tilt * r20) * hx
                + abs(a * r01 + b * r11 + tilt * r21) * hy
                + abs(a * r02 + b * r12 + tilt * r22) * hz
            )
            slack = SLACK * extent + far * (abs(a) + abs(b) + abs(c))
            if distance + extent + slack < 0.0:
                outside = True
                break
            if distance - extent - slack < 0.0:
                inside = False
        if outside:
            continue
        drawn, first, stride = share[block] if share.size > 0 else 1.0, block * per, 1
        few = min(FEW / drawn, FEW_HIDDEN)
        if drawn < 1.0:  # far: where few points are wanted of any of its cells, only rows whose lowest bits are 0 can be drawn
            near = max(z - (abs(r20) * hx + abs(r21) * hy + abs(r22) * hz), half)
            most = lod * drawn * (size * fx / near) * (size * fy / near)
            most *= max(1.0, (abs(px) + abs(py) + abs(pz) + hx + hy + hz) / near)
            while stride < per and 2.0 * most * stride < few:
                stride *= 2
            first = (first + stride - 1) // stride * stride
        for row in range(first, min((block + 1) * per, coords.shape[0]), stride):
            px = (coords[row, 0] + 0.5) * size + shift[0]
            py = (coords[row, 1] + 0.5) * size + shift[1]
            pz = (coords[row, 2] + 0.5) * size + shift[2]
            x = r00 * px + r01 * py + r02 * pz
            y = r10 * px + r11 * py + r12 * pz
            z = r20 * px + r21 * py + r22 * pz
            cells[found] = row
            cell_view[found, 0] = x + corner[0]
            cell_view[found, 1] = y + corner[1]
            cell_view[found, 2] = z + corner[2]
            cell_view[found, 3] = WHOLE_CODE
            hx, hy, hz = half, half, half
            if row < boxes.shape[0]:  # from the cell to the box of its points
                x0, y0, z0 = np.int64(boxes[row, 0]), np.int64(boxes[row, 1]), np.int64(boxes[row, 2])
                x1, y1, z1 = np.int64(boxes[row, 3]), np.int64(boxes[row, 4]), np.int64(boxes[row, 5])
                cell_view[found, 3] = code_of_box(x0, y0, z0, x1, y1, z1)
                hx, hy, hz = (x1 - x0 + 1) * part, (y1 - y0 + 1) * part, (z1 - z0 + 1) * part
                dx, dy, dz = (x0 + x1 + 1 - SHARES) * part, (y0 + y1 + 1 - SHARES) * part, (z0 + z1 + 1 - SHARES) * part
                px, py, pz = px + dx, py + dy, pz + dz
                x += r00 * dx + r01 * dy + r02 * dz
                y += r10 * dx + r11 * dy + r12 * dz
                z += r20 * dx + r21 * dy + r22 * dz
            hx, hy, hz = hx * WIDER, hy * WIDER, hz * WIDER
            away = parallel if parallel > 0.0 else z
            if not inside and not (
                fx * x + left * away + (sides[0, 0] * hx + sides[0, 1] * hy + sides[0, 2] * hz) >= 0.0
                and right * away - fx * x + (sides[1, 0] * hx + sides[1, 1] * hy + sides[1, 2] * hz) >= 0.0
                and fy * y + top * away + (sides[2, 0] * hx + sides[2, 1] * hy + sides[2, 2] * hz) >= 0.0
                and bottom * away - fy * y + (sides[3, 0] * hx + sides[3, 1] * hy + sides[3, 2] * hz) >= 0.0
                and z + (sides[4, 0] * hx + sides[4, 1] * hy + sides[4, 2] * hz) >= 0.0
            ):
                continue
            if lod > 0.0:
                nearest = max(z - (sides[4, 0] * hx + sides[4, 1] * hy + sides[4, 2] * hz), 1e-9 * size)
                if parallel > 0.0:
                    nearest = parallel
                need[found] = lod * ((size * fx / nearest) * (size * fy / nearest))
                if row < faces.shape[0] and faces[row, 0] != UNKNOWN:
                    if parallel > 0.0:
                        seen = faces[row, 0] * abs(r20) + faces[row, 1] * abs(r21) + faces[row, 2] * abs(r22)
                        need[found] *= seen / SQUARES
                    else:
                        seen = faces[row, 0] * abs(px) + faces[row, 1] * abs(py) + faces[row, 2] * abs(pz)
                        need[found] *= seen / (SQUARES * max(z, nearest))
                need[found] *= drawn
                if need[found] < few:
                    if need[found] * (STEPS / few) <= place_in_turn(row):
                        continue
                    need[found] = few
            found += 1
    return found


@compiled(nogil=True)
def list_runs(offsets, layers, total, cells, visible, lod, need, extra, held, active, first, count, slot):
    """Runs of points of the visible cells, by ascending first: for each cell the fewest layers that hold ``need`` points.

    offsets: (layers * total + 1,) int64 as in Scene.  cells: rows of the scene's cells, the first ``visible`` count.
    lod: 0 for all layers.  extra: viewer.grid.density_layers.part_extra; of a cell's last layer as many parts as are needed.
    held (int64), active (int32): scratch, one entry a cell.  first, count (int64), slot (int32): written as far as they are
    long enough.  Returns (runs, points, room): all runs are written if the lists are ``room`` long.
    """
    runs, points, live, room, parts = 0, 0, visible, 0, extra.shape[0]
    for i in range(visible):
        held[i], active[i] = 0, i
    for layer in range(layers):
        base, kept = layer * total, 0
        room = max(room, runs + live)
        fits = room <= first.shape[0]
        for i in range(live):  # few branches: whether a cell goes on, or holds anything, is not to be foreseen
            place = active[i]
            start = offsets[base + cells[place]]
            here = offsets[base + cells[place] + 1] - start
            if lod > 0.0:
                short = need[place] - held[place]
                if here > short:
                    taken = max(int(np.ceil(parts * short / here)), 1)
                    here = (here // parts) * taken + extra[here % parts, taken]
                held[place] += here
                active[kept] = place
                kept += not held[place] >= need[place]
            if fits:
                first[runs], count[runs], slot[runs] = start, here, place
            runs += here > 0
            points += here
        if lod > 0.0:
            live = kept
    return runs, points, room
