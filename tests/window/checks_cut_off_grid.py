"""Checks of a grid that another program truncates, for ``drive_unfinished.py``: while the camera flies, and at any read of its
start.  A memory map would end the process there (SIGBUS)."""

import os
import shutil
from pathlib import Path
from unittest.mock import patch

from drive_dialogs import Person, write_ply
from driver import middle
from x_keyboard import xdo

from pointglass.viewer.commands.convert import convert
from pointglass.viewer.grid.npy_column import NpyColumn

LEFT = 5000
"""Bytes that are left of the points: the first of the coarsest layer."""


def check_a_grid_that_is_cut_off_while_the_camera_flies_is_a_message(p: Person, folder: Path) -> None:
    notices, grid = p.d.session.notices, folder / "flown"
    convert([write_ply(folder / "whole.ply", points=100_000)], grid)
    p.d.drop(grid)
    p.opened("whole.ply")
    xdo("mousemove", *map(round, middle(p.d)))
    p.d.rest()
    xdo("keydown", "s")
    p.d.until(lambda: p.d.session.flight.moving)
    os.truncate(grid / "points.npy", LEFT)
    p.d.settle(5)
    xdo("keyup", "s")
    told = f"{grid / 'points.npy'}: was truncated while it was open; open the scan again, which builds its grid anew"
    p.d.until(lambda: notices.message is not None)  # what is under the pointer is read without a click
    assert notices.message.text == told
    notices.message = None
    p.d.rest()  # the window draws on
    assert p.d.session.scene is not None


def check_a_grid_that_is_cut_off_at_any_read_of_its_start_is_a_message(p: Person, folder: Path) -> None:
    whole, read, notices = folder / "unharmed", NpyColumn._rows, p.d.session.notices
    convert([write_ply(folder / "start.ply", points=100_000)], whole)

    def opened(grid: Path, harmful: int) -> int:
        """Opens a grid that is truncated just before one of its reads; returns how many there were until it is shown."""
        count = 0

        def rows(column: NpyColumn, *of_read):
            nonlocal count
            if Path(column.filename).parent == grid:
                if count == harmful:
                    os.truncate(grid / "points.npy", LEFT)
                count += 1
            return read(column, *of_read)

        with patch.object(NpyColumn, "_rows", rows):
            p.d.drop(grid)
            p.d.until(lambda: p.d.session.loads.current is None
                      and (notices.message is not None or p.d.session.shown_scan.paths == (grid,)))
            return count

    assert opened(whole, -1) >= 4 and notices.message is None
    for harmful in (0, 1, 3):  # survey, directions, start viewpoint; later reads are those of the pointer
        grid = shutil.copytree(whole, folder / f"cut at {harmful}")
        opened(grid, harmful)
        p.d.until(lambda: notices.message is not None)
        assert "points.npy: was truncated" in notices.message.text or "points.npy: damaged grid" in notices.message.text
        p.key("Escape")
