"""The neural view: filled pixels through the bridge and the network into a picture.  torch is imported here, at first use.

Two ways to run: :meth:`NeuralStage.infer` at once, for headless pictures; and :meth:`NeuralStage.start` with
:meth:`NeuralStage.finish`, for a window, where the network runs on a thread of its own between the two calls.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from ....model.network.engines import ENGINES, Runner
from ....model.network.levels import LEVELS
from ....model.network.reconstruct import Reconstructor, cuda_problem
from ....model.network.weights import WeightsError
from ...common.errors import DeviceError, DeviceLostError, InputError, Option
from ..device import shader
from ..device.context import LOST, context_lost
from ..device.device_failure import device_failure
from ..device.egl import current_cuda_number
from ..device.match_device import on_same_device, use_matching_device
from ..passes.fill_cpu import CpuFill
from ..photographs.kept_photographs import KeptPhotographs, PhotoColours
from .background_capture import BackgroundRunner
from .bridge import Network, ReadBackBridge, run_on_host
from .choose_bridge import make_bridge
from .network_thread import NetworkThread
from .neural_picture import NeuralPicture

if TYPE_CHECKING:
    import moderngl


ENGINE_VARIABLE = "POINTGLASS_ENGINE"
"""Environment variable with the engine of the network on CUDA (a key of model.network.engines.ENGINES), for measurements."""

_FAILED = ("failed",)
"""The key of a stage that is not to be used again."""
_networks: dict[tuple[str, bool, str | None, str, str, int | None], Reconstructor] = {}
"""Those that are loaded; the last number of a key: of the CUDA device that has the weights."""


def load_network(quality: str, filtered: bool, weights: str | None, precision: str, device: str) -> Reconstructor:
    """A network, loaded once per process, and once for each CUDA device.  weights: a file used instead of the shipped weights.
    Raises InputError where the weights do not exist."""
    key = (quality, filtered, weights, precision, device, current_cuda_number() if device == "cuda" else None)
    if key not in _networks:
        engine = os.environ.get(ENGINE_VARIABLE) or None
        if engine is not None and engine not in ENGINES:
            raise InputError(f"{ENGINE_VARIABLE}={engine}: expected one of {', '.join(ENGINES)}")
        try:
            path = Path(weights) if weights else None
            _networks[key] = Reconstructor(
                quality, filtered=filtered, device=device, weights=path, precision=None if precision == "auto" else precision,
                engine=engine, levels=LEVELS)
        except WeightsError as error:
            raise InputError(str(error)) from None
        except Exception as error:
            if failure := device_failure(error):
                raise failure from error
            raise
    return _networks[key]


class NeuralStage:
    """Runs the network of one size, quality and device.

    It puts together what has one duty each: the bridge places the pixels, the network's thread (NetworkThread) or its graph on
    CUDA (Runner) runs it, and a NeuralPicture makes a picture of the result.  It owns all of them.

    background: capture the graph on another thread and run call by call until it is there (for a window).

    filtered: whether a depth filter ran, which decides the weights.  weights: a file used instead.
    device: auto, cuda or cpu.  ``cuda`` raises DeviceError where CUDA does not work; ``auto`` falls back to the CPU, which
    ``device`` and ``name`` show.  presented: the camera of ``picture``, None while it holds none.
    photographs: what comes over the picture that is presented next; None: nothing.
    """

    def __init__(self, programs: shader.Programs, size: tuple[int, int], quality: str, filtered: bool, weights: str | None,
                 precision: str, device: str, *, background: bool = False):
        self.key: tuple = (quality, filtered, weights, precision, device)
        problem = None if device == "cpu" else cuda_problem()
        if device == "cuda" and problem:
            raise DeviceError(problem, option=Option("--device", "cuda"),
                              remedy=("see `pointglass doctor`, or use ", Option("--device", "cpu")))
        self.device = "cuda" if device != "cpu" and problem is None else "cpu"
        if self.device == "cuda":
            use_matching_device(programs.context)
        self._on_device = on_same_device(self.device)
        self.network = load_network(quality, filtered, weights, precision, self.device)
        self.context = programs.context
        self.presented: object = None
        self.photographs: PhotoColours | None = None
        self._kept: KeptPhotographs | None = None  # of the run under way, where later pictures change the above
        self._keeps = False
        self._shown: np.ndarray | None = None  # of CpuFill, which made the input
        self._thread = NetworkThread()
        self._runner: Runner | BackgroundRunner | None = None
        try:
            if self.device == "cuda":
                self._runner = (BackgroundRunner if background else Runner)(self.network, size[1], size[0])
            self.bridge, self.bridge_problem = make_bridge(programs, size, self.device)
        except Exception as error:
            if self._runner is not None:
                self._runner.release()
            if failure := device_failure(error):
                raise failure from error
            raise
        self._picture = NeuralPicture(programs, size, copied=isinstance(self.bridge, ReadBackBridge))

    @property
    def usable(self) -> bool:
        """Whether no run of it has failed."""
        return self.key != _FAILED

    @property
    def name(self) -> str:
        """Weights, their hash, precision and device; on CUDA how it runs there."""
        return self.network.name + (f", {self._runner.name}" if self._runner is not None else "")

    @property
    def approximations(self) -> list[str]:
        """Approximations of this stage, in words."""
        precision = self.network.precision
        return [] if precision == "fp32" else [f"network in {precision}"]

    @property
    def bridge_name(self) -> str:
        """How pixels are transferred, and why the faster way is not used where there is one."""
        return self.bridge.kind + (f" ({self.bridge_problem})" if self.bridge_problem else "")

    def infer(self) -> Callable[[], float] | None:
        """Runs the network on the fill pass's output.  Returns the result of the bridge's ``run``.

        Raises DeviceError where the GPU failed, was lost or has no memory left.  The stage is then marked as failed, and the
        renderer makes a new one, which finds out what still works.
        """
        try:
            with self._thread.lock, self._on_device():
                return self.bridge.run(self._run)
        except Exception as error:
            self._fail(error)

    def settle(self) -> None:
        """Waits for what is prepared on another thread, so that pictures repeat to the byte from now on."""
        if isinstance(self._runner, BackgroundRunner):
            self._runner.settle()

    @property
    def _run(self) -> Network:
        return self.network if self._runner is None else self._runner

    def _fail(self, error: BaseException) -> NoReturn:
        lost = context_lost(self.context)
        failure = DeviceLostError(LOST) if lost else device_failure(error)
        if failure is None:
            raise error
        self.key = _FAILED
        if failure is error:
            raise failure
        raise failure from error

    @property
    def deferrable(self) -> bool:
        """Whether :meth:`start` can be used: pixels go through host memory.  With a mapped buffer the host never waits."""
        return isinstance(self.bridge, ReadBackBridge)

    def give(self, fill: CpuFill | None) -> None:
        """Says that the input of the next picture is in main memory; None: in the bridge's ``input``."""
        self._shown = None if fill is None else fill.shown
        if isinstance(self.bridge, ReadBackBridge):
            self.bridge.given = None if fill is None else fill.packed

    def start(self, serial: int, wake: Callable[[], None], *, keep: bool = False) -> None:
        """Reads back the fill pass's output and starts the network on its own thread.

        serial: identifies the picture.  wake: called on that thread at the end.  keep: for :meth:`finish_into`.
        """
        self._keeps = keep and self.photographs is not None
        if self._keeps and self.photographs is not None:
            self._kept = self._kept or KeptPhotographs(self.context, self.photographs)
            self._kept.take(self.photographs)
        assert isinstance(self.bridge, ReadBackBridge)
        packed, run = self.bridge.sent().copy("K"), self._run

        def work() -> np.ndarray:
            import torch

            with self._on_device():
                return run_on_host(run, torch.from_numpy(packed))

        self._thread.start(serial, work, wake)

    def finish(self, serial: int, filled) -> float | None:
        """Presents the picture ``serial`` if its network has ended; ``filled`` is of the same picture.

        Returns the network's milliseconds, or None while it runs.  Raises DeviceError as :meth:`infer`.
        """
        milliseconds = self._take(serial)
        if milliseconds is not None:
            self.present(filled)
        return milliseconds

    def finish_into(self, serial: int, target: "moderngl.Texture") -> bool:
        """Writes the picture ``serial`` into ``target`` if its network has ended: without the bound of its filled picture,
        which may be gone.  Returns whether it did.  Raises DeviceError as :meth:`infer`."""
        if self._take(serial) is None:
            return False
        assert isinstance(self.bridge, ReadBackBridge)
        self._picture.write_into(target, self.bridge, self._kept if self._keeps else None)
        return True

    def _take(self, serial: int) -> float | None:
        """Uploads the result of ``serial`` and returns the network's milliseconds; None while it runs."""
        done = self._thread.take(serial)
        if done is None:
            return None
        if done.error is not None:
            self._fail(done.error)
        assert isinstance(self.bridge, ReadBackBridge) and done.made is not None
        self.bridge.made = done.made
        return done.milliseconds

    @property
    def busy(self) -> bool:
        """Whether its network runs, or is about to, for a picture that may be out of date."""
        return self._thread.busy

    def drop(self) -> None:
        """Forgets a picture whose network has not begun or whose result was not presented; interrupts a run under way."""
        self._thread.drop()

    def present(self, filled) -> None:
        """Writes the network's pixels into ``picture``, with the filled picture's alpha, and over them the photographs."""
        self._picture.show(self.bridge, filled, self.photographs, self._shown)

    @property
    def picture(self) -> "moderngl.Texture":
        """RGBA8, what was presented last."""
        return self._picture.texture

    @property
    def photo_share(self) -> "moderngl.Texture | None":
        """R8: how much of each pixel of ``picture`` is from photographs; None: nothing."""
        return self._picture.photo_share

    def release(self) -> None:
        self._thread.close()
        self.bridge.release()
        if self._runner is not None:
            with self._thread.lock, self._on_device():  # a run under way needs it to its end
                self._runner.release()
        self._picture.release()
        if self._kept is not None:
            self._kept.release()
