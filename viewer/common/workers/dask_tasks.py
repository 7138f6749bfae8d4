"""Tasks spread over the workers of a Dask scheduler, on any number of machines that share the folders of inputs and outputs.

A Dask worker gives each task to a process of ours beside it (worker_process), as many as it has threads: OpenGL belongs to the
thread that made its context, native code may end its process, and a task can then be stopped.  Where the command ends in
whatever way, the scheduler forgets its tasks; that is seen within _LOOK_S, and the process is stopped.
"""

import contextlib
import logging
import os
import platform
import secrets
import threading
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

from ....model.common.process.processors import usable_processors
from ... import __version__
from ..errors import InputError
from ..progress import Progress
from .local_tasks import MOST_DEATHS, check_deaths, heard
from .messages import Done, Said, Start, failed
from .worker_choice import Workers
from .worker_process import WorkerDied, WorkerProcess, stop_processes

_CONNECT_S = 5.0
"""Seconds until a scheduler counts as not there."""
_LOOK_S = 0.2
"""Seconds between looks at whether a task is still wanted."""
_IDLE_S = 60.0
"""Seconds that a process without a task is kept."""
_log = logging.getLogger(__name__)


def dask_results(function: bytes, tasks: Sequence[bytes], names: Sequence[str], workers: Workers, meter: Progress,
                 ahead: int | None) -> Generator[Any, None, None]:  # fmt: skip
    """As of run_tasks.  function, tasks: pickled."""
    assert workers.scheduler is not None
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("Dask is not installed here", option="--scheduler", value=workers.scheduler,
                         remedy="pip install 'pointglass[dask]', on all machines") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    lost = InputError("no Dask scheduler answers", option="--scheduler", value=workers.scheduler,
                      remedy="start one with `dask scheduler`, and give the address that it shows")
    try:
        client = Client(workers.scheduler, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError, ImportError):
        raise lost from None
    with closing(client):
        slots = _slots(client)
        start = Start(function, 0, 1, logging.getLogger("pointglass").getEffectiveLevel(), os.getcwd())
        mark, limit = secrets.token_hex(8), len(tasks) if ahead is None else ahead + 1

        def begin(number: int) -> Any:
            return client.submit(run_task, start, number, tasks[number], slots, __version__, key=f"pointglass-{mark}-{number}",
                                 pure=False)

        begun = min(limit, len(tasks))
        running = as_completed([begin(number) for number in range(begun)], loop=client.loop)
        done: dict[int, Done] = {}
        for number in range(len(tasks)):
            while number not in done:
                found, said = _result(next(running), names, lost)
                for message in said:
                    heard(message)
                done[found.number] = found
                found.result()
                meter.update(1)
            if begun < len(tasks):
                running.add(begin(begun))
                begun += 1
            yield done.pop(number).result()
        with contextlib.suppress(Exception):  # the results are there; idle processes end by themselves later
            client.run(_close_idle)


def _slots(client: Any) -> dict[str, int]:
    """Tasks that each host does at a time."""
    from distributed.comm.addressing import get_address_host

    found: Counter[str] = Counter()
    for address, worker in client.scheduler_info(n_workers=-1)["workers"].items():
        found[get_address_host(address)] += worker["nthreads"]
    if found:
        _log.info("Dask: %d tasks at a time on %d host%s", found.total(), len(found), "s" if len(found) > 1 else "")
    else:
        _log.warning("the Dask scheduler has no workers yet; waiting for one (`dask worker ADDRESS`)")
    return dict(found)


def _result(future: Any, names: Sequence[str], lost: InputError) -> tuple[Done, list[Said]]:
    """What :func:`run_task` returned.  Raises InputError where the scheduler or too many workers were lost."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker

    try:
        return future.result()
    except KilledWorker:
        check_deaths(names[int(future.key.rpartition("-")[2])], MOST_DEATHS, "with its Dask worker")
        raise
    except (CancelledError, OSError, TimeoutError):
        raise lost from None


def run_task(start: Start, number: int, task: bytes, slots: dict[str, int], version: str) -> tuple[Done, list[Said]]:
    """Runs in a Dask worker: has the task done by a process of this machine.  slots: as of _slots.  version: of the command."""
    from distributed import get_worker
    from distributed.comm.addressing import get_address_host

    if version != __version__:
        return failed(number, InputError(f"the Dask worker on {platform.node()} has pointglass {__version__}, the command "
                                         f"{version}", remedy="install one version everywhere")), []
    worker: Any = get_worker()
    count = slots.get(get_address_host(worker.address), int(worker.state.nthreads))
    start = replace(start, threads=max(1, usable_processors() // max(count, 1)), processes=max(count, 1))
    said: list[Said] = []
    for deaths in range(1, MOST_DEATHS + 1):
        with _process(start) as process, _watched(worker, process):
            try:
                return process.run(number, task, lambda message: message.progress or said.append(message)), said
            except WorkerDied as death:
                process.dead, how = True, death.how
        if not _wanted(worker):
            break
        try:
            check_deaths(f"task {number}", deaths, how)
        except InputError as error:
            return failed(number, error), said
    return Done(number), said


class _Process(WorkerProcess):
    """start: what it was started with.  dead: whether it has ended within a task."""

    def __init__(self, start: Start):
        super().__init__(start)
        self.start, self.dead = start, False


_idle: list[_Process] = []
_lock = threading.Lock()


@contextlib.contextmanager
def _process(start: Start) -> Iterator[_Process]:
    """A process for one task: an idle one that has opened the same, or a new one."""
    with _lock:
        process = next((one for one in _idle if one.start == start and one.pid is not None), None)
        others = [one for one in _idle if one.start != start]
        _idle[:] = [one for one in _idle if one is not process and one not in others]
    for other in others:
        other.close()
    process = process or _Process(start)
    try:
        yield process
    except BaseException:
        stop_processes([process])
        process.dead = True
        raise
    finally:
        if process.dead:
            process.close()
        else:
            with _lock:
                _idle.append(process)
            later = threading.Timer(_IDLE_S, _close_if_idle, [process])
            later.daemon = True
            later.start()


def _close_if_idle(process: _Process) -> None:
    """An idle process is closed; where it had a task meanwhile, this happens somewhat early."""
    with _lock:
        if process not in _idle:
            return
        _idle.remove(process)
    process.close()


def _close_idle() -> None:
    """Runs in each Dask worker at the end of a command."""
    for process in [*_idle]:
        _close_if_idle(process)


def _wanted(worker: Any) -> bool:
    """Whether the scheduler still waits for the task of this thread."""
    return _is_wanted(worker, worker.get_current_task())


def _is_wanted(worker: Any, key: str) -> bool:
    state = worker.state.tasks.get(key)
    return state is not None and state.state in ("executing", "long-running")


@contextlib.contextmanager
def _watched(worker: Any, process: _Process) -> Iterator[None]:
    """Stops the process where its task is no longer wanted."""
    key, over = worker.get_current_task(), threading.Event()

    def look() -> None:
        while not over.wait(_LOOK_S):
            if not _is_wanted(worker, key):
                stop_processes([process])
                return

    watch = threading.Thread(target=look, daemon=True)
    watch.start()
    try:
        yield
    finally:
        over.set()
        watch.join()
