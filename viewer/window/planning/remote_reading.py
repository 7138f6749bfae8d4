"""What a window reads of a scan at an address: the parts in view, as the camera moves; and what it says of that."""

from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from ...common.errors import InputError
from ...common.text import bytes_text, count_text
from ...readers.remote.address import is_address
from ..kit.notices import LoadAllPoints, Notices, ScanNotice

if TYPE_CHECKING:
    from ...grid.place.open_place import PlaceGrids
    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...readers.remote.octree_set import OctreeSet
    from ...stream.view_reader import ReadingState, ViewReader

_MOVING_S = 0.4
"""Seconds between two cameras of a movement that are read for: a batch of nodes takes 0.7."""


class RemoteReading:
    """One window's.  on: whether only what is in view is read now.  match: whether colours are made equal.  columns: as for
    viewer.grid.open_scene, of the files that are opened beside.  cache: whether grids are kept, as those of such files must be.
    """

    def __init__(self, notices: Notices, wake: Callable[[], None]):
        self._notices, self._wake = notices, wake
        self.match, self.cache = True, True
        self.columns: str | None = None
        self._begun: tuple[OctreeSet, Callable[[Scene], Any], bool, PlaceGrids | None] | None = None
        self._reader: ViewReader | None = None
        self._looked, self._told = 0.0, False

    @property
    def on(self) -> bool:
        return self._reader is not None

    @property
    def state(self) -> "ReadingState":
        assert self._reader is not None
        return self._reader.state

    def plan(self, paths: Sequence[Path]) -> "tuple[OctreeSet | None, list[Path]]":
        """The octrees of which only what is in view is read, None where there are none, and the scans that are read whole."""
        if not any(map(is_address, paths)):
            return None, [*paths]
        from ...readers.remote.octree_set import octrees_in

        octrees, whole = octrees_in(paths)
        return (octrees, whole) if self.cache or not whole else (None, [*paths])

    def grids_of(self, paths: Sequence[Path], match: bool) -> "tuple[PlaceGrids | None, list[InputError]]":
        """The grids of scans that are read whole, None where there are none, and why others are not among them."""
        if not paths:
            return None, []
        from ...grid.open_scene import grids_of

        try:
            grids = grids_of(paths, match=match, columns=self.columns)
        except InputError as error:
            return None, [error]
        return grids, grids.errors

    def begin(self, octrees: "OctreeSet", prepare: "Callable[[Scene], Any]", match: bool,
              beside: "PlaceGrids | None" = None) -> None:
        """Reads what is in view of ``octrees`` from now on.  prepare, match, beside: as for ViewReader."""
        self.forget()
        self._begun = octrees, prepare, match, beside
        self.resume()

    def resume(self) -> bool:
        """Goes on where it was paused.  Returns whether it was."""
        if self._begun is not None and self._reader is None:
            from ...stream.view_reader import ViewReader

            octrees, prepare, match, beside = self._begun
            self._reader, self._told = ViewReader(octrees, prepare, match=match, wake=self._wake, beside=beside), False
        return self.on

    def pause(self) -> None:
        """Reads nothing until it is resumed."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None

    def forget(self) -> None:
        """Ends: all of the scan, or another one, is opened."""
        self.pause()
        self._begun = None

    def look(self, camera: "Camera", *, moving: bool) -> None:
        """Called in every turn of the loop: what the camera sees is read next, and all of it is offered."""
        now = monotonic()
        if self._reader is None:
            return
        if not self._notices.of_scan:
            self._notices.of_scan = [self.notice]
        if not moving or now > self._looked + _MOVING_S:
            self._looked = now
            self._reader.look(camera)

    def take(self) -> Any:
        """What ``prepare`` made of the latest scene, once; None where there is no new one.  Says why nothing follows."""
        if self._reader is None:
            return None
        if self.state.ended and not self._told:
            self._told = True
            self._notices.say("This scan cannot be read on", self.state.problem)
        return self._reader.take()

    @property
    def short(self) -> str:
        """For the status bar; "" where all of the view is there."""
        state = self.state
        if state.problem:
            return "stopped" if state.ended else "network lost"
        return f"fetching {bytes_text(state.left)}" if state.left else ""

    @property
    def text(self) -> str:
        """For the outliner, and the tooltip in the status bar."""
        state = self.state
        here = f"{count_text(state.here)} of {count_text(state.points)} points read"
        if state.problem:
            return f"{here}. {state.problem}."
        return f"{here}; {bytes_text(state.left)} to fetch for this view." if state.left else f"{here}: all that is in view."

    @property
    def how(self) -> str:
        """The end of a sentence that asks for all points: how they come, where only what is in view is read."""
        return f": Load all points (left) fetches {bytes_text(self.state.size)}" if self.on else ""

    @property
    def notice(self) -> ScanNotice:
        """The offer to read all."""
        assert self._begun is not None
        host = self._begun[0].host
        return ScanNotice(f"Only what is in view is fetched from {host}; all of it is {bytes_text(self.state.size)}.",
                          LoadAllPoints())
