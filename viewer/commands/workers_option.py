"""The options ``--workers`` and ``--scheduler``: who does the independent parts of a command."""

import argparse

from ..common.errors import InputError, Option
from ..common.text import whole_number
from ..common.workers.run_tasks import Workers

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


def check_cached(options: argparse.Namespace, workers: Workers | None) -> None:
    """Raises InputError where workers are to open a scan whose grid is not kept."""
    if workers is not None and options.no_cache:
        raise InputError("workers open the grid from the cache", option="--no-cache",
                         remedy=("leave it out, or ", Option("--workers" if workers.scheduler is None else "--scheduler")))

