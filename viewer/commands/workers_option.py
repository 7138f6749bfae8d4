"""The options ``--workers`` and ``--scheduler``: who does the independent parts of a command."""

import argparse
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...model.common.files.temporary import temporary_folder
from ..common.errors import InputError, Option
from ..common.text import whole_number
from ..common.workers.run_tasks import Workers

_CACHE = "POINTGLASS_CACHE"
MOST = 256
"""Processes of one machine; a limit for mistyped numbers."""


def add_workers(parser: argparse.ArgumentParser, tasks: str, default: str = "this process") -> None:
    """Adds both options.  tasks: what is distributed, such as "pictures".  default: who does them without the options."""
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--workers", metavar="N",
                       help=f"distribute the {tasks} over N processes of this machine; the result is the same (default: "
                            f"{default})")
    group.add_argument("--scheduler", metavar="ADDRESS",
                       help=f"distribute the {tasks} over the workers of a Dask scheduler, such as tcp://host:8786; they read "
                            "and write the same paths (needs pointglass[dask])")


def workers_of(options: argparse.Namespace) -> Workers | None:
    """What the options say; None: neither was given.  Raises InputError."""
    if options.scheduler is not None:
        return Workers(scheduler=options.scheduler)
    if options.workers is None:
        return None
    count = whole_number(options.workers)
    if not count or count > MOST:
        raise InputError(f"expected a number of processes from 1 to {MOST}", option="--workers", value=options.workers)
    return Workers(count)


@contextmanager
def own_cache(options: argparse.Namespace) -> Iterator[None]:
    """Where workers are to open a scan whose grid is not kept, the command has a cache of its own in the folder for temporary
    files, which is removed at its end.  Raises InputError where the workers are those of a scheduler, on any machine."""
    workers = workers_of(options) if getattr(options, "no_cache", False) and hasattr(options, "workers") else None
    if workers is None:
        yield
        return
    if workers.scheduler is not None:
        raise InputError("workers of a scheduler open the grid from the cache", option="--no-cache",
                         remedy=("leave it out, or ", Option("--scheduler")))
    before = os.environ.get(_CACHE)
    with temporary_folder(Path(tempfile.gettempdir()) / "pointglass-grids") as folder:
        os.environ[_CACHE], options.no_cache = str(folder), False
        try:
            yield
        finally:
            if before is None:
                del os.environ[_CACHE]
            else:
                os.environ[_CACHE] = before
