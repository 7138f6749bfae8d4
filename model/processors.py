"""How many processors there are for us."""

import os


def usable_processors() -> int:
    """Those that this process may use, at least 1: fewer than the machine's in a container or under ``taskset``."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
