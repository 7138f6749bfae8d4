"""The columns of a grid that have a row for each point, while the grid is built: in memory, or mapped from their files.

Points are placed at random within a column.  In memory that takes half of the time, since a new page of a mapped file is read
from the disk first; the columns of a small grid are therefore made in memory and written at the end.  Large ones are mapped:
the system writes their pages back, and memory stays bounded.
"""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .scratch_folder import reserve

MEMORY = 288 << 20
"""Bytes of columns in memory, at most: those of 18 million points; with them converting takes 0.9 GB."""

PIECE = 64 << 10
"""Bytes that are written at once.  Linux keeps in one piece what it is given in one, and counts all of it as the memory of a
process that maps a part: with whole columns at once, reading values of 1.5 million points took 14 MB more."""


class ColumnFiles:
    """folder: of the files.  types: of the arrays, by name."""

    def __init__(self, folder: Path, types: Mapping[str, np.dtype]):
        self._folder, self._types, self._held = folder, types, 0
        self._made: list[tuple[Path, np.memmap, np.ndarray]] = []

    def allocate(self, name: str, shape: tuple[int, ...], _: type) -> np.ndarray:
        """See viewer.grid.building.two_passes.Allocate.  The disk has room for what is returned.  Raises OSError."""
        file = self._folder / f"{name}.npy"
        column = np.lib.format.open_memmap(file, "w+", self._types[name], shape)
        with file.open("r+b") as opened:
            reserve(opened.fileno(), file.stat().st_size, self._folder)
        array = column
        if self._held + column.nbytes <= MEMORY:
            self._held += column.nbytes
            array = np.empty(shape, column.dtype)
        self._made.append((file, column, array))
        return array

    def write(self) -> None:
        """Writes what is not on the disk yet; the arrays that were returned are of no further use.  Raises OSError."""
        made, self._made = self._made, []
        for file, column, array in made:
            if array is column:
                column.flush()
                continue
            data = array.reshape(-1).view(np.uint8)
            with file.open("r+b", buffering=PIECE) as opened:
                opened.seek(column.offset)
                for start in range(0, len(data), PIECE):
                    opened.write(data[start : start + PIECE].data)
                opened.flush()
                os.fsync(opened.fileno())
