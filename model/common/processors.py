"""How many processors there are for us, and work on arrays spread over them."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

Arrays = tuple[np.ndarray, ...]

_SLICE = 4096
"""Entries a thread takes at a time: few enough to share out, enough to be worth the way."""
_threads: list[int] = []


def usable_processors() -> int:
    """Those that this process may use, at least 1: fewer than the machine's in a container or under ``taskset``."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def use_threads(count: int) -> None:
    """From now on :func:`in_slices` takes so many threads in this process: one of several that share the processors."""
    _threads[:] = [count]


def in_slices(kernel: Callable[..., Arrays], entries: Arrays, *rest: Any) -> Arrays:
    """``kernel(*entries, *rest)``, slices of the entries on all processors at once: the same to the bit.

    kernel: lets go of the interpreter's lock, and works out each entry for itself.  entries: arrays of one length.
    """
    count, threads = len(entries[0]), _threads[0] if _threads else usable_processors()
    if count <= _SLICE or threads == 1:
        return kernel(*entries, *rest)
    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(lambda i: kernel(*(entry[i : i + _SLICE] for entry in entries), *rest), range(0, count, _SLICE)))
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))
