"""The compiled loop that finds the chunks which a draw list needs."""

from ...model.common.jit import compiled


@compiled(nogil=True)
def tally_chunks(first, count, shift, tally):
    """Adds the points of each run to the chunks they lie in.

    first, count: (R,) int64, runs of points; a run may span chunks or be empty.  shift: a chunk has 2**shift points.
    tally: (C,) int64, updated.
    """
    for i in range(first.shape[0]):
        at, stop = first[i], first[i] + count[i]
        while at < stop:
            chunk = at >> shift
            end = min(stop, (chunk + 1) << shift)
            tally[chunk] += end - at
            at = end
