"""The neural view: filled pixels through the bridge and the network into a picture.  torch is imported here, at first use."""

from pathlib import Path

from model.reconstruct import Reconstructor, cuda_problem
from model.weights import WeightsError
from viewer.errors import DeviceError, InputError
from viewer.render import shader
from viewer.render.bridge import make_bridge

_networks: dict[tuple[str, bool, str | None, str, str], Reconstructor] = {}


def load_network(quality: str, filtered: bool, weights: str | None, precision: str, device: str) -> Reconstructor:
    """A network, loaded once a process.  weights: a file in place of the shipped ones.  Raises InputError where there are no
    such weights."""
    key = (quality, filtered, weights, precision, device)
    if key not in _networks:
        try:
            path = Path(weights) if weights else None
            _networks[key] = Reconstructor(
                quality, filtered=filtered, device=device, weights=path, precision=None if precision == "auto" else precision)
        except WeightsError as error:
            raise InputError(str(error)) from None
    return _networks[key]


class NeuralStage:
    """Owns the bridge and the picture for one size, quality and device.

    filtered: whether a depth filter ran, which decides the weights; weights: a file of one's own instead.
    device: auto, cuda or cpu; ``cuda`` where CUDA does
    not work raises DeviceError; ``auto`` falls back to the CPU, which ``device`` and ``name`` show.
    """

    def __init__(self, programs: shader.Programs, size: tuple[int, int], quality: str, filtered: bool, weights: str | None,
                 precision: str, device: str):
        self.key = (quality, filtered, weights, precision, device)
        problem = None if device == "cpu" else cuda_problem()
        if device == "cuda" and problem:
            raise DeviceError(f"--device cuda: {problem}; see `pointglass doctor`, or use --device cpu")
        self.device = "cuda" if device != "cpu" and problem is None else "cpu"
        self.network = load_network(quality, filtered, weights, precision, self.device)
        self.context = programs.context
        self.bridge, self.bridge_problem = make_bridge(self.context, size, self.device)
        self.picture = self.context.texture(size, 4, dtype="f1")
        self._unpack = programs.compute("network_output.comp")

    @property
    def name(self) -> str:
        """Weights, their hash, precision and device."""
        return self.network.name

    @property
    def approximations(self) -> list[str]:
        """What is not exact about this stage."""
        precision = self.network.precision
        return [] if precision == "fp32" else [f"network in {precision}"]

    @property
    def bridge_name(self) -> str:
        """How pixels travel, and why not the better way where there is one."""
        return self.bridge.kind + (f" ({self.bridge_problem})" if self.bridge_problem else "")

    def infer(self) -> None:
        """Runs the network on what the fill pass wrote."""
        self.bridge.run(self.network)

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
        self.picture.release()
