"""Reads of octrees at addresses what a camera looks at, on threads of its own, and makes scenes of what came.

The next nodes are fetched while those that came are decoded.  A scene holds all nodes that are kept: those of the present view,
and of earlier views as many as memory allows.  A lost network is tried again until it is back.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from itertools import count
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ...model.common.system import lower_thread_priority
from ..common.errors import InputError
from ..picture.camera import Camera
from ..readers.remote.octree_set import OctreeSet
from ..readers.remote.octree_view import octree_view
from ..readers.remote.remote_object import ChangedFileError, UnreachableError
from .nodes_in_view import MOST_POINTS, nodes_in_view
from .scene_of_nodes import NodesInMemory, finest_spacing, scene_of_octrees

if TYPE_CHECKING:
    from ..grid.place.open_place import PlaceGrids
    from ..grid.scene import Scene
    from ..readers.source import Chunk

_KEPT = MOST_POINTS * 4 // 3
"""Points in memory, those of earlier views with them: 35 bytes each as they are read, and 12 in the scene."""
_BATCH_S, _LEAST_BATCH, _MOST_BATCH = 0.7, 256 << 10, 16 << 20
"""Seconds that a batch of nodes is to take at the line's speed, after which the camera is looked at again; its bytes."""
_AHEAD = 4
"""Batches that are asked for while others are decoded and a scene is made."""
_GROWTH, _SHOWN_S, _REST = 4.0, 0.5, 1.0
"""A new scene is made when one in so many of its points is new and so many seconds have passed since the last, at least so many
times those that it took; and when the view is complete."""
_PAUSES_S = (1.0, 2.0, 4.0, 8.0, 15.0)
"""Before a lost network is tried again; the last from then on."""
_NICENESS = 5
_UNMEASURED_S = 0.02
"""What takes less was there."""
_log = logging.getLogger(__name__)
Result = TypeVar("Result")


@dataclass(frozen=True)
class ReadingState:
    """What is being read for the view.  points, here: of the whole scan, and of those in the scene.  size, held: bytes of the
    whole, and of the nodes read so far.  left: bytes still to be fetched for this view.  problem: why nothing comes now, else
    "".  ended: it stays so.  complete: the last camera of which the latest scene has all."""

    points: int
    size: int
    here: int = 0
    held: int = 0
    left: int = 0
    problem: str = ""
    ended: bool = False
    complete: Camera | None = None


@dataclass
class _Kept:
    """Nodes that are in memory.  chunks: their points, by octree.  used: the number of the last view that wanted one."""

    numbers: np.ndarray
    chunks: "dict[int, Chunk]"
    points: int
    used: int = 0


@dataclass
class _View:
    """What is asked for: the nodes in the order in which they are read.  number: counts views."""

    wanted: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    number: int = 0


class ViewReader:
    """state: what it does, for a person.  prepare: turns a scene into what :meth:`take` returns, on the reader's thread.  wake:
    called there when there is something to take or the state has changed.  match, beside: as for scene_of_octrees."""

    def __init__(self, octree: OctreeSet, prepare: "Callable[[Scene], Any]", *, match: bool = True,
                 wake: Callable[[], None] = lambda: None, beside: "PlaceGrids | None" = None):
        self._octree, self._prepare, self._match, self._wake, self._beside = octree, prepare, match, wake, beside
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
            if not self._closed:
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
        looked, view, fresh, next_scene = None, _View(), 0, 0.0
        coming: deque[tuple[np.ndarray, Future[float]]] = deque()
        while not self._closed:
            if self._camera is not looked and self._camera is not None:
                looked = self._camera
                view = _View(np.concatenate(nodes_in_view(self._octree.nodes, looked)), view.number + 1)
                self._use(view)
                coming = deque(one for one in coming if not one[1].cancel())
            while len(coming) < _AHEAD and len(batch := self._next(view, [numbers for numbers, _ in coming])):
                coming.append((batch, pool.submit(self._fetch, batch)))
            if coming:
                numbers, fetching = coming.popleft()
                try:
                    if not self._arrived(numbers, fetching):
                        return
                except ChangedFileError:
                    wait([one for _, one in coming if not one.cancel()])  # they would empty the new copy
                    raise
                self._take_in(numbers, view)
                fresh += int(self._octree.nodes.points[numbers].sum())
            left = self._missing(view)
            self._tell(left=int(self._octree.nodes.bytes[left].sum()))
            grown = fresh * _GROWTH >= sum(kept.points for kept in self._kept)
            if fresh and (not len(left) or (grown and monotonic() > next_scene)):
                began = monotonic()
                self._show()
                fresh, next_scene = 0, monotonic() + max(_SHOWN_S, _REST * (monotonic() - began))
            if not len(left) and not coming:
                self._tell(complete=looked)
                self._wait(looked)

    def _use(self, view: _View) -> None:
        for kept in self._kept:
            if np.isin(kept.numbers, view.wanted).any():
                kept.used = view.number

    def _missing(self, view: _View) -> np.ndarray:
        there = np.concatenate([np.empty(0, np.int64), *(kept.numbers for kept in self._kept)])
        return view.wanted[~np.isin(view.wanted, there)]

    def _next(self, view: _View, coming: "list[np.ndarray]") -> np.ndarray:
        """The nodes to be fetched next, about _BATCH_S of the line.  coming: those under way."""
        left = self._missing(view)
        left = left[~np.isin(left, np.concatenate(coming))] if coming else left
        most = min(max(_BATCH_S * self._speed, _LEAST_BATCH), _MOST_BATCH)
        return left[: max(1, int(np.searchsorted(np.cumsum(self._octree.nodes.bytes[left]), most, "right")))]

    def _fetch(self, numbers: np.ndarray) -> float:
        """Fetches nodes.  Returns the seconds that it took."""
        began = monotonic()
        self._patiently(lambda: self._octree.fetch(numbers))
        return monotonic() - began

    def _patiently(self, work: "Callable[[], Result]") -> "Result":
        """What ``work`` returns, tried again and again where the network is lost.  Raises UnreachableError once closed."""
        for attempt in count():
            try:
                done = work()
            except UnreachableError as error:
                pause = _PAUSES_S[min(attempt, len(_PAUSES_S) - 1)]
                self._tell(problem=f"{str(error).split(';', 1)[0]}; trying again every {pause:.0f} s")
                with self._news:
                    if self._news.wait_for(lambda: self._closed, pause):
                        raise
            else:
                if attempt:
                    self._tell(problem="")
                return done
        raise AssertionError("it goes on until it is done or closed")

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
        chunks = self._octree.chunks(numbers)
        self._kept.append(_Kept(numbers, chunks, sum(len(chunk.xyz) for chunk in chunks.values()), view.number))
        while sum(kept.points for kept in self._kept) > _KEPT:
            oldest = min(self._kept, key=lambda kept: kept.used)
            if oldest.used == view.number:
                return
            self._kept.remove(oldest)

    def _show(self) -> None:
        parts: dict[int, list[Chunk]] = {}
        for kept in self._kept:
            for tree, chunk in kept.chunks.items():
                parts.setdefault(tree, []).append(chunk)
        spacing = finest_spacing(self._octree.nodes, np.concatenate([kept.numbers for kept in self._kept]),
                                 lambda leaf: parts[self._octree.tree_of(leaf)])
        sources = [NodesInMemory(self._octree.octrees[tree].source, parts[tree]) for tree in sorted(parts)]
        made = self._prepare(scene_of_octrees(sources, spacing=spacing, match=self._match, beside=self._beside))
        with self._news:
            self._made = made
        self._wake()

    def _tell(self, **changes: Any) -> None:
        """Changes the state.  From any thread of the reader."""
        nodes = self._octree.nodes
        known = {"here": sum(kept.points for kept in [*self._kept]), "held": int(nodes.bytes[self._fetched].sum())}
        state = replace(self.state, **known, **changes)
        if state != self.state:
            self.state = state
            self._wake()

    def _wait(self, looked: Camera | None) -> None:
        with self._news:
            self._news.wait_for(lambda: self._closed or self._camera is not looked)

    def _begin_anew(self) -> None:
        """A scan changed on its server: nothing of the old ones is kept."""
        views = []
        for address in [one.address for one in self._octree.octrees]:
            view = self._patiently(lambda address=address: octree_view(address, -1))
            if view is None:
                raise InputError(f"{address.text}: is another file than before", remedy="open it again")
            views.append(view)
        found = OctreeSet(views)
        self._octree, self._kept = found, []
        self._fetched = np.zeros(len(found.nodes.levels), bool)
        self.state = ReadingState(int(found.nodes.points.sum()), found.size)
