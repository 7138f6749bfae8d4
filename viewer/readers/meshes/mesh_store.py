"""The meshes that this process has read: each file once, as long as it stays as it is."""

import os
import threading
from collections import OrderedDict
from pathlib import Path

from ...common.errors import InputError
from .mesh_data import MeshData
from .mesh_file import read_mesh

_MOST_KEPT = 4 << 30
"""Bytes of meshes that stay in memory when no picture shows them; the one that was used last stays always."""
_kept: "OrderedDict[tuple, MeshData]" = OrderedDict()
_lock = threading.Lock()


def _key(path: str) -> tuple:
    try:
        status = os.stat(path)
    except (OSError, ValueError) as error:
        raise InputError(f"this mesh is not there ({getattr(error, 'strerror', None) or error})", file=path,
                         remedy="move it back, or remove it from the project") from None
    return os.path.realpath(path), status.st_size, status.st_mtime_ns


def kept_mesh(path: str) -> MeshData | None:
    """The mesh of a file where it is in memory; None elsewhere, and where the file is gone or another one."""
    try:
        key = _key(path)
    except InputError:
        return None
    with _lock:
        found = _kept.get(key)
        if found is not None:
            _kept.move_to_end(key)
        return found


def mesh_of(path: str) -> MeshData:
    """The mesh of a file, read where it is not in memory.  On any thread.  Raises InputError, one line."""
    key = _key(path)
    if (found := kept_mesh(path)) is not None:
        return found
    made = read_mesh(Path(path))
    with _lock:
        _kept[key] = made
        while len(_kept) > 1 and sum(each.nbytes for each in _kept.values()) > _MOST_KEPT:
            _kept.popitem(last=False)
    return made
