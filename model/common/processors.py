"""The number of usable processors, and array work distributed over them."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

Arrays = tuple[np.ndarray, ...]

_SLICE = 4096
"""Entries that a thread takes at a time: few enough to balance the load, enough to outweigh the call.  Chosen by hand."""
_threads: list[int] = []
"""Number of threads of :func:`in_slices` where :func:`use_threads` has set one."""


def usable_processors() -> int:
    """Processors that this process may use, at least 1; fewer than the machine has in a container or under ``taskset``."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def use_threads(count: int) -> None:
    """Sets the threads of :func:`in_slices` in this process, for one of several processes that share the processors."""
    _threads[:] = [count]


def in_slices(kernel: Callable[..., Arrays], entries: Arrays, *rest: Any) -> Arrays:
    """``kernel(*entries, *rest)``, with slices of the entries processed in parallel; bit-identical to one call.

    kernel: releases the interpreter's lock and processes each entry independently.  entries: arrays of one length.
    """
    count, threads = len(entries[0]), _threads[0] if _threads else usable_processors()
    if count <= _SLICE or threads == 1:
        return kernel(*entries, *rest)
    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(lambda i: kernel(*(entry[i : i + _SLICE] for entry in entries), *rest), range(0, count, _SLICE)))
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))
