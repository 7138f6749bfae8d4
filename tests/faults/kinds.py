"""The kinds of faults by name: ``interrupt/export-laz``, ``disk/convert``, and so on."""

import random
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from . import interrupts, limits, saves
from .product import Product

Cases = Callable[[Product, Path, random.Random], Iterator[str]]
"""Yields "" for each case that was as promised, else what was wrong; without an end."""


def _named(cases: Callable[[Product, Path, str, random.Random], Iterator[str]], name: str) -> Cases:
    def run(product: Product, work: Path, rng: random.Random) -> Iterator[str]:
        work.mkdir(parents=True, exist_ok=True)
        return cases(product, work, name, rng)

    return partial(run)


KINDS: dict[str, Cases] = {
    **{f"interrupt/{name}": _named(interrupts.interrupts, name) for name in interrupts.COMMANDS},
    **{f"kill/{name}": _named(interrupts.kills, name) for name in interrupts.KILLED},
    **{f"save/{name}": _named(saves.killed_saves, name) for name in ("autosave", "project")},
    **{f"disk/{name}": _named(limits.full_disk, name) for name in limits.DISK},
    "disk/log": _named(limits.full_log, "log"),
    **{
        f"memory/{name}": _named(limits.little_memory, name)
        for name in ("info", "convert", "export-laz", "export-e57", "render")
    },
    **{f"pipe/{name}": _named(limits.closed_pipe, name) for name in ("info", "help", "doctor", "export")},
    **{f"two/{name}": _named(limits.two_processes, name) for name in ("cache", "convert")},
    **{f"read-only/{name}": _named(limits.read_only, name) for name in limits.DISK},
}
MOUNTS = {kind for kind in KINDS if kind.startswith(("disk/", "read-only/"))}
"""Kinds that need a file system of their own."""


def skipped() -> str:
    """Why MOUNTS cannot run here, "" where they can."""
    return "" if limits.can_mount() else "mounting a tmpfs is not allowed here"
