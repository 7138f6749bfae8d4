"""Loading scans off the window's thread, and the notices about a scan."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...common.errors import Cancelled, InputError, PointglassError
from ...preprocess.scan_description import ScanDescription, WarningTopic
from ...readers.remote.address import address_in
from ...readers.remote.upper_levels import FIRST_POINTS
from ...work.moved_scans import MissingScans, ends_of
from ..flight.start_viewpoint import Survey, survey
from ..kit.notices import KeepAsScanned, Notices, Problem, ScanNotice
from ..kit.worker import Worker
from ..planning.opened_ahead import AHEAD
from ..planning.remote_reading import RemoteReading

if TYPE_CHECKING:
    from ...grid.place.open_place import PlaceGrids
    from ...grid.scene import Scene
    from ...readers.moved_source import Moves
    from ...readers.remote.octree_set import OctreeSet
    from .recovery import Recoverable

_FINER = (FIRST_POINTS, 4 * FIRST_POINTS, 16 * FIRST_POINTS)
"""Points of the pictures of a scan at an address, one after another while the rest is read, at most.  Whole levels of an octree
are shown, of which each has about four times the points of the one above: the first picture has 50,000 to 200,000 points, in
place of the 400,000 of a file's preview (viewer.grid.preview), since a slow line is waited for."""
_FINER_SECONDS = (0.8, 0.8, 3.0)
"""Seconds for reading each of them on this machine: two million points of a LAZ file take about one."""
_PREVIEW_SECONDS = 3.0  # that the complete load waits at most for the preview to be on the screen


@dataclass(frozen=True)
class Loaded:
    """What a load brings back, made off the window's thread.

    seen: what the start viewpoint needs to know.  paths: the files.  preview: a coarse scene that the complete one follows.
    follows_preview: the complete scene of a preview that is shown: the camera stays.
    variant: the scene that is shown, with other points marked as ghosts: the camera stays.
    same_work: files of the document were added, removed or moved: the document and the camera stay.
    problems: why files could not be opened, one each.
    """

    scene: "Scene"
    seen: Survey
    paths: tuple[Path, ...] = ()
    preview: bool = False
    follows_preview: bool = False
    variant: bool = False
    same_work: bool = False
    problems: tuple[Problem, ...] = ()


def scan_notices(meta: ScanDescription) -> list[ScanNotice]:
    """What a person should know about a scan: its warnings, and how its colours differ from the file's."""
    notices = [ScanNotice(text) for text in meta.warning_texts]
    kinds = {"stations": meta.stations_matched, "runs of points": meta.runs_matched}
    matched = [name for name, applied in kinds.items() if applied]
    if matched:
        text = f"The brightness of {' and of '.join(matched)} was made equal."
        notices.append(ScanNotice(text, KeepAsScanned()))
    return notices


def preview_scene(paths: list[Path], *, detail: int = 0, cache: bool = True, match: bool = True, columns: str | None = None,
                  moves: "Moves | None" = None) -> "Scene | None":
    """A coarse scene within about a second; None where the complete one opens as fast.

    detail: the how manieth one of the same paths.  Those at an address have several, each finer; of others there is one.
    cache: whether the complete one is read from the cache, where it is there."""
    from ...grid.open_scene import as_paths, is_cached
    from ...readers.grid_folder import is_grid

    at_addresses = any(address_in(path) for path in paths)
    if detail >= (len(_FINER) if at_addresses else 1):
        return None
    if cache and not moves and AHEAD.opens(paths, match=match, columns=columns):
        return None
    upper = _upper_levels(paths, detail) if at_addresses else []
    files = as_paths(paths, fetch=False)
    if upper is None or any(map(is_grid, files)) or (cache and is_cached(files, match, columns, moves)):
        return None
    from ...grid.preview import preview_scene as coarse

    if not upper:
        return coarse(files, columns=columns, moves=moves)
    return coarse([path for path, _ in upper], points=[points for _, points in upper], seconds=_FINER_SECONDS[detail],
                  columns=columns, moves=moves)


def _upper_levels(paths: Sequence[Path], detail: int) -> list[tuple[Path, int]] | None:
    """The files for a preview and how many points to take of each, read from their addresses as far as needed; None where that
    is as long as the whole file, shows no more than the preview before, or fails, which the complete load reports."""
    from ...readers.remote.fetch import coarse

    shares = [points // len(paths) for points in (0, *_FINER)]
    chosen, finer = [], False
    try:
        for path in paths:
            points = shares[-1]
            if (address := address_in(path)) is not None:
                if (found := coarse(address, shares[detail + 1], shares[detail])) is None:
                    return None
                path, points, finer = found.path, found.points, finer or found.finer
            chosen.append((path, points))
    except InputError:
        return None
    return chosen if finer else None


def expanded(paths: Sequence[Path]) -> list[Path]:
    """The paths, with each folder that is no scan itself replaced by the scans that lie in it."""
    from ...readers.formats import entry_of, is_scan
    from ...readers.grid_folder import is_grid

    found: list[Path] = []
    for path in paths:
        if path.is_dir() and not is_grid(path) and entry_of(path) == path:
            inside = [file for file in sorted(path.iterdir()) if not file.name.startswith(".") and is_scan(file)]
            found += inside or [path]
        else:
            found.append(path)
    return found


def open_each(files: list[Path], open_scene: "Callable[[list[Path]], Scene]") -> "tuple[Scene, list[Path], list[Problem]]":
    """Opens ``files`` as one scene and leaves out those that cannot be opened.

    Returns the scene, the files it holds, and why the others are not among them.  Raises the last error where none is left.
    """
    problems: list[Problem] = []
    while True:
        try:
            scene = open_scene(files)
            if left_out := scene.meta.warnings_about(WarningTopic.LEFT_OUT):
                problems += [warning.detail for warning in left_out]
                files = [file for file in files if _is_in(scene, file)]
            return scene, files, problems
        except Cancelled:
            raise
        except PointglassError as error:
            named = [file for file in files if error.is_of(file)]
            if len(files) == 1 or not named:
                raise
            problems.append(error)
            files = [file for file in files if file != named[0]]


def _is_in(scene: "Scene", file: Path) -> bool:
    """Whether a scene holds the points of a file, or of a folder of an octree or made by ``convert``."""
    from ...grid.open_scene import as_paths
    from ...readers.grid_folder import is_grid

    return is_grid(file) or any(str(path.absolute()) in scene.meta.sources for path in as_paths(file, fetch=False))


def _part_of(paths: tuple[Path, ...], scene: "Scene") -> Loaded:
    """A scene of what of a scan was read for the view, at which the camera stays."""
    return Loaded(scene, survey(scene), paths, preview=True, same_work=True)


class ScanLoads:
    """The load of scans under way, one at a time, and those given up that still clean up after themselves.

    current: the load under way, else None.  reading: of a scan at an address of which only what is in view is read.
    missing: scans of a project that were not there, until somebody asks for them.  prepare: the scans to read of what is opened
    (of a project, its scans); raises PointglassError.  moves: the transformations of the scans prepared.  open_scene,
    preview_scene, wake: replaceable in tests.
    """

    def __init__(self, notices: Notices, open_scene: "Callable[..., Scene]", wake: Callable[[], None],
                 preview_scene: "Callable[..., Scene | None]" = preview_scene):
        self._notices, self._wake = notices, wake
        self.wake = wake
        self.open_scene, self.preview_scene = open_scene, preview_scene
        self.prepare: Callable[[Sequence[Path], Recoverable | None], list[Path]] = lambda paths, _: list(paths)
        self.moves: Callable[[], Moves] = dict
        self.current: Worker | None = None
        self.reading = RemoteReading(notices, wake)
        self.missing: MissingScans | None = None
        self._asked: tuple[Sequence[Path], Recoverable | None] = (), None
        self._preview: Loaded | None = None
        self._shown = threading.Event()
        self._abandoned: list[Worker] = []

    def open(self, paths: Sequence[Path], *, as_scanned: bool = False, recovered: "Recoverable | None" = None,
             moves: "Moves | None" = None, same_work: bool = False, whole: bool = False) -> None:
        """Starts loading ``paths`` as one scene, instead of a load under way; the present scene stays until then.

        as_scanned: colours are left as the files have them, whatever was chosen at the start.  recovered: given to prepare.
        moves: transformations of the scans; None: those of what is opened.  same_work: as in Loaded.
        whole: all points of the scan whose preview is shown, also where only what is in view was read of it.
        """
        self.cancel(forget=not whole)
        self._asked = paths, recovered
        try:
            given = self.prepare(paths, recovered)
            colours: dict[str, Any] = {"match": False} if as_scanned else {}
            moves = self.moves() if moves is None else moves
            colours |= {"moves": moves} if moves else {}
        except MissingScans as error:
            self.missing = error
            return
        except PointglassError as error:
            self._notices.say("This project cannot be opened", error)
            return

        def work() -> "Loaded | Callable[[], None]":
            files = expanded(given)
            octrees, others = (None, files) if whole or same_work or moves else self.reading.plan(files)
            first = partial(self._first_pictures, colours=colours, most=1 if octrees else None,
                            wanted=lambda: self.current is worker[0] and not worker[0].cancelled)
            shown = whole or (not same_work and first(files))
            if octrees is not None and (shown or first([file for file in files if file not in others])):
                match = colours.get("match", self.reading.match)
                beside, problems = self.reading.grids_of(others, match)
                opened = tuple(file for file in files if not any(error.is_of(file) for error in problems))
                return partial(self._read_in_view, octrees, opened, match, beside, problems)
            scene, opened, problems = open_each(files, lambda some: self.open_scene(some, **colours))
            for file in opened:
                ends_of(file)  # read and kept here: the window asks for it when the scene is shown, and a disk may be slow
            return Loaded(scene, survey(scene), tuple(opened), follows_preview=shown, same_work=same_work,
                          problems=tuple(problems))

        names = given[0].name if len(given) == 1 else f"{len(given)} files"
        worker: list[Worker] = []
        self.current = Worker(work, f"Opening {names}", self._wake, start=False)
        worker.append(self.current)
        self.current.start()

    def open_again(self) -> None:
        """Opens what was asked for last: its missing scans have been located."""
        paths, recovered = self._asked
        self.open(paths, recovered=recovered)

    def _first_pictures(self, files: list[Path], *, colours: dict, wanted: Callable[[], bool], most: int | None) -> bool:
        """Makes the preview, or several, each finer, on the worker's thread.  Returns whether there is one.  Errors are left to
        the complete load.  most: previews; None: as many as there are."""
        detail = 0
        while True:
            try:
                scene = self.preview_scene(files, detail=detail, **colours)
            except Cancelled:
                raise
            except (PointglassError, MemoryError, OSError):
                return detail > 0
            if scene is None or not wanted():
                return detail > 0
            self._shown.clear()
            self._preview = Loaded(scene, survey(scene), tuple(files), preview=True, follows_preview=detail > 0)
            self._wake()
            self._shown.wait(_PREVIEW_SECONDS)  # the first picture does not share the processors with the complete load
            detail += 1
            if detail == most or not any(map(address_in, files)):
                return True

    def _read_in_view(self, octrees: "OctreeSet", files: tuple[Path, ...], match: bool, beside: "PlaceGrids | None",
                      problems: "Sequence[Problem]") -> None:
        """Reads what is in view from now on.  files: those of the scene.  problems: why others are not among them."""
        self.reading.begin(octrees, partial(_part_of, files), match, beside)
        self._tell_left_out(problems, len(files))

    def preview_shown(self) -> None:
        """The preview is on the screen: the complete load goes on."""
        self._shown.set()

    def cancel(self, *, forget: bool = False) -> None:
        """Stops the load under way, and pauses what is read for the view, or forgets it; the scene stays."""
        self._preview = None
        self._shown.set()
        self._shown = threading.Event()
        (self.reading.forget if forget else self.reading.pause)()
        if self.current is not None:
            self.current.cancel()
            self._abandoned.append(self.current)
            self.current = None

    def poll(self) -> Loaded | None:
        """A scene that has been loaded since the last call, or None.  An error becomes a dialog."""
        self._abandoned = [work for work in self._abandoned if not work.finished]
        if self.current is None:
            return self.reading.take()
        if not self.current.finished:
            preview, self._preview = self._preview, None
            return preview
        work, self.current = self.current, None
        preview, self._preview = self._preview, None
        if work.error is not None:
            self._notices.say("This scan cannot be opened", work.error)
            self.reading.resume()
        loaded = work.result if not work.cancelled else None
        if callable(loaded):
            loaded()
            return preview
        if loaded is not None:
            self.reading.forget()
        if loaded is not None:
            self._tell_left_out(loaded.problems, len(loaded.paths))
        return loaded

    def _tell_left_out(self, problems: "Sequence[Problem]", opened: int) -> None:
        if problems:
            self._notices.say(f"{len(problems)} of {len(problems) + opened} files could not be opened", *problems)

    def close(self) -> None:
        """Stops the load, and waits until what was being written is removed."""
        self.cancel()
        for work in self._abandoned:
            work.join(15.0)
