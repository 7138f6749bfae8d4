"""Lettering for training crops: lines of signs made of strokes, as stencils, labels and plates of real rooms have.

The rendered rooms have none, and a texture without form hardly differs from points that stray: a network taught by those
alone took faint numbers off an even tank.  Strokes are what sets the two apart.  The signs mean nothing: each is a few
edges of a small lattice, so that no font is needed and no alphabet learned.
"""

import numpy as np

COLUMNS, ROWS = 3, 4
"""Nodes of a sign's lattice."""
LEAST_HEIGHT, MOST_HEIGHT = 5.0, 45.0
"""Pixels of a sign."""
FAINTEST, STRONGEST = 0.03, 0.6
"""How much lighter or darker lettering is than what it stands on."""


def _edges() -> np.ndarray:
    """(edges, 2, 2) between nodes (x, y) of the lattice that are next to each other, diagonals too, both axes 0..1."""
    nodes = [(x, y) for y in range(ROWS) for x in range(COLUMNS)]
    beside = [(a, b) for a in nodes for b in nodes if a < b and max(abs(a[0] - b[0]), abs(a[1] - b[1])) == 1]
    return np.asarray(beside, np.float64) / (COLUMNS - 1, ROWS - 1)


_EDGES = _edges()


def _line(rng: np.random.Generator, side: int) -> tuple[np.ndarray, float]:
    """(strokes, 2, 2) ends (x, y) in pixels of a line of signs somewhere in a crop, and half the width of its strokes."""
    height = np.exp(rng.uniform(np.log(LEAST_HEIGHT), np.log(MOST_HEIGHT)))
    width, turn = height * rng.uniform(0.4, 0.8), rng.normal(0, 0.3)
    signs = [_EDGES[rng.choice(len(_EDGES), rng.integers(3, 8), replace=False)] + (pitch * rng.uniform(1.3, 1.8), 0)
             for pitch in range(int(rng.integers(1, 9)))]
    strokes = np.concatenate(signs) * (width, height)
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    shear = np.array([[1, 0], [rng.normal(0, 0.2), 1]])
    return strokes @ shear @ along + rng.uniform(-0.2, 0.9, 2) * side, max(0.45, height * rng.uniform(0.04, 0.1))


def covered(strokes: np.ndarray, half: float, at: np.ndarray, edge: float) -> np.ndarray:
    """(side, side) share of each place that strokes cover.

    strokes: (N, 2, 2) ends (x, y).  half: half their width.  at: (2, side, side) x and y of the places.  edge: over so
    many pixels a stroke's border fades.
    """
    side, share = at.shape[-1], np.zeros(at.shape[1:], np.float32)
    reach = half + edge + 1  # places lie within a pixel of their own middle
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
    """(3, side, side) float32 gains around 1, as points show them and as they truly are.

    A point lies on a stroke or beside it, somewhere within its pixel: of the points, lettering has ragged edges.
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
