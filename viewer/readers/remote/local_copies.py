"""Paths as files that can be read: an address stands for its copy in the cache folder."""

from collections.abc import Iterable
from pathlib import Path

from ...common.errors import PointglassError
from .address import address_in


def local_file(path: Path, *, fetch: bool, said: list[str] | None = None) -> Path:
    """``path``, or the copy of the address that it is.  fetch: the copy is made complete first; else nothing is read.  said: as
    for viewer.readers.remote.fetch.fetched.

    Raises InputError, one line, where the file cannot be had; Cancelled.
    """
    if (address := address_in(path)) is None:
        return path
    from ..formats import check_address
    from .fetch import fetched, local_path

    check_address(path)
    return fetched(address, said) if fetch else local_path(address)


def shown_source(path: str) -> str:
    """The address of which ``path`` is the copy, without its signature, else ``path``: for people."""
    from .folder_copy import read_folder_state
    from .local_copy import read_state

    file = Path(path)
    octree = read_folder_state(file.parent) or read_folder_state(file.parent.parent)
    if octree and octree["name"] == (file.name if file.suffix else octree["name"]):
        return str(octree["address"])
    state = read_state(file.parent) if (file.parent / "blocks").is_file() else None
    return str(state["address"]) if state and state.get("name") == file.name else path


def name_by_address(error: BaseException) -> None:
    """An error about the copy of a file at an address names the address from now on."""
    file = error.file if isinstance(error, PointglassError) else None
    if isinstance(error, PointglassError) and file is not None and "remote" in Path(file).parts:
        error.file = shown_source(str(file))
        error.args = (error.words(), *error.args[1:])


def local_files(paths: Iterable[Path], *, fetch: bool, said: list[str] | None = None) -> list[Path]:
    """The same of several."""
    return [local_file(path, fetch=fetch, said=said) for path in paths]
