"""Rooms evaluated by several processes: each view is a task, and so are the facts and the camera path of each room.

The result is, apart from durations, that of one process to the byte: each view has random numbers of its own, and means are
taken in the order of the views.  Durations are measured by the command's process, at the first view of each room, before the
others begin: while several processes share the processors, they would say nothing.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from ...data.stations import load_scene
from ..own_methods import own_methods, own_networks
from ..room_scores import OpenedRoom, opened_room
from ..worse import Worst
from .view_scores import ViewScores, pick_views, view_rows

_FACTS = -1
"""In place of the number of a view: the facts of the room, and the flicker along its path."""
Task = tuple[int, int]
"""Number of the room, and of its view or _FACTS."""
Share = Callable[["SharedRooms", Sequence[Task]], Iterator[Any]]
"""Gives the results of tasks in their order: viewer.common.workers.run_tasks."""


@dataclass(frozen=True)
class SharedRooms:
    """What each process opens.  settings: of opened_room, by name, without objects of a process.  methods, networks: your own,
    as given.  worst: whether the worst view is looked for."""

    folders: tuple[Path, ...]
    settings: dict[str, Any]
    methods: tuple[str, ...] = ()
    networks: tuple[str, ...] = ()
    worst: bool = False

    @contextmanager
    def opened(self) -> Iterator[Callable[[Task], Any]]:
        """The function of tasks: of a view (ViewScores, Worst or None), of the facts (facts, reasons of what is left out,
        flicker).  One room is open at a time."""
        own = {"functions": own_methods(self.methods), "networks": own_networks(self.networks)}
        with ExitStack() as stack:
            held: list[tuple[int, OpenedRoom]] = []

            def done(task: Task) -> Any:
                number, view = task
                if not held or held[0][0] != number:
                    held.clear()
                    stack.close()
                    held.append((number, stack.enter_context(opened_room(self.folders[number], **self.settings, **own))))
                room = held[0][1]
                if view == _FACTS:
                    return room.facts(), room.work.absent, room.flicker()
                room.work.worst = Worst() if self.worst else None
                return room.work.view(view, room.shots[view]), room.work.worst

            yield done


def evaluate_shared(rooms: SharedRooms, share: Share, worst: Worst | None) -> list[dict]:
    """The results of rooms, as of model.evaluation.room_scores.evaluate.  worst: gets the pictures of the worst view.  Raises
    DataError and WeightsError."""
    counts = [len(pick_views(load_scene(folder), rooms.settings["views"])) for folder in rooms.folders]
    tasks = [(number, view) for number, count in enumerate(counts) for view in (_FACTS, *range(count))]
    done: dict[Task, Any] = {}
    if not rooms.settings["fast"]:
        with rooms.opened() as work:
            done = {(number, 0): work((number, 0)) for number in range(len(counts))}
    left = [task for task in tasks if task not in done]
    done |= zip(left, share(rooms, left), strict=True)
    results = []
    for number, count in enumerate(counts):
        facts, absent, moving = done[number, _FACTS]
        views: list[ViewScores] = []
        for view in range(count):
            scores, found = done[number, view]
            views.append(scores)
            if worst is not None and found is not None:
                worst.take(found)
        for scores in views:
            absent = absent | scores.absent
        threads = torch.get_num_threads()  # of this process, which measures the durations
        results.append({**facts, "threads": threads, "absent": absent, "rows": view_rows(views), "flicker": moving})
    return results
