"""The number of usable processors, and array work distributed over them."""

import itertools
import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from ..system import after_fork_in_child

Arrays = tuple[np.ndarray, ...]

_SLICE = 4096
"""Entries that a thread takes at a time: few enough to balance the load, enough to outweigh the call.  4096 rays in a room of
model.synth take 5.7 ms of a processor, handing them over 0.008 ms; half takes 2.7 to 3.3 ms, twice 9 to 12 ms."""
_threads: list[int] = []
"""Number of threads where :func:`use_threads` has set one."""
_most: list[int] = []
"""The limit that :func:`limit_processors` has set."""
_sharing: list[int] = [1]


class _Pools(threading.local):
    """Threads of :func:`everywhere`, :func:`each` and :func:`in_rows`, by their number.

    Each calling thread has its own: in a common queue the window's picture waited for seconds behind the rows of a background
    job, and the threads had the priority of whichever thread had called first.  They end with the thread that called."""

    def __init__(self) -> None:
        self.made: dict[int, ThreadPoolExecutor] = {}


_pools = _Pools()


def usable_processors() -> int:
    """Processors that this process may use, at least 1; fewer than the machine has in a container, under ``taskset``, or after
    :func:`limit_processors`."""
    found = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min([found, *_most])


def limit_processors(most: int, sharing: int = 1) -> None:
    """From now on this process takes at most ``most`` processors for its own: it is one of ``sharing`` processes that share the
    machine for one work."""
    _most[:] = [most]
    _sharing[:] = [sharing]


def sharing_processes() -> int:
    """Processes that share this machine for one work, each with a part of its memory; 1 where this one is alone."""
    return _sharing[0]


def use_threads(count: int) -> None:
    """Sets the threads of this module's functions in this process, for one of several processes that share the processors."""
    _threads[:] = [count]


def _usable_threads() -> int:
    return _threads[0] if _threads else usable_processors()


after_fork_in_child(lambda: _pools.made.clear())  # a child has none of its parent's threads


def _pool(threads: int) -> ThreadPoolExecutor:
    made = _pools.made
    if threads not in made:
        made[threads] = ThreadPoolExecutor(threads, "loops")
    return made[threads]


def _finish(calls: list[Future]) -> None:
    """Waits for all calls, also where one fails or is interrupted: none may go on with what its caller then takes away."""
    try:
        for call in calls:
            call.result()
    finally:
        wait(calls)


def everywhere(loop: Callable[..., None], *arguments: Any) -> None:
    """Calls a compiled loop on every processor and waits for all of them; the loop shares the work by a counter of its own."""
    threads = _usable_threads()
    _finish([_pool(threads).submit(loop, *arguments) for _ in range(threads)])


def each(function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
    """``[function(item) for item in items]`` on all processors.

    function: spends its time outside the interpreter's lock, and calls none of this module's functions.
    """
    return list(_pool(_usable_threads()).map(function, items))


def in_rows(rows: int, least: int, loop: Callable[..., None], *arguments: Any) -> None:
    """``loop(*arguments, 0, rows)``, with the rows distributed over the processors, at least ``least`` rows each."""
    threads = _usable_threads()
    parts = max(1, min(threads, rows // least))
    if parts == 1:
        return loop(*arguments, 0, rows)
    edges = [rows * i // parts for i in range(parts + 1)]
    return _finish([_pool(threads).submit(loop, *arguments, a, b) for a, b in itertools.pairwise(edges)])


def in_slices(kernel: Callable[..., Arrays], entries: Arrays, *rest: Any) -> Arrays:
    """``kernel(*entries, *rest)``, with slices of the entries processed in parallel; bit-identical to one call.

    kernel: releases the interpreter's lock and processes each entry independently.  entries: arrays of one length.
    """
    count, threads = len(entries[0]), _usable_threads()
    if count <= _SLICE or threads == 1:
        return kernel(*entries, *rest)
    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(lambda i: kernel(*(entry[i : i + _SLICE] for entry in entries), *rest), range(0, count, _SLICE)))
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))
