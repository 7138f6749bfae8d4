"""Scans at addresses as local paths: described (their headers), coarse (the upper levels of COPC, EPT and Potree), or whole.

A copy is compared with the server each time it is used, by length and tag; where the server does not answer, a complete copy is
used, and that is said.
"""

import contextlib
import logging
import struct
import threading
from pathlib import Path

from ...common.errors import InputError
from ..e57.e57_packets import PAGE
from ..e57.e57_stated import HEADER, description_at
from ..las.copc_nodes import read_nodes
from .address import Address, address_in
from .copy_folders import folder_of, use
from .local_copy import LocalCopy, read_state
from .octree_fetch import complete_octree, fetched_octree, local_octree, octree_at, upper_octree_levels
from .remote_object import UnreachableError
from .upper_levels import FIRST_POINTS, UpperLevels, whole_levels

_MOST_DESCRIBED = 64 << 20
"""Bytes behind the points (hierarchy, chunk table, waveforms) that are read to describe a file."""
_WHOLE_FILE = 400_000
"""Points for the picture of a file that is there completely, as of one of this machine (viewer.grid.preview)."""
_log = logging.getLogger(__name__)


def local_path(address: Address) -> Path:
    """Where the copy lies, whether it is there or not; of an octree, the file that describes it.  Nothing is read."""
    return local_octree(address) or folder_of(address) / address.name


def fetched(address: Address, said: list[str] | None = None) -> Path:
    """The whole file or octree.  said: gets a line where the server does not answer and an earlier copy is used; None: it is
    logged.  Raises InputError, one line, where it cannot be had; Cancelled."""
    label = f"fetching {address.name} from {address.host}"
    try:
        if octree := octree_at(address):
            return fetched_octree(octree, label)
        return use(address, _opened(address), lambda copy: _whole(copy, label), whole=True)
    except UnreachableError as error:
        if (path := complete_octree(address) or _complete_file(address)) is None:
            raise
        line = f"{str(error).split(' (', 1)[0]}; the copy read earlier is used"
        if said is None:
            _log.warning("%s", line)
        else:
            said.append(line)
        return path


def coarse(address: Address, points: int, before: int = 0) -> UpperLevels | None:
    """A scan of which the upper levels with at most about ``points`` points are there, of COPC, EPT and Potree; None for other
    files.  before: as for whole_levels."""
    if octree := octree_at(address):
        return upper_octree_levels(octree, points, before)

    def read(copy: LocalCopy) -> UpperLevels | None:
        described = describe(copy)
        if copy.complete:
            return UpperLevels(copy.path, max(points, _WHOLE_FILE), not before)
        if not described or (nodes := read_nodes(copy.path, described)) is None:
            return None
        chosen, held, finer = whole_levels(nodes.level, nodes.points, points, before)
        copy.fetch([(int(nodes.place[node]), int(nodes.place[node] + nodes.bytes[node])) for node in chosen])
        return UpperLevels(copy.path, held, finer)

    return use(address, _opened(address), read)


def fetch_ahead(path: Path) -> None:
    """Fetches on another thread what the first picture of a scan at an address needs, while a window opens.  Errors come again,
    and are reported, where it is used."""
    address = address_in(path)

    def work() -> None:
        with contextlib.suppress(Exception):
            if address is not None:
                coarse(address, FIRST_POINTS)

    threading.Thread(target=work, name="pointglass fetch ahead", daemon=True).start()


def described(address: Address) -> tuple[Path, float] | None:
    """A LAS, LAZ, COPC or E57 file whose header, records, table of chunks or XML are there, and the share of the file that was
    read; None for other formats, for servers that give no parts, and for files that are there completely."""

    def read(copy: LocalCopy) -> tuple[Path, float] | None:
        if copy.complete or not copy.remote.ranges or not (describe_e57(copy) or describe(copy)):
            return None
        return copy.path, copy.share

    return use(address, _opened(address), read)


def _opened(address: Address):
    return lambda home, remote: LocalCopy(home, address.name, remote)


def _whole(copy: LocalCopy, label: str) -> Path:
    copy.fetch_all(label)
    return copy.path


def _complete_file(address: Address) -> Path | None:
    path = folder_of(address) / address.name
    state = read_state(path.parent)
    return path if state is not None and state["complete"] and path.is_file() else None


def describe_e57(copy: LocalCopy) -> bool:
    """Reads what describes an E57 file, its XML.  Whether it is one of which that is a small part.  Raises InputError where the
    file ends before it."""
    with copy.path.open("rb") as file:
        found = description_at(file.read(HEADER.size))
    if found is None or found[1] - found[0] > _MOST_DESCRIBED:
        return False
    if found[1] > copy.remote.size + PAGE:
        raise InputError(f"{copy.remote.address.text}: truncated or damaged: its description would end at byte {found[1]:,} of "
                         f"{copy.remote.size:,}", remedy="copy or export it again")
    copy.fetch([found])
    return True


def describe(copy: LocalCopy) -> int:
    """Reads what describes a LAS file (header, records, table of chunks, hierarchy); the number of its points, 0 for others."""
    if not copy.remote.ranges:
        return 0
    with copy.path.open("rb") as file:
        head = file.read(375)
        if head[:4] != b"LASF" or len(head) < 227:
            return 0
        points_at, point_format = struct.unpack_from("<I", head, 96)[0], head[104]
        count = struct.unpack_from("<I", head, 107)[0]
        extended = 0
        if head[25] >= 4 and len(head) >= 255:
            extended = struct.unpack_from("<Q", head, 235)[0] if struct.unpack_from("<I", head, 243)[0] else 0
            count = struct.unpack_from("<Q", head, 247)[0] or count
        copy.fetch([(0, min(points_at + 8, copy.remote.size))])
        file.seek(points_at)
        table = struct.unpack("<q", (file.read(8) + bytes(8))[:8])[0] if point_format & 0xC0 else 0
    behind = [place for place in (table, extended) if 0 < place < copy.remote.size]
    if behind and copy.remote.size - min(behind) <= _MOST_DESCRIBED:
        copy.fetch([(min(behind), copy.remote.size)])
    return count
