"""Opens a scan whose grids are in the cache while the window is still being imported and made.

A place of a thousand grids takes half a second to open, on a thread that the window's own start does not wait for.  What was
opened is taken once, by the load that asks for the same files (:func:`open_scene`); other loads do not notice.
"""

import contextlib
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ...common.errors import PointglassError
from ...common.progress import progress, set_sink

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...readers.moved_source import Moves

_LOOK_S = 0.05
"""Seconds between two looks at whether the load that waits was cancelled."""


class OpenedAhead:
    """What is opened ahead: nothing, or what it began with, once."""

    def __init__(self) -> None:
        self._known = threading.Event()  # whether the grids are in the cache
        self._over = threading.Event()
        self._asked: tuple[list[Path], bool, str | None] | None = None
        self._files: list[Path] = []
        self._scene: Scene | None = None
        self._dropped = False

    def begin(self, paths: Sequence[Path], *, match: bool, columns: str | None) -> None:
        """Starts to open ``paths``, if their grids are in the cache.  match, columns: as for viewer.grid.open_scene."""
        self._asked, self._dropped = (list(paths), match, columns), False
        threading.Thread(target=self._open, name="pointglass opening", daemon=True).start()

    def take(self, files: Sequence[Path], *, match: bool, columns: str | None) -> "Scene | None":
        """The scene of ``files``, once: waits for it where it is under way; None where others were opened, which are dropped,
        or it failed.  Raises Cancelled where progress is cancelled."""
        if self._asked is None:
            return None
        try:
            if not self.opens(files, match=match, columns=columns):
                return None
            with progress(0, "opening the grids") as meter:
                while not self._over.wait(_LOOK_S):
                    meter.update(0)
            return self._scene
        finally:
            self._dropped, self._asked, self._scene = True, None, None

    def opens(self, files: Sequence[Path], *, match: bool, columns: str | None) -> bool:
        """Whether the scene of ``files`` is under way, or opened and not yet taken."""
        if self._asked is None or self._asked[1:] != (match, columns):
            return False
        self._known.wait()
        return self._files == list(files)

    def _open(self) -> None:
        """On its own thread.  An error is met again, and told of, by the load."""
        assert self._asked is not None
        paths, match, columns = self._asked
        set_sink(lambda _label, _done, _total: not self._dropped)
        try:
            with contextlib.suppress(PointglassError, OSError, MemoryError):
                from ...grid.open_scene import as_paths, is_cached, open_scene
                from ...readers.formats import takes_columns

                files = as_paths(paths, fetch=False)
                columns = columns if any(map(takes_columns, files)) else None
                if is_cached(files, match, columns):
                    self._files = files
                    self._known.set()
                    scene = open_scene(files, match=match, columns=columns)
                    self._scene = None if self._dropped else scene
        finally:
            self._known.set()
            self._over.set()


AHEAD = OpenedAhead()
"""Of this process, begun with its window (viewer.window.shell.run_window)."""


def open_scene(paths: list[Path], *, cache: bool = True, match: bool = True, columns: str | None = None,
               moves: "Moves | None" = None) -> "Scene":
    """The scans as one scene.  cache, match, columns, moves: as in viewer.grid.open_scene."""
    from ...grid import open_scene as grid_scene
    from ...readers.formats import takes_columns

    ahead = None if moves or not cache else AHEAD.take(paths, match=match, columns=columns)
    if ahead is not None:
        return ahead
    columns = columns if any(map(takes_columns, paths)) else None  # not of files that are dropped into the window later
    return grid_scene.open_scene(paths, cache=cache, match=match, columns=columns, moves=moves)
