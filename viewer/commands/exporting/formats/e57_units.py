"""The unit of an E57 that is written: metres by the standard, or that of the reference system which the file stores.

Coordinates keep their values where the stored system states their unit, so that nothing is rounded; readers that know the
system, this program among them, take the unit from it.  Where no system can be stored they become metres.
"""

from collections.abc import Iterator
from dataclasses import replace

from ....preprocess.scan_description import ScanDescription
from ....readers import crs
from ....readers.source import ScanInfo
from ..columns import Piece, Stream
from ..crs_records import Reference
from ..losses import Losses

_SAME = 1e-7
"""Relative; feet of two kinds differ by 2e-6."""


def to_metres(meta: ScanDescription, reference: Reference) -> float | None:
    """What coordinates are multiplied with to be metres, because no stored system states their unit; None where they are kept.
    meta: of the scene.  reference: what the E57 states."""
    metres = meta.metres_per_unit
    stated = crs.from_wkt(reference.wkt or "")[2]
    if not metres or _same(metres, 1.0) or (stated and _same(metres, stated)):
        return None
    return metres


def tell_unit(meta: ScanDescription, reference: Reference, losses: Losses) -> None:
    """Says in which unit other than metre coordinates are written.  meta, reference: as for :func:`to_metres`."""
    if to_metres(meta, reference) is not None:
        losses.add(f"E57 counts in metres: coordinates are converted from {meta.units}, since no reference system can be "
                   "stored that states it")  # fmt: skip
        return
    _, unit, metres = crs.from_wkt(reference.wkt or "")
    if unit == "degree" or (metres and not _same(metres, 1.0)):
        losses.add(f"E57 counts in metres: coordinates stay in {unit}, as the stored reference system says")
    elif meta.in_degrees:
        losses.add("E57 counts in metres: coordinates stay in degree, and no reference system says so")


def _same(a: float, b: float) -> bool:
    return abs(a / b - 1) < _SAME


class Metres:
    """A stream whose coordinates and positions are multiplied by ``factor``; directions and other columns are as they are."""

    def __init__(self, stream: Stream, factor: float):
        self._stream, self._factor = stream, factor

    def pieces(self, label: str) -> Iterator[Piece]:
        for piece in self._stream.pieces(label):
            yield replace(piece, xyz=piece.xyz * self._factor)

    def scan_info(self) -> list[ScanInfo]:
        """See Stream."""
        return [replace(info, position=self._scaled(info.position)) for info in self._stream.scan_info()]

    def _scaled(self, place: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
        return None if place is None else (place[0] * self._factor, place[1] * self._factor, place[2] * self._factor)
