"""Point spacing of a cloud: the distance between neighbouring points on the surfaces it samples.

Defined as 1 / sqrt(points per unit of area) and computed from the distance to the eighth neighbour, which noise and duplicate
points hardly change.  In the units of the points.
"""

import numpy as np

NEIGHBOURS = 8
"""Number of the neighbour whose distance is measured: among points spread at random it deviates by 1 / (2 sqrt(8)), 18 %."""


def median_spacing(xyz: np.ndarray, *, samples: int = 4096, seed: int = 0) -> float:
    """Median spacing over a seeded sample of points.

    xyz: (N, 3) float64.  Scaling ``xyz`` by a power of two scales the result exactly.  A cloud without extent gives 1.0.
    """
    from scipy.spatial import KDTree

    if len(xyz) <= NEIGHBOURS:
        extent = float(np.ptp(xyz, axis=0).max(initial=0.0)) if len(xyz) else 0.0
        return extent or 1.0
    rng = np.random.default_rng(seed)
    pick = rng.choice(len(xyz), min(samples, len(xyz)), replace=False)
    # few queries: the tree is not worth its balance, and the distances are the same
    tree = KDTree(xyz, balanced_tree=False, compact_nodes=False)
    distance, _ = tree.query(xyz[pick], NEIGHBOURS + 1, workers=-1)
    positive = distance[:, -1][distance[:, -1] > 0]
    return float(np.median(positive) * np.sqrt(np.pi / NEIGHBOURS)) if len(positive) else 1.0
