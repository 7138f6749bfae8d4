"""PLY of Gaussian splats: the centres as points, coloured by the spherical harmonic of degree 0; and the reader for any PLY.

Splats that are nearly transparent are left out and counted.  A file that pointglass wrote says in comments how its coordinates
lead back to the scan's, their unit and reference system (viewer.commands.exporting.formats.splat_ply); its records are without
the shapes of the splats, which are not in the scan's coordinates.  Coordinates of other files are kept.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...common.text import counted
from ..column_source import Columns, Ranges
from ..source import Chunk, Records
from ..splats.splat_frame import MOVED, OF_SPLATS, SplatFrame, splat_frame
from .ply_source import PlySource

SH0 = 0.28209479177387814
"""Value of the spherical harmonic of degree 0: colour = 0.5 + SH0 * coefficient (Kerbl et al. 2023)."""
FAINT = 0.1
"""Opacity below which a splat is no surface and is left out: seven of them behind each other hide half of
what is behind them.  Training prunes below 0.005 only."""
_COLOURS = ("f_dc_0", "f_dc_1", "f_dc_2")
_SPLAT = (*_COLOURS, "opacity", "scale_0", "rot_0")
_RGB = ("red", "green", "blue")
_SHAPES = ("nx", "ny", "nz", "f_rest_", "scale_", "rot_")
"""Begin the names of columns that are of the file's axes and unit."""


def open_ply(path: Path) -> PlySource:
    """The reader for a PLY: of splats where it has their columns.  Raises InputError as PlySource does."""
    plain = PlySource(path)
    return SplatPlySource(path) if all(name in plain.types for name in _SPLAT) else plain


class SplatPlySource(PlySource):
    """One .ply file of splats.  Raises InputError as PlySource does."""

    def __init__(self, path: Path):
        super().__init__(path)
        self.format = f"PLY{OF_SPLATS}"
        self._rgb = _RGB
        self.types |= dict.fromkeys(_RGB, "u1")
        self._frame = _frame_in(self._header.comments)
        if self._frame is not None:
            self._frame.tell(self)
            self.precision = MOVED if self._frame.to_scan[:, 3].any() else self.precision
            counts = any(element.name == "provenance" for element in self._header.elements)
            self.record_losses.append(f"{path.name}: normals, sizes and directions of its splats, which are in the file's "
                                      f"axes, {'and the number of points of each ' if counts else ''}are left out")
        self._faint = 0
        self.warnings.append(f"{path.name}: Gaussian splats, shown as points at their centres with their base colours")

    def chunks(self) -> Iterator[Chunk]:
        """Yields the centres of the splats that are not nearly transparent."""
        self._faint = 0
        yield from super().chunks()
        if self._faint:
            text = f"{self.path.name}: {counted(self._faint, 'splat')} of opacity below {FAINT} left out"
            if text not in self.warnings:
                self.warnings.append(text)

    @property
    def _seekable(self) -> bool:
        return False  # splats are left out: a running number is no row

    def _placed(self, columns: Columns, ranges: Callable[[], Ranges]) -> tuple[np.ndarray, np.ndarray | None]:
        xyz, rgb = super()._placed(columns, ranges)
        return xyz if self._frame is None else self._frame.placed(xyz), rgb

    def _record(self, found: Columns) -> Records:
        record = super()._record(found)
        if self._frame is None:
            return record
        columns = {name: values for name, values in record.columns.items() if not name.startswith(_SHAPES)}
        return replace(record, columns=columns)

    def _columns(self) -> Iterator[Columns]:
        for columns in super()._columns():
            yield self._shown(columns)

    def _sampled_binary(self, points: int, run: int) -> Iterator[Columns]:
        return map(self._shown, super()._sampled_binary(points, run))

    def _sampled_text(self, points: int, run: int) -> Iterator[Columns]:
        return map(self._shown, super()._sampled_text(points, run))

    def _shown(self, columns: Columns) -> Columns:
        """The columns of the splats that are shown, and their colours as 8 bits."""
        with np.errstate(over="ignore", invalid="ignore"):
            opacity = 1 / (1 + np.exp(-columns["opacity"].astype(np.float64)))
            kept = ~(opacity < FAINT)
            self._faint += int(len(kept) - kept.sum())
            found = {name: values[kept] for name, values in columns.items()}
            for name, given in zip(_RGB, _COLOURS):
                level = np.nan_to_num((0.5 + SH0 * found[given].astype(np.float64)) * 255)
                found[name] = np.clip(np.rint(level), 0, 255).astype(np.uint8)
        return found


def _frame_in(comments: tuple[str, ...]) -> SplatFrame | None:
    """The way to the scan, where comments have it as the export writes it."""
    stated: dict[str, Any] = {}
    for text in comments:
        name, _, value = text.partition(" ")
        stated.setdefault(name, value)
    try:
        stated["to_scan"] = np.array([float(word) for word in stated.pop("frame", "").split()]).reshape(3, 4)
    except ValueError:
        return None
    return splat_frame(stated)
