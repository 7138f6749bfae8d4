"""Loads in the background, while the start page is shown, what the first picture of a scan needs.

Importing the readers, numba and scipy and loading compiled loops takes about two seconds of the first scan opened in a process.
A person who looks for a file does not notice them.  torch is left out: the neural view loads it after the first picture.
"""

import logging
import threading
from time import perf_counter

from ....model.common.system import lower_thread_priority

_NICENESS = 5
"""Added to the thread's niceness where the system has one per thread (Linux): the start page goes first."""
_POINTS = 3000
"""Points of the scene that is built to load the compiled loops: enough for a preview (viewer.grid.preview.LEAST_POINTS)."""
_log = logging.getLogger(__name__)


class WarmUp:
    """The background thread; it ends by itself."""

    def __init__(self) -> None:
        self._thread = threading.Thread(target=_load, name="pointglass warm-up", daemon=True)
        self._thread.start()

    def wait(self, timeout: float | None = None) -> bool:
        """Waits until everything is loaded.  Returns whether it is."""
        self._thread.join(timeout)
        return not self._thread.is_alive()


def _load() -> None:
    """Imports the readers and builds a small scene in memory."""
    lower_thread_priority(_NICENESS)
    start = perf_counter()
    try:
        import laspy  # noqa: F401
        import lazrs  # type: ignore[import-not-found]  # noqa: F401
        import numpy as np

        from ...grid import preview  # noqa: F401
        from ...grid.open_scene import scene_from_arrays
        from ...preprocess import point_colour  # noqa: F401
        from ...render import renderer  # noqa: F401
        from ...work.places.standing_place import surroundings
        from ..flight.start_viewpoint import survey

        rng = np.random.default_rng(0)
        scene = scene_from_arrays(
            rng.uniform(0, 4, (_POINTS, 3)), rng.integers(0, 256, (_POINTS, 3), dtype=np.uint8),
            intensity=np.zeros(_POINTS, np.uint16), scan=np.zeros(_POINTS, np.uint8), noise=False,
        )
        surroundings(survey(scene), np.full(3, 2.0))
    except ImportError as error:  # the load itself names what is missing, and the remedy
        _log.info("not everything could be loaded ahead: %s", error)
    _log.info("loaded ahead in %.1f s", perf_counter() - start)
