"""Requests to a server, several at a time: a far server fills a fast line only in part with one."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

Job = TypeVar("Job")
Answer = TypeVar("Answer")

_AT_ONCE = 6
_TICK_S = 0.2
"""Seconds after which a waiting caller gets control, to stop where a person cancels."""


def answers(jobs: Iterable[Job], ask: Callable[[Job], Answer]) -> Iterator[tuple[Job, Answer] | None]:
    """Yields each job with its answer, in the order in which answers come, and None where none came for a while.

    Whoever stops iterating waits for the requests under way; an error of one ends all.
    """
    left = iter(jobs)
    with ThreadPoolExecutor(_AT_ONCE, "pointglass fetch") as pool:
        running: dict[Future[Answer], Job] = {}
        try:
            while True:
                for job in left:
                    running[pool.submit(ask, job)] = job
                    if len(running) >= 2 * _AT_ONCE:
                        break
                if not running:
                    return
                done = wait(running, timeout=_TICK_S, return_when=FIRST_COMPLETED).done
                for future in done:
                    yield running.pop(future), future.result()
                if not done:
                    yield None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
