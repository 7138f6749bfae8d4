"""Point spacing of a place: scans that overlap are denser together than each by itself.

As in viewer.grid.building.spacing, but points of cells at one place of the lattice are looked at together, whichever grid
has them.
"""

import numpy as np

from ..building.spacing import CELLS, of_candidates
from ..density_layers import morton_order
from ..gathered_rows import gathered
from ..scene import Scene


def joined_spacing(scene: Scene) -> float:
    """File units: the median over about 1500 points, in cells chosen in proportion to their points.  scene: a joined one;
    its own ``spacing`` is taken where no two different points are near each other."""
    coords, sizes = np.asarray(scene.cell_coords), np.diff(np.asarray(scene.offsets)).reshape(scene.layers, -1).sum(axis=0)
    order = morton_order(coords - coords.min(axis=0))
    new = np.r_[True, (coords[order[1:]] != coords[order[:-1]]).any(axis=1)]
    starts = np.flatnonzero(new)
    share = np.add.reduceat(sizes[order], starts).cumsum()
    places = np.searchsorted(share, (np.arange(CELLS) + 0.5) / CELLS * share[-1], side="right")
    ends, found = np.r_[starts[1:], len(order)], []
    for place in np.unique(places).tolist():
        cells = gathered(scene, order[starts[place] : ends[place]])
        found.append(of_candidates(cells.points))
    distances = np.concatenate(found)
    apart = distances[distances > 0]
    return float(np.median(apart)) * scene.step if len(apart) else scene.spacing
