"""Compiled loops of viewer.grid.building.spacing: positions of some of a grid's points, and their nearest neighbours."""

import numpy as np

from ....model.common.jit import compiled


@compiled(nogil=True)
def gather_steps(points, starts, sizes, xyz):
    """Unpacks the positions within their cell of the points of some runs, until ``xyz`` is full.

    points: (N, 3) uint32 as in Scene.  starts, sizes: (R,) int64.  Writes xyz (3, n) float64, in packed steps.
    """
    done = 0
    for run in range(starts.shape[0]):
        for i in range(starts[run], starts[run] + min(sizes[run], xyz.shape[1] - done)):
            xyz[0, done], xyz[1, done] = points[i, 0] & 0xFFFF, points[i, 0] >> 16
            xyz[2, done] = points[i, 1] & 0xFFFF
            done += 1
    return done


@compiled(nogil=True)
def neighbour_distances(xyz, queries, k, squared, out, tallies):
    """Squared distance from each query (a column of xyz) to the k-th nearest position of other points, by exhaustive search.
    Points at the same position count once: duplicated points do not reduce the spacing.

    xyz: (3, n) float64, n > k, one row per axis, so that the first loop compiles to vector instructions.  queries: (m,) int64.
    squared: scratch, (n,) float64.  out: (m,) float64, to the last position where there are fewer than k, 0 where there is
    none.
    tallies: (m, 3) int64: other points at the query's position, positions found, and points at these.
    """
    xs, ys, zs = xyz[0], xyz[1], xyz[2]
    nearest, which = np.empty(k), np.empty(k, np.int64)
    for j in range(queries.shape[0]):
        nearest[:] = np.inf
        q = queries[j]
        x, y, z = xs[q], ys[q], zs[q]
        for i in range(xs.shape[0]):
            dx, dy, dz = xs[i] - x, ys[i] - y, zs[i] - z
            squared[i] = (dx * dx + dy * dy) + dz * dz
        worst, found, same, repeated = np.inf, 0, 0, False
        for i in range(xs.shape[0]):
            d = squared[i]
            if d < worst:
                if d == 0.0:
                    same += 1
                    continue
                at, again = min(found, k - 1), False
                for n in range(found):
                    if nearest[n] == d:
                        m = which[n]
                        again |= (xs[m] == xs[i]) & (ys[m] == ys[i]) & (zs[m] == zs[i])
                if again:
                    repeated = True
                    continue
                while at > 0 and nearest[at - 1] > d:
                    nearest[at], which[at] = nearest[at - 1], which[at - 1]
                    at -= 1
                nearest[at], which[at] = d, i
                found = min(found + 1, k)
                worst = nearest[k - 1]
        out[j] = nearest[found - 1] if found else 0.0
        held = found
        if repeated:
            held = -same
            for i in range(xs.shape[0]):
                held += squared[i] <= out[j]
        tallies[j, 0], tallies[j, 1], tallies[j, 2] = same - 1, found, held
