"""``run_tasks``: the results of many independent tasks, in their order, whoever computes them.

A task is a small picklable value: the name of a file, a range of numbers, a camera.  What computes it is a picklable function,
or an object whose ``opened()`` opens once in each process what its tasks share (a scene, an OpenGL context):

    class Pictures:                                                  # a frozen dataclass of paths and settings
        @contextmanager
        def opened(self):
            with ... as renderer:
                yield lambda camera: ...                             # called for each task

The results do not depend on the number of workers: each task depends on its own value alone, and results come in the order of
the tasks.
"""

import pickle
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, closing
from typing import Any, TypeVar

from ..progress import progress
from .worker_choice import Workers as Workers

T = TypeVar("T")


def run_tasks(function: Any, tasks: Sequence[T], workers: Workers | None, *, label: str, unit: str = "",
              name: Callable[[T], str] = str, ahead: int | None = None) -> Generator[Any, None, None]:  # fmt: skip
    """Yields the result of each task, in order, and shows one progress bar.

    function: picklable, see above.  workers: None: this process does the tasks itself.  label, unit: as of ``progress``.
    name: what a message calls a task.  ahead: tasks begun beyond the one whose result is taken next, None: any number; for
    results that take much memory.

    A worker that is killed is replaced, and its task done again, at most local_tasks.MOST_DEATHS times.  The first error of a
    task ends all others and is raised here.  Raises InputError where a task ended its workers too often, and where the
    scheduler cannot be used.
    """
    tasks = list(tasks)
    with progress(len(tasks), label, unit) as meter:
        if workers is None or not tasks:
            with ExitStack() as opened:
                work = opened_function(function, opened) if tasks else None
                for task in tasks:
                    result = work(task) if work else None
                    meter.update(1)
                    yield result
            return
        pickled = pickle.dumps(function, protocol=5)
        parts = [pickle.dumps(task, protocol=5) for task in tasks]
        names = [name(task) for task in tasks]
        if workers.scheduler is not None:
            from .dask_tasks import dask_results as results
        else:
            from .local_tasks import local_results as results
        with closing(results(pickled, parts, names, workers, meter, ahead)) as found:
            yield from found


def opened_function(function: Any, opened: ExitStack) -> Callable[[Any], Any]:
    """The function of single tasks: ``function`` itself, or what its ``opened()`` gives, which is closed with ``opened``."""
    return opened.enter_context(function.opened()) if hasattr(function, "opened") else function
