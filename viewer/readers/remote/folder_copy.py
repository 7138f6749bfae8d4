"""A copy of an octree of many files at an address (Potree, EPT): its files come by need, each whole or not at all.

The copy has the names of the original, so that the readers read it as a folder of this machine.  It begins anew where the file
that describes the octree, or the first file of its hierarchy, changed on the server.
"""

import contextlib
import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from ....model.common.files.atomic_write import write_atomic
from ...common.errors import InputError
from ...common.file_names import safe_name
from ...common.progress import progress
from ..own_folder import MOST_UNPACKED
from .address import Address
from .local_copy import PIECE, SPARE, LocalCopy
from .parallel_requests import answers
from .remote_object import ChangedFileError, RemoteFolder, RemoteObject

ENTRIES = ("ept.json", "metadata.json", "cloud.js")
"""Names of the files that describe an octree, in the order in which they are looked for in a folder."""
STATE = "folder.json"
_LACKING = "the octree is not complete there: ask its owner for all files, or convert it again"


class FolderCopy:
    """entry: the copy of the file that describes the octree.  folder: that of all its files, as on the server."""

    def __init__(self, home: Path, address: Address, remote: RemoteObject):
        """home: the folder in the cache that is its own.  remote: the file that describes the octree.

        Raises InputError where it cannot be read."""
        self.address, self._remote, self._home = address, remote, home
        self.folder = home / folder_name(address)
        self.entry, self._files = self.folder / address.name, RemoteFolder(address)
        state = read_folder_state(home)
        self._state: dict[str, Any] = {"address": address.text, "name": address.name, "size": remote.size, "tag": remote.tag,
                                       "first": None, "complete": False}  # fmt: skip
        if state and all(state[key] == self._state[key] for key in ("size", "tag")) and self.entry.is_file():
            self._state = state
            return
        if remote.size > MOST_UNPACKED:
            raise InputError(f"{address.text}: {remote.size:,} bytes are too many for the description of a scan")
        self._empty()
        self._write(self.entry, remote)
        os.utime(self.entry, (remote.modified, remote.modified))  # the grid made of it is found again by it
        self._note()

    @property
    def complete(self) -> bool:
        return bool(self._state["complete"])

    def is_current(self) -> bool:
        """Whether the file that describes the octree is still the same at the address."""
        now = RemoteObject(self.address, 1)
        return (now.size, now.tag) == (self._state["size"], self._state["tag"])

    def empty(self) -> None:
        """Gives up all files but the one that describes the octree."""
        self._empty(self.entry)

    def finish(self) -> None:
        """All files are there.  Raises ChangedFileError where the octree is another one by now."""
        if not self.is_current():
            raise ChangedFileError
        self._state["complete"] = True
        self._note()
        for upper in self._home.glob("upper-*"):  # of the pictures before: see octree_parts.upper_octree
            shutil.rmtree(upper, ignore_errors=True)

    def get(self, names: Sequence[str], label: str | None = None) -> None:
        """Reads the files that are not there.  names: paths relative to the folder.  label: of the progress; None: none.

        Raises InputError, one line, where one cannot be had or the disk is full; ChangedFileError; Cancelled.
        """
        missing = [name for name in names if not (self.folder / name).is_file()]
        if not missing:
            return
        shown = progress(len(missing), label, " files") if label else contextlib.nullcontext()
        with shown as meter:
            for answer in answers(missing, self._fetch):
                if meter is not None:  # also where nothing came: a window cancels here
                    meter.update(answer is not None)

    def begins_with(self, name: str) -> None:
        """Reads the first file of the hierarchy, and begins anew where it is another one than before."""
        tag = self._files.open(name, 1, _LACKING).tag
        if self._state["first"] not in (None, tag):
            self._empty(self.entry)
            self._state["complete"] = False
        if self._state["first"] != tag:
            self._state["first"] = tag
            self._note()
        self.get([name])

    def part(self, name: str) -> LocalCopy:
        """A large file of the folder, of which blocks are read."""
        return LocalCopy(self.folder, name, self._files.open(name, PIECE // 64, _LACKING))

    def _fetch(self, name: str) -> None:
        remote = self._files.open(name, PIECE, _LACKING)
        place = self.folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        self._write(place, remote)

    def _write(self, place: Path, remote: RemoteObject) -> None:
        size = remote.size
        if size + SPARE > (free := shutil.disk_usage(self._home).free):
            raise InputError(f"{free / 1e9:,.1f} GB are free, and {size / 1e9:,.3f} GB of {place.name} are to be read",
                             file=self._home, remedy="make room, or set POINTGLASS_CACHE to a folder with more")

        def fill(path: Path) -> None:
            with path.open("wb") as file:
                for data in _all_of(remote):
                    file.write(data)

        try:
            write_atomic(place, fill)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror or error})", file=place,
                             remedy="make room, or set POINTGLASS_CACHE to another folder") from None

    def _empty(self, keep: Path | None = None) -> None:
        """Removes what is there of an earlier state of the octree."""
        for entry in [*self._home.iterdir()]:
            if entry.is_dir() and (keep is None or entry != self.folder):
                shutil.rmtree(entry, ignore_errors=True)
        if keep is not None:
            for entry in [*self.folder.iterdir()]:
                if entry.is_dir():
                    shutil.rmtree(entry, ignore_errors=True)
                elif entry != keep:
                    entry.unlink()
        self.folder.mkdir(parents=True, exist_ok=True)

    def _note(self) -> None:
        with contextlib.suppress(OSError):  # of a full disk: it is read again
            write_atomic(self._home / STATE, lambda beside: beside.write_text(json.dumps(self._state)))


def folder_name(address: Address) -> str:
    """The name of the scan: that of the folder in which the file that describes it lies."""
    return safe_name(unquote(address.place.rpartition("/")[0].rpartition("/")[2]) or address.host, "scan")


def read_folder_state(home: Path) -> dict[str, Any] | None:
    """The state of the copy in a folder of the cache; None where there is none that can be read."""
    try:
        state = json.loads((home / STATE).read_text())
        known = isinstance(state["complete"], bool) and state["tag"] and {"address", "name", "size", "first"} <= set(state)
        return state if known else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _all_of(remote: RemoteObject):
    """The bytes of a file in pieces."""
    if not remote.ranges:
        yield from remote.pieces(PIECE)
        return
    yield from [remote.head] if remote.head else []
    for first in range(len(remote.head), remote.size, PIECE):
        yield remote.read(first, min(first + PIECE, remote.size))
