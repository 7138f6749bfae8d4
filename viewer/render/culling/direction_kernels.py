"""Compiled loops of the directions that a scan encloses (viewer.render.culling.enclosed_directions): the cells of a cube of
directions that hold points, holes between them, and the sample of points near the camera.  World axes."""

from ....model.common.jit import compiled

SKY_BELOW, ALL_SKY = 0.15, 0.4
"""Share of a sky that may lie below the horizon; and share of all directions above which a hole is sky wherever it lies.
In three streets at most 0.1 of the sky lies below; at their ends, where it continues below the border of the scan, it has 0.46
to 0.61 of all directions.  Holes behind a courtyard's pillars have up to 0.2 of them, of which 0.2 to 0.4 below."""
SAMPLES_A_CELL = 8
"""Points in a cell of the cube after which no more are looked at: if the scan covers half of the cell, so many random points
all miss it with a probability of 0.4 %."""


@compiled(inline="always")
def _mark(x, y, z, side, scanned):
    """Marks the cell of one direction; (0, 0, 0) has none."""
    if abs(x) >= abs(y) and abs(x) >= abs(z):
        axis, along, u, v = 0, x, y, z
    elif abs(y) >= abs(z):
        axis, along, u, v = 1, y, z, x
    else:
        axis, along, u, v = 2, z, x, y
    if along != 0.0:
        size = abs(along)
        column = min(max(int((u / size * 0.5 + 0.5) * side), 0), side - 1)
        row = min(max(int((v / size * 0.5 + 0.5) * side), 0), side - 1)
        scanned[((2 * axis + (1 if along < 0.0 else 0)) * side + row) * side + column] = True


@compiled(nogil=True)
def mark_directions(points, position, side, scanned):
    """Which cells hold a point as seen from ``position``.  points: (N, 3) float64.  Sets cells of scanned (cells,) bool."""
    for i in range(points.shape[0]):
        _mark(points[i, 0] - position[0], points[i, 1] - position[1], points[i, 2] - position[2], side, scanned)


@compiled(nogil=True)
def mark_near(blocks, marked, first, points, block_side, position, side, scanned):
    """The same for near blocks, in which the ``marked`` points per block that are marked already are fewer than SAMPLES_A_CELL
    in a cell of the cube.

    blocks: (B, 3) float64 their middles.  first: (B + 1,) int64, where each one's points begin in points (N, 3) float64; in
    each block in random order.
    """
    cell = 2.0 / side  # side of a cell of the cube at distance 1
    for block in range(blocks.shape[0]):
        x, y, z = blocks[block, 0] - position[0], blocks[block, 1] - position[1], blocks[block, 2] - position[2]
        cells = block_side * block_side / (cell * cell * max(x * x + y * y + z * z, 1e-30 * block_side * block_side))
        if cells < 1.0 or marked >= SAMPLES_A_CELL * cells:
            continue
        begin, end = first[block], first[block + 1]
        if SAMPLES_A_CELL * cells < end - begin:
            end = begin + int(SAMPLES_A_CELL * cells)
        mark_directions(points[begin:end], position, side, scanned)


@compiled(nogil=True)
def close_directions(scanned, walks, needed, closed):
    """Which cells are enclosed by cells that hold a point.  walks: as in _walks.  Writes closed (cells,) int8."""
    for cell in range(walks.shape[0]):
        hits = 0
        for walk in range(walks.shape[1]):
            for step in range(walks.shape[2]):
                if scanned[walks[cell, walk, step]]:
                    hits += 1
                    break
        closed[cell] = hits >= needed


@compiled(nogil=True)
def settle_holes(scanned, walks, below, enclosing, closed, hole, queue):
    """One answer for each hole: cells without a point that touch, and the scanned cells around them.

    scanned (cells,) bool and closed (cells,) int8: from close_directions; closed is changed.  walks: as in _walks; the first
    cell of each is taken for a neighbour.  below: (cells,) bool.  enclosing: ENCLOSES.  hole, queue: scratch, (cells,) int32.
    Returns how many cells below belong to holes that go on above, and how many cells of the largest sky
    have no scanned one beside them.
    """
    cells, through, sky = len(scanned), 0, 0
    hole[:] = -1
    enclosed = enclosing * (cells - scanned.sum()) <= cells
    for first in range(cells):
        if scanned[first] or hole[first] >= 0:
            continue
        queue[0], size, at, enclosed_cells, under, deep = first, 1, 0, 0, 0, 0
        hole[first] = first
        while at < size:
            cell = queue[at]
            at += 1
            enclosed_cells += closed[cell]
            under += below[cell]
            free = True
            for walk in range(walks.shape[1]):
                beside = walks[cell, walk, 0]
                free = free and not scanned[beside]
                if not scanned[beside] and hole[beside] < 0:
                    hole[beside] = first
                    queue[size] = beside
                    size += 1
            deep += free
        lies_below = under == size
        if under <= SKY_BELOW * size or size >= ALL_SKY * cells:
            sky = max(sky, deep)  # a ceiling so near that cells fall between its points is no sky
        answer = 2 * enclosed_cells >= size or (enclosed and lies_below)
        for i in range(size):
            closed[queue[i]] = answer
        through += 0 if lies_below else under
    for cell in range(cells):
        if not scanned[cell]:
            continue
        holes, of_them_open = 0, 0
        for walk in range(walks.shape[1]):
            beside = walks[cell, walk, 0]
            if not scanned[beside]:
                holes += 1
                of_them_open += closed[beside] == 0
        if holes > 0 and of_them_open == 0:
            closed[cell] = 1
    return through, sky
