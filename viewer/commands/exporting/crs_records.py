"""The coordinate reference system of an export: taken from the files, or what a person assigned, in the form of each format.

LAS holds WKT or GeoTIFF keys in variable-length records, E57 a text in ``coordinateMetadata``, PLY a comment.
"""

import logging
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...readers import crs
from ...readers.e57.e57_source import E57Source
from ...readers.las.las_source import LasSource
from ...work.reference import wkt_of
from .formats.las_layout import PROJECTION, read_layout
from .losses import Losses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...preprocess.scan_description import ScanDescription
    from ...readers.source import Source

_WKT, _KEYS = 2112, 34735
"""Record numbers of LASF_Projection."""
_PROJECTED, _GEOGRAPHIC, _VERTICAL = 3072, 2048, 4096
"""GeoTIFF keys that hold EPSG codes."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Reference:
    """wkt: of the system; None where none is known, or it has no WKT.  las_records: (number, data) of the LASF_Projection
    records that state it.  records_from: the LAS file that has these records already."""

    wkt: str | None = None
    las_records: tuple[tuple[int, bytes], ...] = ()
    records_from: Path | None = None


def reference_of(meta: "ScanDescription", sources: "Sequence[Source]", losses: Losses) -> Reference:
    """The system of these sources.  meta: of the scene.  Where they state different ones, none, which ``losses`` names."""
    if (assigned := wkt_of(meta)) is not None:
        return _from_wkt(assigned)
    stated = {source.crs: source for source in reversed(sources) if source.crs}
    if len(stated) > 1:
        named = ", ".join(f"{name} in {source.path.name}" for name, source in list(stated.items())[:4])
        losses.add(f"the files have different coordinate reference systems ({named}), so the export states none")
        return Reference()
    if not stated:
        # a LAS file may have records that are not understood here; they are copied with it
        only = sources[0] if len(sources) == 1 and isinstance(sources[0], LasSource) else None
        return Reference() if only is None else _of_las(only.path, None)
    name, source = next(iter(stated.items()))
    if any(not other.crs for other in sources):
        missing = next(other.path.name for other in sources if not other.crs)
        losses.add(f"{missing} states no coordinate reference system; the export states that of {source.path.name}")
    if isinstance(source, LasSource):
        return _of_las(source.path, name)
    text = coordinate_metadata(source.path) if isinstance(source, E57Source) else getattr(source, "crs_text", None)
    found = _from_text(text or name or "")
    if found.wkt is None:
        losses.add(f"the coordinate reference system {name} has no definition that can be written")
    return found


def without_sources(meta: "ScanDescription") -> Reference:
    """The system of a grid whose files are gone."""
    return _from_wkt(wkt) if (wkt := wkt_of(meta)) is not None else _from_text(meta.crs or "")


def coordinate_metadata(path: Path) -> str:
    """The text in which an E57 states its system, "" where it has none."""
    from ...readers.e57.e57_nodes import open_e57, text_of

    with open_e57(path) as file:
        return text_of(file.root(), "coordinateMetadata")


def _of_las(path: Path, name: str | None) -> Reference:
    layout = read_layout(path)
    records = tuple((record.number, record.data) for record in layout.vlrs if record.user == PROJECTION)
    wkt = next((data for number, data in records if number == _WKT), None)
    text = None if wkt is None else wkt.split(b"\0")[0].decode("utf-8", "replace")
    if not text:
        text = next((_extended_text(path, record) for record in layout.evlrs if record.key == (PROJECTION, _WKT)), None)
        if text:
            records = (*records, (_WKT, text.encode() + b"\0"))
    if not text:
        text = _wkt_of_keys(next((data for number, data in records if number == _KEYS), b"")) or _from_text(name or "").wkt
    return Reference(text or None, records, path)


def _extended_text(path: Path, record) -> str:
    with path.open("rb") as file:
        file.seek(record.place + len(record.raw))
        return file.read(record.length - len(record.raw)).split(b"\0")[0].decode("utf-8", "replace")


def _wkt_of_keys(data: bytes) -> str | None:
    """WKT of GeoTIFF keys that are EPSG codes."""
    keys = {key: value for key, place, _, value in struct.iter_unpack("<4H", data[8 : len(data) // 8 * 8]) if place == 0}
    code = next((keys[key] for key in (_PROJECTED, _GEOGRAPHIC) if 1024 <= keys.get(key, 0) < 32767), None)
    if code is None:
        return None
    vertical = keys.get(_VERTICAL, 0)
    both = _from_text(f"EPSG:{code}+{vertical}").wkt if 1024 <= vertical < 32767 else None
    return both or _from_text(f"EPSG:{code}").wkt


def _from_text(text: str) -> Reference:
    """Reads WKT, an EPSG code or a PROJ string."""
    text = text.strip("\0 \n\r\t")
    if crs.from_wkt(text)[0] is not None:
        return _from_wkt(text)
    try:
        return _from_wkt(crs.wkt_of_definition(text)) if text else Reference()
    except (ImportError, ValueError) as error:
        _log.info("%s is not written: %s", text[:80], error)
        return Reference()


def _from_wkt(wkt: str) -> Reference:
    data = wkt.encode("utf-8") + b"\0"
    return Reference(wkt, ((_WKT, data),) if len(data) <= 65535 else ())
