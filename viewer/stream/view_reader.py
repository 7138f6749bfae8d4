"""Reads of an octree at an address what a camera looks at, on threads of its own, and makes scenes of what came.

The next nodes are fetched while those that came are decoded.  A scene holds all nodes that are kept: those of the present view,
and of earlier views as many as memory allows.  A lost network is tried again until it is back.
"""

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.common.system import lower_thread_priority
from ..common.errors import InputError
from ..picture.camera import Camera
from ..readers.remote.octree_view import OctreeView, octree_view
from ..readers.remote.remote_object import ChangedFileError, UnreachableError
from .nodes_in_view import MOST_POINTS, nodes_in_view
from .scene_of_nodes import scene_of_nodes

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..readers.source import Chunk

_KEPT = MOST_POINTS * 4 // 3
"""Points in memory, those of earlier views with them: 35 bytes each as they are read, and 12 in the scene."""
_BATCH_S, _LEAST_BATCH, _MOST_BATCH = 0.7, 256 << 10, 16 << 20
"""Seconds that a batch of nodes is to take at the line's speed, after which the camera is looked at again; its bytes."""
_GROWTH, _SHOWN_S = 3.0, 1.5
"""A new scene is made when one in so many of its points is new, and after so many seconds where any is."""
_PAUSES_S = (1.0, 2.0, 4.0, 8.0, 15.0)
"""Before a lost network is tried again; the last from then on."""
_NICENESS = 5
_UNMEASURED_S = 0.02
"""What takes less was there."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ReadingState:
    """What is being read for the view.  points, here: of the whole scan, and of those in the scene.  size, held: bytes of the
    whole, and of the nodes read so far.  left: bytes still to be fetched for this view.  problem: why nothing comes now, else
    "".  ended: it stays so."""

    points: int
    size: int
    here: int = 0
    held: int = 0
    left: int = 0
    problem: str = ""
    ended: bool = False


@dataclass
class _Kept:
    """Nodes that are in memory.  used: the number of the last view that wanted one."""

    numbers: np.ndarray
    chunk: "Chunk"
    used: int = 0


@dataclass
class _View:
    """What is asked for: the nodes in the order in which they are read.  number: counts views."""

    wanted: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    number: int = 0


class ViewReader:
    """state: what it does, for a person.  prepare: turns a scene into what :meth:`take` returns, on the reader's thread.  wake:
    called there when there is something to take or the state has changed.  match: as for scene_of_nodes."""

    def __init__(self, octree: OctreeView, prepare: "Callable[[Scene], Any]", *, match: bool = True,
                 wake: Callable[[], None] = lambda: None):
        self._octree, self._prepare, self._match, self._wake = octree, prepare, match, wake
        self.state = ReadingState(int(octree.nodes.points.sum()), octree.size)
        self._camera: Camera | None = None
        self._made: Any = None
        self._closed = False
        self._news = threading.Condition()
        self._kept: list[_Kept] = []
        self._fetched = np.zeros(len(octree.nodes.levels), bool)
        self._speed = 1e6
        self._thread = threading.Thread(target=self._run, name="pointglass view reader", daemon=True)
        self._thread.start()

    def look(self, camera: Camera) -> None:
        """What this camera sees is read next."""
        with self._news:
            if self._camera is None or self._camera.key != camera.key:
                self._camera = camera
                self._news.notify_all()

    def take(self) -> Any:
        """What ``prepare`` made of the latest scene, once; None where there is no new one."""
        with self._news:
            made, self._made = self._made, None
            return made

    def close(self) -> None:
        """Ends the reading; requests under way are not waited for."""
        with self._news:
            self._closed = True
            self._news.notify_all()

    def join(self, seconds: float) -> bool:
        """Waits for the thread.  True where it ended."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    # -- the reader's thread -------------------------------------------------------------------------------------------

    def _run(self) -> None:
        lower_thread_priority(_NICENESS)
        pool = ThreadPoolExecutor(1, "pointglass fetch nodes", lower_thread_priority, (_NICENESS,))
        try:
            while not self._closed:
                try:
                    self._read(pool)
                except ChangedFileError:
                    self._begin_anew()
        except InputError as error:
            self._tell(problem=str(error), ended=True)
        except MemoryError:
            self._tell(problem="not enough memory for more points", ended=True)
        except Exception as error:
            _log.exception("reading what is in view")
            self._tell(problem=f"unexpected {type(error).__name__}: {error}", ended=True)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

    def _read(self, pool: ThreadPoolExecutor) -> None:
        """Reads for one camera after the other, until it is closed."""
        looked, view, fresh, shown_at = None, _View(), 0, monotonic()
        coming: tuple[np.ndarray, Future[float]] | None = None
        while not self._closed:
            came, coming = coming, None
            if came is not None and not self._arrived(came[0], came[1]):
                return
            if self._camera is not looked and self._camera is not None:
                looked = self._camera
                view = _View(np.concatenate(nodes_in_view(self._octree.nodes, looked)), view.number + 1)
                self._use(view)
            batch = self._next(view, came[0] if came else None)
            if len(batch):
                coming = batch, pool.submit(self._fetch, batch)
            if came is not None:
                self._take_in(came[0], view)
                fresh += int(self._octree.nodes.points[came[0]].sum())
            left = self._missing(view)
            complete = not len(left)
            self._tell(left=int(self._octree.nodes.bytes[left].sum()))
            grown = fresh * _GROWTH >= sum(len(kept.chunk.xyz) for kept in self._kept)
            if fresh and (complete or grown or monotonic() > shown_at + _SHOWN_S):
                self._show()
                fresh, shown_at = 0, monotonic()
            if complete and coming is None:
                self._wait(looked)

    def _use(self, view: _View) -> None:
        for kept in self._kept:
            if np.isin(kept.numbers, view.wanted).any():
                kept.used = view.number

    def _missing(self, view: _View) -> np.ndarray:
        there = np.concatenate([np.empty(0, np.int64), *(kept.numbers for kept in self._kept)])
        return view.wanted[~np.isin(view.wanted, there)]

    def _next(self, view: _View, coming: np.ndarray | None) -> np.ndarray:
        """The nodes to be fetched next, about _BATCH_S of the line."""
        left = self._missing(view)
        left = left if coming is None else left[~np.isin(left, coming)]
        most = min(max(_BATCH_S * self._speed, _LEAST_BATCH), _MOST_BATCH)
        return left[: max(1, int(np.searchsorted(np.cumsum(self._octree.nodes.bytes[left]), most, "right")))]

    def _fetch(self, numbers: np.ndarray) -> float:
        """Fetches nodes, again and again where the network is lost.  Returns the seconds it took."""
        attempt = 0
        while True:
            began = monotonic()
            try:
                self._octree.fetch(numbers)
            except UnreachableError as error:
                pause = _PAUSES_S[min(attempt, len(_PAUSES_S) - 1)]
                attempt += 1
                self._tell(problem=f"{str(error).split(';', 1)[0]}; trying again every {pause:.0f} s")
                with self._news:
                    if self._closed or self._news.wait_for(lambda: self._closed, pause):
                        raise
                continue
            if attempt:
                self._tell(problem="")
            return monotonic() - began

    def _arrived(self, numbers: np.ndarray, fetching: "Future[float]") -> bool:
        """Waits for nodes.  False where it was closed meanwhile."""
        try:
            seconds = fetching.result()
        except UnreachableError:
            if self._closed:
                return False
            raise
        if not self._fetched[numbers].all() and seconds > _UNMEASURED_S:
            self._speed += 0.5 * (float(self._octree.nodes.bytes[numbers].sum()) / seconds - self._speed)
        self._fetched[numbers] = True
        return not self._closed

    def _take_in(self, numbers: np.ndarray, view: _View) -> None:
        """Decodes nodes, and gives up those that no view has wanted for longest where they are too many."""
        self._kept.append(_Kept(numbers, self._octree.chunk(numbers), view.number))
        while sum(len(kept.chunk.xyz) for kept in self._kept) > _KEPT:
            oldest = min(self._kept, key=lambda kept: kept.used)
            if oldest.used == view.number:
                return
            self._kept.remove(oldest)

    def _show(self) -> None:
        made = self._prepare(scene_of_nodes(self._octree.source, [kept.chunk for kept in self._kept], match=self._match))
        with self._news:
            self._made = made
        self._wake()

    def _tell(self, **changes: Any) -> None:
        """Changes the state.  From any thread of the reader."""
        nodes = self._octree.nodes
        known = {"here": sum(len(kept.chunk.xyz) for kept in [*self._kept]), "held": int(nodes.bytes[self._fetched].sum())}
        state = replace(self.state, **known, **changes)
        if state != self.state:
            self.state = state
            self._wake()

    def _wait(self, looked: Camera | None) -> None:
        with self._news:
            self._news.wait_for(lambda: self._closed or self._camera is not looked)

    def _begin_anew(self) -> None:
        """The scan changed on the server: nothing of the old one is kept."""
        found = octree_view(self._octree.address, -1)
        if found is None:
            raise InputError(f"{self._octree.address.text}: is another file than before", remedy="open it again")
        self._octree, self._kept = found, []
        self._fetched = np.zeros(len(found.nodes.levels), bool)
        self.state = ReadingState(int(found.nodes.points.sum()), found.size)
