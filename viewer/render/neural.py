"""The neural view: filled pixels through the bridge and the network into a picture.  torch is imported here, at first use."""

import os
from collections.abc import Callable
from pathlib import Path

from model.engines import ENGINES, Runner
from model.reconstruct import Reconstructor, cuda_problem
from model.weights import WeightsError
from viewer.errors import DeviceError, InputError
from viewer.render import shader
from viewer.render.bridge import Network
from viewer.render.choose_bridge import make_bridge
from viewer.render.context import context_lost
from viewer.render.cuda_bridge import device_failure

ENGINE_VARIABLE = "POINTGLASS_ENGINE"
"""Environment variable that names how the network runs on CUDA (a key of model.engines.ENGINES), for measurements."""

_networks: dict[tuple[str, bool, str | None, str, str], Reconstructor] = {}


def load_network(quality: str, filtered: bool, weights: str | None, precision: str, device: str) -> Reconstructor:
    """A network, loaded once a process.  weights: a file in place of the shipped ones.  Raises InputError where there are no
    such weights."""
    key = (quality, filtered, weights, precision, device)
    if key not in _networks:
        engine = os.environ.get(ENGINE_VARIABLE) or None
        if engine is not None and engine not in ENGINES:
            raise InputError(f"{ENGINE_VARIABLE}={engine}: expected one of {', '.join(ENGINES)}")
        try:
            path = Path(weights) if weights else None
            _networks[key] = Reconstructor(
                quality, filtered=filtered, device=device, weights=path, precision=None if precision == "auto" else precision,
                engine=engine)
        except WeightsError as error:
            raise InputError(str(error)) from None
        except Exception as error:
            if said := device_failure(error):
                raise DeviceError(said) from error
            raise
    return _networks[key]


class NeuralStage:
    """Owns the bridge and the picture for one size, quality and device, and on CUDA the network's graph for that size.

    filtered: whether a depth filter ran, which decides the weights; weights: a file of one's own instead.
    device: auto, cuda or cpu; ``cuda`` where CUDA does
    not work raises DeviceError; ``auto`` falls back to the CPU, which ``device`` and ``name`` show.
    """

    def __init__(self, programs: shader.Programs, size: tuple[int, int], quality: str, filtered: bool, weights: str | None,
                 precision: str, device: str):
        self.key: tuple = (quality, filtered, weights, precision, device)
        problem = None if device == "cpu" else cuda_problem()
        if device == "cuda" and problem:
            raise DeviceError(f"--device cuda: {problem}; see `pointglass doctor`, or use --device cpu")
        self.device = "cuda" if device != "cpu" and problem is None else "cpu"
        self.network = load_network(quality, filtered, weights, precision, self.device)
        self.context = programs.context
        self._unpack = programs.compute("network_output.comp")
        self._runner: Runner | None = None
        try:
            if self.device == "cuda":
                self._runner = Runner(self.network, size[1], size[0])
            self.bridge, self.bridge_problem = make_bridge(programs, size, self.device)
        except Exception as error:
            if self._runner is not None:
                self._runner.release()
            if said := device_failure(error):
                raise DeviceError(said) from error
            raise
        self.picture = self.context.texture(size, 4, dtype="f1")

    @property
    def name(self) -> str:
        """Weights, their hash, precision and device; on CUDA how it runs there."""
        return self.network.name + (f", {self._runner.name}" if self._runner is not None else "")

    @property
    def approximations(self) -> list[str]:
        """What is not exact about this stage."""
        precision = self.network.precision
        return [] if precision == "fp32" else [f"network in {precision}"]

    @property
    def bridge_name(self) -> str:
        """How pixels travel, and why not the better way where there is one."""
        return self.bridge.kind + (f" ({self.bridge_problem})" if self.bridge_problem else "")

    def infer(self) -> Callable[[], float] | None:
        """Runs the network on what the fill pass wrote.  Returns what the bridge does.

        Raises DeviceError where the GPU failed, was lost or has no memory left; asked for again, the stage is then made anew,
        which finds out what still works.
        """
        network: Network = self.network if self._runner is None else self._runner
        try:
            return self.bridge.run(network)
        except Exception as error:
            lost = context_lost(self.context)
            said = "the graphics driver was reset; start pointglass again" if lost else device_failure(error)
            if said is None:
                raise
            self.key = ("failed",)
            raise DeviceError(said) from error

    def present(self, filled) -> None:
        """Writes the network's pixels into ``picture``, with the filled picture's alpha."""
        self.bridge.output.bind_to_storage_buffer(shader.BINDINGS["NETWORK"])
        filled.use(0)
        self._unpack["filled"] = 0
        self.picture.bind_to_image(0, read=False, write=True)
        self._unpack.run(*shader.groups(*self.picture.size))
        self.context.memory_barrier()

    def release(self) -> None:
        self.bridge.release()
        if self._runner is not None:
            self._runner.release()
        self.picture.release()
