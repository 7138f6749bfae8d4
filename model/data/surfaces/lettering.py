"""Lettering for training crops: lines of glyphs made of strokes, like stencils, labels and plates in real rooms.

The rendered rooms have no lettering, and a texture without shapes hardly differs from outlier points: a network trained on
those alone removed faint numbers from a uniform tank.  The glyphs have no meaning: each consists of a few edges of a small
lattice, so that no font is needed and no alphabet is learned.
"""

import numpy as np

COLUMNS, ROWS = 3, 4
"""Nodes of a glyph's lattice."""
MIN_HEIGHT, MAX_HEIGHT = 5.0, 45.0
"""Height of a glyph, pixels.  This and the contrasts below are those of the shipped weights' training
(assets/weights/README.md)."""
FAINTEST, STRONGEST = 0.03, 0.6
"""Relative difference in brightness between lettering and its surface."""


def _edges() -> np.ndarray:
    """(edges, 2, 2): edges between adjacent nodes (x, y) of the lattice, diagonals included, both axes 0..1."""
    nodes = [(x, y) for y in range(ROWS) for x in range(COLUMNS)]
    beside = [(a, b) for a in nodes for b in nodes if a < b and max(abs(a[0] - b[0]), abs(a[1] - b[1])) == 1]
    return np.asarray(beside, np.float64) / (COLUMNS - 1, ROWS - 1)


_EDGES = _edges()


def _line(rng: np.random.Generator, side: int) -> tuple[np.ndarray, float]:
    """(strokes, 2, 2): end points (x, y), pixels, of a line of glyphs at a random position, and half the stroke width."""
    height = np.exp(rng.uniform(np.log(MIN_HEIGHT), np.log(MAX_HEIGHT)))
    width, turn = height * rng.uniform(0.4, 0.8), rng.normal(0, 0.3)
    signs = [_EDGES[rng.choice(len(_EDGES), rng.integers(3, 8), replace=False)] + (pitch * rng.uniform(1.3, 1.8), 0)
             for pitch in range(int(rng.integers(1, 9)))]
    strokes = np.concatenate(signs) * (width, height)
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    shear = np.array([[1, 0], [rng.normal(0, 0.2), 1]])
    return strokes @ shear @ along + rng.uniform(-0.2, 0.9, 2) * side, max(0.45, height * rng.uniform(0.04, 0.1))


def covered(strokes: np.ndarray, half: float, at: np.ndarray, edge: float) -> np.ndarray:
    """(side, side) coverage by strokes, 0..1.

    strokes: (N, 2, 2) end points (x, y).  half: half the stroke width.  at: (2, side, side) x and y of the sampled positions.
    edge: width of a stroke's soft border, pixels.
    """
    side, share = at.shape[-1], np.zeros(at.shape[1:], np.float32)
    reach = half + edge + 1  # positions lie within a pixel of their pixel's centre
    for a, b in strokes:
        first = np.clip(np.floor(np.minimum(a, b) - reach).astype(int), 0, side)
        last = np.clip(np.ceil(np.maximum(a, b) + reach).astype(int), 0, side)
        if (first >= last).any():
            continue
        window = np.s_[first[1] : last[1], first[0] : last[0]]
        x, y = at[0][window] - a[0], at[1][window] - a[1]
        way = b - a
        part = np.clip((x * way[0] + y * way[1]) / max(float(way @ way), 1e-12), 0, 1)
        distance = np.hypot(x - part * way[0], y - part * way[1])
        share[window] = np.maximum(share[window], np.clip((half - distance) / edge + 0.5, 0, 1))
    return share


def lettering(rng: np.random.Generator, side: int) -> tuple[np.ndarray, np.ndarray]:
    """(3, side, side) float32 gains around 1: at the points, and true.

    A point lies at a random position in its pixel, on a stroke or beside it, so lettering has ragged edges in the points.
    """
    middle = np.mgrid[0:side, 0:side][::-1] + 0.5
    within = middle + rng.uniform(-0.5, 0.5, (2, side, side)) * rng.uniform(0, 1)
    seen, true = np.ones((2, 3, side, side), np.float32)
    for _ in range(rng.integers(2, 9)):
        strokes, half = _line(rng, side)
        depth = np.exp(rng.uniform(np.log(FAINTEST), np.log(STRONGEST)))
        depth = rng.choice([-1, 1]) * np.clip(depth * (1 + 0.2 * rng.normal(size=(3, 1, 1))), 0, 0.9)
        seen *= (1 + depth * covered(strokes, half, within, 0.3)).astype(np.float32)
        true *= (1 + depth * covered(strokes, half, middle, 1.0)).astype(np.float32)
    return seen, true
