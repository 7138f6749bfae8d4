"""The network of a window on CUDA: call by call until its graph has been captured on another thread.

Capturing takes a second or more at each new picture size (warm-up, then the capture itself) and would stop the window for as
long.  Both runs make the same picture up to the rounding of half precision, so only a window uses this: a headless picture is
to repeat to the byte and waits for the graph (:meth:`BackgroundRunner.settle`).
"""

import logging
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from ....model.network.engines import Runner
from ..device.match_device import on_same_device

if TYPE_CHECKING:
    from torch import Tensor

    from ....model.network.reconstruct import Reconstructor

log = logging.getLogger(__name__)


class BackgroundRunner:
    """A Runner that starts as ``eager`` and becomes the network's own engine when that is ready.

    make: as Runner(network, height, width, engine=...), replaceable in tests.
    Calls and ``release`` come from one thread at a time; the capture runs on a thread of its own.
    """

    def __init__(self, network: "Reconstructor", height: int, width: int, make: Callable[..., Runner] = Runner):
        self._current = make(network, height, width, engine="eager")
        self.device = self._current.device
        self._on_device = on_same_device(self.device)
        self._lock = threading.Lock()
        self._captured: Runner | None = None
        self._released = False
        self._thread = threading.Thread(target=self._capture, args=(make, network, height, width), daemon=True,
                                        name="pointglass graph capture")
        self._thread.start()

    def _capture(self, make: Callable[..., Runner], network: "Reconstructor", height: int, width: int) -> None:
        try:
            with self._on_device():
                captured = make(network, height, width)
        except RuntimeError as error:  # CUDA's; a failed device makes the next run raise, and other exceptions are bugs
            log.warning("The network runs call by call: capturing its graph failed (%s)", error)
            return
        with self._lock:
            if not self._released:
                self._captured = captured
                return
        with self._on_device():
            captured.release()

    def _use_captured(self) -> None:
        with self._lock:
            captured, self._captured = self._captured, None
        if captured is not None:
            self._current.release()
            self._current = captured

    def settle(self) -> None:
        """Waits for the capture; the next call uses it."""
        self._thread.join()
        self._use_captured()

    @property
    def name(self) -> str:
        """What runs the network now."""
        return self._current.name

    def __call__(self, packed: "Tensor") -> "Tensor":
        """As Runner."""
        self._use_captured()
        return self._current(packed)

    def release(self) -> None:
        """Frees both; a capture under way frees itself when it ends."""
        with self._lock:
            self._released = True
        self._use_captured()
        self._current.release()
