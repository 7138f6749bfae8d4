"""Octrees of many files at addresses (Potree, EPT), found by the file that describes them or by their folder: as described,
coarse, or whole."""

import contextlib
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ...common.errors import InputError
from .address import Address
from .copy_folders import folder_of, make_room, use
from .folder_copy import ENTRIES, STATE, FolderCopy, folder_name, read_folder_state
from .remote_object import RemoteObject, UnreachableError
from .upper_levels import UpperLevels, whole_levels

if TYPE_CHECKING:
    from collections.abc import Callable

    from .octree_parts import OctreeParts

_DESCRIBING = (".json", ".js")
Result = TypeVar("Result")


def octree_at(address: Address) -> Address | None:
    """The address of the file that describes an octree: the given one, or in the folder that it is; None where it is the
    address of another file.  Asks the server where the name does not tell.  Raises InputError where it does not answer."""
    suffix = PurePosixPath(address.name).suffix.lower()
    if suffix in _DESCRIBING:
        return address
    from ..formats import FORMATS

    if any(suffix in row.suffixes for row in FORMATS):
        return None
    if known := _known(address):
        return known
    for candidate in _candidates(address):
        try:
            RemoteObject(candidate, 1)
            return candidate
        except UnreachableError:
            raise
        except InputError:  # not there, or, of a bucket that hides what it has, not allowed
            continue
    return None


def local_octree(address: Address) -> Path | None:
    """Where the copy of the describing file of an octree lies, there or not; None for other files.  Nothing is read."""
    entry = address if PurePosixPath(address.name).suffix.lower() in _DESCRIBING else _known(address)
    return None if entry is None else folder_of(entry) / folder_name(entry) / entry.name


def complete_octree(address: Address) -> Path | None:
    """As :func:`local_octree`, where all files are there."""
    path = local_octree(address)
    state = read_folder_state(path.parent.parent) if path else None
    return path if path is not None and state is not None and state["complete"] and path.is_file() else None


def fetched_octree(address: Address, label: str) -> Path:
    """All files of the octree that the file at an address describes.  label: of the progress."""

    def read(copy: FolderCopy, parts: "OctreeParts") -> Path:
        if not copy.complete:
            make_room(address, parts.size)
            parts.fetch(copy, np.arange(len(parts.levels)), label)
            copy.finish()
        return copy.entry

    return _used(address, read)


def upper_octree_levels(address: Address, points: int, before: int) -> UpperLevels:
    """The upper levels of an octree, with at most about ``points`` points.  before: as for whole_levels."""
    from .octree_parts import upper_octree

    def read(copy: FolderCopy, parts: "OctreeParts") -> UpperLevels:
        nodes, held, finer = whole_levels(parts.levels, parts.points, points, before)
        parts.fetch(copy, nodes)
        return UpperLevels(upper_octree(copy, parts, nodes), held, finer)

    return _used(address, read)


def octree_parts(address: Address) -> "tuple[FolderCopy, OctreeParts]":
    """The copy of an octree, and what its hierarchy says of all nodes."""
    return _used(address, lambda copy, parts: (copy, parts))


def described_octree(address: Address) -> tuple[Path, "OctreeParts"]:
    """The describing file of the octree's root node, and what its hierarchy says of all nodes."""
    from .octree_parts import upper_octree

    def read(copy: FolderCopy, parts: "OctreeParts") -> "tuple[Path, OctreeParts]":
        nodes = np.flatnonzero(parts.levels == parts.levels.min())
        parts.fetch(copy, nodes)
        return upper_octree(copy, parts, nodes), parts

    return _used(address, read)


def _used(address: Address, work: "Callable[[FolderCopy, OctreeParts], Result]") -> Result:
    from .octree_parts import parts_of

    def read(copy: FolderCopy) -> Result:
        parts = parts_of(copy)
        if not len(parts.levels):
            raise InputError(f"{address.text}: holds no points", remedy="convert the scan again")
        return work(copy, parts)

    return use(address, lambda home, remote: FolderCopy(home, address, remote), read)


def _candidates(address: Address) -> list[Address]:
    return [replace(address, place=f"{address.place}/{name}") for name in ENTRIES]


def _known(address: Address) -> Address | None:
    """The describing file in the folder that an address is, as far as a copy of it was begun."""
    with contextlib.suppress(OSError):
        return next((entry for entry in _candidates(address) if (folder_of(entry) / STATE).is_file()), None)
    return None
