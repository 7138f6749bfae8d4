"""The path that a person typed or pasted: what it means, what it is, and why it cannot be read or written."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlparse

from ....model.common.system import locked
from ...common.errors import InputError
from ...readers.formats import check_address, refuse_address
from ...readers.remote.address import address_in
from .folder_list import words

LONGEST_NAME = 255
"""Bytes of a file's name on the usual file systems."""
_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)


@dataclass(frozen=True)
class Examined:
    """What a chosen path is.  problem: why it cannot be chosen, in words, "" where it can.  address: of a scan elsewhere,
    which was not asked for."""

    path: Path
    folder: bool = False
    exists: bool = False
    problem: str = ""
    address: bool = False


def examine(path: Path, saving: bool, addresses: bool = False) -> Examined:
    """Looks at a path on the disk; on a thread, because a disk may not answer.  addresses: whether those of scans count."""
    if "\0" in path.name:
        return Examined(path, problem="a name cannot hold a null character")
    try:
        if len(os.fsencode(path.name)) > LONGEST_NAME:
            return Examined(path, problem=f"the name is longer than {LONGEST_NAME} bytes; choose a shorter one")
        if path.is_dir():
            return Examined(path, folder=True, exists=True)
        if path.exists() or path.is_symlink():
            may = os.access(path, os.W_OK if saving else os.R_OK)
            why = "" if may else f"{path}: you do not have permission to {'replace' if saving else 'read'} it"
            if saving and _reserved(path):
                why = f"{path}: a window is writing this file; choose another name"
            return Examined(path, exists=True, problem=why)
        if not saving:
            return _not_here(path, addresses)
        if not path.parent.is_dir():
            return Examined(path, problem=f"{path.parent}: there is no such folder")
        if not os.access(path.parent, os.W_OK):
            return Examined(path, problem=f"{path.parent}: you do not have permission to write into it")
        return Examined(path)
    except (OSError, ValueError) as error:
        return Examined(path, problem=f"{path}: {words(error) if isinstance(error, OSError) else error}")


def _not_here(path: Path, addresses: bool) -> Examined:
    """Of an address the server is not asked: whoever opens it says what is wrong with it."""
    try:
        (check_address if addresses else refuse_address)(path)
    except InputError as error:
        return Examined(path, problem=str(error))
    if addresses and address_in(path) is not None:
        return Examined(path, address=True)
    return Examined(path, problem=f"{path}: it does not exist")


def with_ending(path: Path, chosen: Sequence[str], known: Sequence[str]) -> Path:
    """The path with the first ending of the ``chosen`` kind of file, where its name has none of the ``known`` ones, or only
    the last part of that one: of the kind .splats.ply, x.ply is x.splats.ply."""
    if "" in chosen or not chosen:
        return path
    name, last = path.name.lower(), path.suffix.lower()
    if not name.endswith(tuple(known)):
        return path.with_name(path.name + chosen[0])
    partly = last and chosen[0] != last and chosen[0].endswith(last) and not name.endswith(tuple(chosen))
    return path.with_name(path.stem + chosen[0]) if partly else path


def _reserved(path: Path) -> bool:
    """Whether a window has reserved this name, and writes its file (model.common.files.temporary).  Raises OSError."""
    if not path.is_file() or path.stat().st_size:
        return False
    try:
        held = locked(path)
    except BlockingIOError:
        return True
    except OSError:  # it cannot be opened, or is a link
        return False
    if held is not None:
        os.close(held)
    return False


def pasted(text: str) -> str:
    """A path as people paste it: quotation marks and ``file://`` are taken off, spaces around it as well."""
    text = text.strip()
    if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
        text = text[1:-1]
    if text.startswith("file://"):
        text = unquote(urlparse(text).path)
    return text


def is_address_text(text: str) -> bool:
    """Whether a text begins as an address does: no folder of this machine is listed of it."""
    return _ADDRESS.match(text) is not None


def path_of(text: str, folder: Path) -> Path:
    """What a typed text means: an address, a path, or a name in ``folder``, which itself is meant by nothing."""
    text = os.path.expanduser(pasted(text))
    if is_address_text(text):
        return Path(text)
    return Path(os.path.normpath(folder / text)) if text else folder


def names_folder(text: str) -> bool:
    """Whether a text can mean a folder only: ``.`` or ``..``, alone or at its end, or a home folder."""
    return os.path.basename(text) in (".", "..") or (os.sep not in text and os.path.expanduser(text) != text)
