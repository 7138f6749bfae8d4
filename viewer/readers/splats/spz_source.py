"""SPZ, versions 1 to 4: the centres of Gaussian splats as points, coloured by the spherical harmonic of degree 0.

Splats that are nearly transparent are left out and counted, as of a PLY of splats.  A file that pointglass wrote lies where its
scan was (viewer.readers.splats.splat_frame), with its unit.  Frame of others: the file's; by the format x is right, y up, z
back.  Their unit is unknown.  Extensions of vendors (limits of a camera) are passed over.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...common.text import counted
from ..column_source import Columns, ColumnSource
from ..ply.splat_ply_source import FAINT, SH0
from ..source import CHUNK
from .splat_frame import MOVED, OF_SPLATS, splat_frame
from .spz_stream import kept_columns, read_spz_header, spz_comment

COLOUR = 0.15
"""Colour byte / 255 = 0.5 + COLOUR * coefficient of degree 0."""


class SpzSource(ColumnSource):
    """One .spz file.  Raises InputError where its header is not valid."""

    def __init__(self, path: Path):
        super().__init__(path, f"SPZ{OF_SPLATS}")
        self._header = read_spz_header(path)
        self.count = self._header.count
        self.precision = 2.0**-12 if self._header.version == 1 else 2.0**-24
        self._frame = splat_frame(spz_comment(path))
        if self._frame is not None:
            self._frame.tell(self)
            self.precision = MOVED if self._frame.to_scan[:, 3].any() else self.precision
        axes = "" if self._frame is not None else "; y is up in this format"
        self._warn(f"{path.name}: Gaussian splats, shown as points at their centres with their base colours{axes}")
        self.record_losses.append(f"{path.name}: opacities, sizes and directions of its splats are left out")

    def precision_within(self, bounds: np.ndarray) -> float:
        """See Source: coordinates are whole numbers of 2**-bits, those of version 1 half-precision floats."""
        largest = float(np.abs(bounds).max())
        if self._header.version == 1 or largest == 0:
            return self.precision
        step = 2.0**-self._header.bits * (1.0 if self._frame is None else float(np.linalg.norm(self._frame.to_scan[:, 0])))
        return 0.5 * step / largest

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        header, faint = self._header, 0
        position, opacity, colour = kept_columns(self.path, header)
        for start in range(0, header.count, CHUNK):
            stop = min(start + CHUNK, header.count)
            places = np.frombuffer(position, np.uint8).reshape(header.count, -1)[start:stop]
            kept = np.frombuffer(opacity, np.uint8)[start:stop] >= FAINT * 255
            faint += int(len(kept) - kept.sum())
            xyz = _coordinates(places[kept], header.bits)
            xyz = xyz if self._frame is None else self._frame.placed(xyz)
            codes = np.frombuffer(colour, np.uint8).reshape(-1, 3)[start:stop][kept]
            rgb = _LEVELS[codes]
            yield 0, dict(zip("xyz", xyz.T)) | dict(zip("rgb", rgb.T))
        if faint:
            self._warn(f"{self.path.name}: {counted(faint, 'splat')} of opacity below {FAINT} left out")


def _coordinates(packed: np.ndarray, bits: int) -> np.ndarray:
    """(n, 3) float64 of three numbers of two bytes (half-precision floats) or of three (whole numbers of 2**-bits)."""
    if packed.shape[1] == 6:
        with np.errstate(invalid="ignore"):
            return np.ascontiguousarray(packed).view("<f2").astype(np.float64)
    words = np.zeros((len(packed), 3, 4), np.uint8)
    words[:, :, 1:] = packed.reshape(-1, 3, 3)
    return (words.view("<i4")[..., 0] >> 8) * 2.0**-bits  # the shift keeps the sign


_LEVELS = np.rint(np.clip(0.5 + SH0 * (np.arange(256) / 255 - 0.5) / COLOUR, 0, 1) * 255).astype(np.uint8)
"""Colour byte of the file -> sRGB."""
