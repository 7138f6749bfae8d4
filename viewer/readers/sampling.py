"""Where to read a file so that a small sample of its points is spread over all of it.

Positions are counted in points, or in bytes of text.  They come in an order in which every beginning of the list is spread over
the file too, so that a reader whose time is up can stop anywhere.
"""

import numpy as np

FEWEST_ALIGNED = 16
"""Compressed blocks a file must have for runs to begin at their boundaries: runs then begin at most a
sixteenth of the file apart, and with fewer blocks the gaps between them would be visible."""


def run_starts(count: int, points: int, run: int, align: int = 1) -> np.ndarray:
    """Beginnings of runs of ``run`` points that sample ``count`` points evenly, about ``points`` in all.

    align: runs begin at multiples of this where the file has at least FEWEST_ALIGNED of them.  Runs do not overlap, except that
    of a file with fewer aligned blocks.  Where ``points`` covers the file, the runs do as well.
    Returns (k,) int64, each once, in bit-reversed order.
    """
    every = -(-count // run)
    runs = max(1, min(points // run, every))
    if runs == every:
        starts = np.arange(runs, dtype=np.int64) * run
    else:
        starts = np.linspace(0, max(count - run, 0), runs).astype(np.int64)
    if align > 1 and count >= FEWEST_ALIGNED * align:
        starts = np.unique(starts // align * align)
    return starts[bit_reversed(len(starts))]


def bit_reversed(count: int) -> np.ndarray:
    """(count,) int64: the numbers 0 to count - 1 in the order of their bits read backwards (van der Corput)."""
    bits = max(1, (count - 1).bit_length())
    numbers = np.arange(1 << bits)
    reverse = np.zeros_like(numbers)
    for bit in range(bits):
        reverse |= (numbers >> bit & 1) << bits - 1 - bit
    return reverse[reverse < count]


def interleaved(counts: list[int], points: int, run: int) -> list[tuple[int, int]]:
    """(part, start) of runs over several parts of a file (scans), in proportion to their points and in turns.

    counts: points of each part.  Every part that holds points gets at least one run.
    """
    total = max(sum(counts), 1)
    listed: list[tuple[float, int, int]] = []
    for part, count in enumerate(counts):
        if count:
            starts = run_starts(count, max(run, points * count // total), run).tolist()
            listed += [((turn + 0.5) / len(starts), part, start) for turn, start in enumerate(starts)]
    return [(part, start) for _, part, start in sorted(listed, key=lambda entry: entry[0])]


def sampled_nodes(levels: np.ndarray, counts: np.ndarray, points: int) -> list[tuple[int, int]]:
    """Which nodes of an octree make a sample of about ``points`` points: (number of the node, use every n-th of its points).

    levels: (n,) of each node, 0 at the root.  counts: (n,) its points.  Whole levels from the root down, as many as fit; of the
    next level every n-th point, so that the sample stays even.  Within a level the nodes are in bit-reversed order.
    """
    chosen: list[tuple[int, int]] = []
    left = points
    for level in np.unique(levels):
        nodes = np.flatnonzero(levels == level)
        held = int(counts[nodes].sum())
        step = -(-held // left)
        chosen += [(int(node), step) for node in nodes[bit_reversed(len(nodes))]]
        left -= held
        if left < points // 4:  # what is left would be too sparse a share of the next level
            break
    return chosen
