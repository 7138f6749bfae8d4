"""PLY of Gaussian splats: the centres as points, coloured by the spherical harmonic of degree 0; and the reader for any PLY.

Splats that are nearly transparent are left out and counted.  A file that pointglass wrote says in comments how its coordinates
lead back to the scan's, and their unit (viewer.commands.exporting.formats.splat_ply); coordinates of other files are kept.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ...common.text import counted
from ..column_source import Columns, Ranges
from ..source import Chunk
from .ply_source import PlySource

SH0 = 0.28209479177387814
"""Value of the spherical harmonic of degree 0: colour = 0.5 + SH0 * coefficient (Kerbl et al. 2023)."""
FAINT = 0.1
"""Opacity below which a splat is no surface and is left out.  Chosen by hand: training prunes below 0.005 only."""
_COLOURS = ("f_dc_0", "f_dc_1", "f_dc_2")
_SPLAT = (*_COLOURS, "opacity", "scale_0", "rot_0")
_RGB = ("red", "green", "blue")
_FRAME, _UNIT, _UNIT_NAME = "frame ", "metres_per_unit ", "unit "
_MOVED = 2.0**-36
"""Relative precision of float32 coordinates that were moved to map coordinates, thousands of times as large."""


def open_ply(path: Path) -> PlySource:
    """The reader for a PLY: of splats where it has their columns.  Raises InputError as PlySource does."""
    plain = PlySource(path)
    return SplatPlySource(path) if all(name in plain.types for name in _SPLAT) else plain


class SplatPlySource(PlySource):
    """One .ply file of splats.  Raises InputError as PlySource does."""

    def __init__(self, path: Path):
        super().__init__(path)
        self.format = "PLY of Gaussian splats"
        self._rgb = _RGB
        self.types |= dict.fromkeys(_RGB, "u1")
        self._to_scan = _matrix_in(self._header.comments)
        if self._to_scan is not None and self._to_scan[:, 3].any():
            self.precision = _MOVED
        if self._to_scan is not None and self.metres_per_unit is None:  # the reference system of PlySource tells it, too
            self.units, self.metres_per_unit = _unit_in(self._header.comments) or (self.units, None)
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
        if self._to_scan is not None:
            xyz = xyz @ self._to_scan[:, :3].T + self._to_scan[:, 3]
        return xyz, rgb

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


def _matrix_in(comments: tuple[str, ...]) -> np.ndarray | None:
    """(3, 4) from the file's coordinates to the scan's, where a comment has it."""
    for text in comments:
        if text.startswith(_FRAME):
            try:
                numbers = np.array([float(word) for word in text.split()[1:]])
            except ValueError:
                return None
            return numbers.reshape(3, 4) if numbers.shape == (12,) and np.isfinite(numbers).all() else None
    return None



def _unit_in(comments: tuple[str, ...]) -> tuple[str, float] | None:
    """Name and metres of the unit of the scan's coordinates, where comments have it."""
    names = [text[len(_UNIT_NAME) :] for text in comments if text.startswith(_UNIT_NAME)]
    for text in comments:
        if text.startswith(_UNIT):
            try:
                metres = float(text[len(_UNIT) :])
            except ValueError:
                return None
            return (names[0] if names else "unit", metres) if 0 < metres < np.inf else None
    return None
