"""The compiled loops of culling: blocks, cells, layers.  Serial and without the interpreter's lock, as in viewer.cloud.kernels.

They write into arrays they are given, allocate nothing, and keep the order of every sum, so that NumPy with the same
expressions gives the same bits.
"""

import numpy as np

from model.compiled import compiled
from viewer.cloud.faces import SQUARES, UNKNOWN

SLACK = 1e-8
"""Of a block's reach, by which its test errs towards looking at its cells: above the 1e-9 that each cell is given."""
ROUNDING = 1e-12
"""Of a coordinate: above what float64 loses between a block's test and that of its cells."""


@compiled(nogil=True)
def visible_cells(coords, blocks, per, size, shift, rotation, lens, reach, corner, lod, focal, faces, cells, cell_view, need):
    """Cells that touch the frustum, by ascending row.  Returns how many.

    coords: (C, 3) int32.  blocks: (B, 6) float64, middle and half extent of each ``per`` consecutive cells, in cells.
    size: of a cell.  shift: (3,) from the camera to the grid's origin.  rotation: (3, 3) world to view.  lens: (6,) fx, fy
    and the four sides' distances from the middle of the picture in pixels (left, right, top, bottom).  reach: (5,) by how
    much a cell's corner comes nearer to each side, and forward.  corner: (3,) view vector from a cell's middle to its first
    step's.  lod: points wanted a pixel, 0 for all.  focal: (3,) fx, fy and how far a cell's middle lies behind its nearest
    corner.  faces: (C, 3) uint8 as in Scene, or (0, 3): each cell's need is that of a wall across all of it, seen squarely.
    Writes cells (C,) int32, cell_view (C, 4) float32, need (C,) float64, the points wanted of the cell.
    """
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    fx, fy, left, right, top, bottom = lens[0], lens[1], lens[2], lens[3], lens[4], lens[5]
    found = 0
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
            distance = a * x + b * y + c * z
            extent = (
                abs(a * r00 + b * r10 + c * r20) * hx
                + abs(a * r01 + b * r11 + c * r21) * hy
                + abs(a * r02 + b * r12 + c * r22) * hz
            )
            slack = SLACK * extent + far * (abs(a) + abs(b) + abs(c))
            if distance + extent + slack < 0.0:
                outside = True
                break
            if distance - extent - slack < 0.0:
                inside = False
        if outside:
            continue
        for row in range(block * per, min((block + 1) * per, coords.shape[0])):
            px = (coords[row, 0] + 0.5) * size + shift[0]
            py = (coords[row, 1] + 0.5) * size + shift[1]
            pz = (coords[row, 2] + 0.5) * size + shift[2]
            x = r00 * px + r01 * py + r02 * pz
            y = r10 * px + r11 * py + r12 * pz
            z = r20 * px + r21 * py + r22 * pz
            if not inside and not (
                fx * x + left * z + reach[0] >= 0.0
                and right * z - fx * x + reach[1] >= 0.0
                and fy * y + top * z + reach[2] >= 0.0
                and bottom * z - fy * y + reach[3] >= 0.0
                and z + reach[4] >= 0.0
            ):
                continue
            cells[found] = row
            cell_view[found, 0] = x + corner[0]
            cell_view[found, 1] = y + corner[1]
            cell_view[found, 2] = z + corner[2]
            cell_view[found, 3] = 0.0
            if lod > 0.0:
                nearest = max(z - focal[2], 1e-9 * size)
                need[found] = lod * ((size * focal[0] / nearest) * (size * focal[1] / nearest))
                if row < faces.shape[0] and faces[row, 0] != UNKNOWN:
                    seen = faces[row, 0] * abs(px) + faces[row, 1] * abs(py) + faces[row, 2] * abs(pz)
                    need[found] *= seen / (SQUARES * max(z, nearest))
            found += 1
    return found


@compiled(nogil=True)
def list_runs(offsets, layers, total, cells, visible, lod, need, extra, held, active, first, count, slot):
    """Runs of points of the visible cells, by ascending first: of each cell the fewest layers that hold ``need`` points.

    offsets: (layers * total + 1,) int64 as in Scene.  cells: rows of the scene's cells, the first ``visible`` count.
    lod: 0 for all layers.  extra: viewer.cloud.layers.part_extra; of a cell's last layer as many parts as are needed.  held
    (int64), active (int32): scratch, one an entry of cells.  first, count (int64), slot (int32): written as far as there is
    room.  Returns (runs, points, room): all are written if the lists are ``room`` long.
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
