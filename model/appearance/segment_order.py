"""Sorting of points by segment (the points of one neighbourhood and group), and within segments.

np.lexsort takes 80 ns an entry for four keys.  Keys that number few things are sorted by their ranks of 16 bits, for which
numpy has a radix sort, and segments, which are short, each by itself on all processors.
"""

import numpy as np

from ..common.jit import compiled
from ..common.process.processors import in_rows

_LEAST_SEGMENTS = 64  # for which another thread is used, at least: 0.5 ms of a processor


def stable_order(*keys: np.ndarray) -> np.ndarray:
    """(n,) the order that sorts by keys (n,), the first of them foremost; equal entries keep their order.  As np.lexsort, whose
    foremost key is the last."""
    order = np.arange(len(keys[0]))
    for key in reversed(keys):
        if len(key) == 0 or key.min() == key.max():
            continue
        distinct, rank = np.unique(key, return_inverse=True)
        rank = rank.astype(np.uint16) if len(distinct) <= 1 << 16 else rank
        order = order[np.argsort(rank[order], kind="stable")]
    return order


def sorted_within(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """(n,) values sorted within each segment.  starts: (S + 1,) where segments begin, the last number being n."""
    found = values.copy()
    in_rows(len(starts) - 1, _LEAST_SEGMENTS, _sort, found, starts)
    return found


def order_within(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """(n,) the order that sorts values within each segment, equal ones as they are.  starts: as for :func:`sorted_within`."""
    order = np.empty(len(values), np.int64)
    in_rows(len(starts) - 1, _LEAST_SEGMENTS, _order, values, starts, order)
    return order


@compiled(nogil=True)
def _sort(values, starts, first, last):
    for segment in range(first, last):
        values[starts[segment] : starts[segment + 1]].sort()


@compiled(nogil=True)
def _order(values, starts, order, first, last):
    for segment in range(first, last):
        begin, end = starts[segment], starts[segment + 1]
        order[begin:end] = begin + np.argsort(values[begin:end], kind="mergesort")
