"""What belongs to the files of an export besides their points, where these go through columns: what is kept, what is named.

LAS to LAS keeps variable-length records; photographs, poses and groups of E57, waveforms and records of other kinds have no
place in other formats.
"""

from typing import Any

from ...common.text import counted
from ...readers.e57.e57_nodes import library, open_e57
from ...readers.e57.e57_records import fields_of
from ...readers.e57.e57_source import E57Source
from ...readers.las.las_source import LasSource
from ...readers.source import Source
from .formats.las_layout import EXTRA_BYTES, LASZIP, PROJECTION, WAVEFORM_PACKETS, LasLayout, Record, read_layout, vlr
from .losses import Losses
from .target import Target

_COPC = (("copc", 1), ("copc", 1000))
_OF_POINTS = {LASZIP, EXTRA_BYTES, WAVEFORM_PACKETS, *_COPC}
"""Records that describe how points are stored."""
_SYSTEM = (PROJECTION, "liblas")
"""Users of records of the reference system; libLAS wrote it twice."""
_WAVEFORM_KINDS = range(100, 355)
"""Numbers of LASF_Spec records that describe waveforms."""
_LARGEST = 65535
"""Bytes of a variable-length record."""
_MOST_NAMED = 6
"""Records that a sentence names."""


def name_left_behind(sources: list[Source], target: Target, losses: Losses) -> None:
    """Names what the sources have and a file of a format, written from columns, has not.  LAS records: kept_records."""
    layouts = [read_layout(source.path) for source in sources if isinstance(source, LasSource)]
    if any(layout.waveforms for layout in layouts):
        losses.add("waveforms are left out")
    if not target.las:
        _name_records([record for layout in layouts for record in _further(layout)], "are left out", losses)
    photographs, texts, groups, poses = 0, dict[str, None](), False, 0
    for source in sources:
        if isinstance(source, E57Source):
            with open_e57(source.path) as file:
                root = file.root()
                photographs += root["images2D"].childCount() if root.isDefined("images2D") else 0
                for scan in _children(root, "data3D"):
                    groups |= scan.isDefined("pointGroupingSchemes")
                    poses += scan.isDefined("pose")
                    if scan.isDefined("points"):
                        texts |= dict.fromkeys(fields_of(library().StructureNode(scan["points"].prototype()))[1])
    if photographs:
        losses.add(omitted(photographs, "photograph"))
    if groups:
        losses.add("groups of E57 records (pointGroupingSchemes) are left out")
    name_texts(texts, losses)
    stations = sum(scan.position is not None for source in sources for scan in source.scans)
    if not target.poses and (stations or poses):
        losses.add(omitted(max(stations, poses), "scanner position") + f", for which {target.name} has no field")


def omitted(number: int, what: str, more: str = "") -> str:
    """``3 photographs are left out``.  more: words behind ``what``."""
    return f"{counted(number, what)}{more} {'is' if number == 1 else 'are'} left out"


def name_texts(names: Any, losses: Losses) -> None:
    """names: of E57 text fields beside points."""
    if names:
        shown = ", ".join(dict.fromkeys(names))
        losses.add(f"the text fields {shown} of records are left out, since libe57's binding does not read them")


def kept_records(sources: list[Source], losses: Losses) -> list[Record]:
    """Variable-length records of LAS files that are written into one LAS file of another layout: all whose user and number do
    not collide, besides the reference system and those that describe how points are stored.  Names the others."""
    kept: dict[tuple[str, int], Record] = {}
    colliding, large = list[Record](), list[Record]()
    for source in sources:
        if not isinstance(source, LasSource):
            continue
        layout = read_layout(source.path)
        if any(record.key in _COPC for record in (*layout.vlrs, *layout.evlrs)):
            losses.add("the octree of COPC is not copied, all its points are")
        for record in _further(layout):
            data = _data(layout, record)
            if data is None:
                large.append(record)
            elif (other := kept.get(record.key)) is None:
                kept[record.key] = vlr(record.user, record.number, data, record.description)
            elif other.data != data:
                colliding.append(record)
    _name_records(colliding, "of later files differ from those of the first and are left out", losses)
    _name_records(large, "are larger than 65535 bytes and left out", losses)
    return list(kept.values())


def _further(layout: LasLayout) -> list[Record]:
    """Records besides the reference system and those that describe how points are stored."""
    found = (*layout.vlrs, *layout.evlrs)
    return [record for record in found if record.key not in _OF_POINTS and record.user not in _SYSTEM
            and not (record.user == "LASF_Spec" and record.number in _WAVEFORM_KINDS)]  # fmt: skip


def _data(layout: LasLayout, record: Record) -> bytes | None:
    """The content of a record; None where it does not fit one that is not extended."""
    if not record.length:
        return record.data
    if record.length - len(record.raw) > _LARGEST:
        return None
    with layout.path.open("rb") as file:
        file.seek(record.place + len(record.raw))
        return file.read(record.length - len(record.raw))


def _name_records(records: list[Record], what: str, losses: Losses) -> None:
    if records:
        names = list(dict.fromkeys(f"{record.user or 'without a user'} {record.number}" for record in records))
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        losses.add(f"the variable-length records {', '.join(names[:_MOST_NAMED])}{more} {what}")


def _children(root: Any, name: str) -> list[Any]:
    return [root[name][index] for index in range(root[name].childCount())] if root.isDefined(name) else []
