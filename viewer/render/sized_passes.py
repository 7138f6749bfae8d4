"""The passes of a Renderer whose textures have the picture's size: of the present size, and of a few others that are kept."""

from typing import TYPE_CHECKING

from ..common.errors import DeviceError

if TYPE_CHECKING:
    from .network.neural import NeuralStage
    from .passes.fill import Fill
    from .passes.filter import DepthFilter
    from .passes.filter_cpu import CpuDepthFilter
    from .passes.noise_level import NoiseLevel
    from .raster.raster import Rasteriser
    from .raster.stations import Confidence

_NAMES = ("_rasterisers", "_filter", "_fill", "_confidence", "_noise", "_neural", "_spare_neural")
"""Attributes of SizedPasses that belong to one picture size."""


class SizedPasses:
    """Passes by attribute, each made when it is first needed.

    kept_sizes: picture sizes besides the present one whose passes are kept.
    """

    def __init__(self, kept_sizes: int):
        self._rasterisers: dict[str, Rasteriser] = {}
        self._filter: DepthFilter | CpuDepthFilter | None = None
        self._fill: Fill | None = None
        self._confidence: Confidence | None = None
        self._noise: NoiseLevel | None = None
        self._neural: NeuralStage | None = None
        self._spare_neural: NeuralStage | None = None  # of another quality, for callers that alternate between two
        self._size, self._allocated = (0, 0), False
        self._kept_sizes = kept_sizes
        self._kept: dict[tuple[int, int], dict] = {}

    @property
    def network_busy(self) -> bool:
        """Whether a network runs on its own thread, for a picture of any size."""
        return any(stage.busy for stage in self._networks())

    def _networks(self) -> "list[NeuralStage]":
        """The networks' stages of every picture size."""
        kept = (passes[name] for passes in self._kept.values() for name in ("_neural", "_spare_neural"))
        return [stage for stage in (self._neural, self._spare_neural, *kept) if stage is not None]

    def _resize(self, size: tuple[int, int], limit: int) -> None:
        """Uses the passes of a picture size (width, height).  limit: pixels along a side of a texture.

        Raises DeviceError where the picture is larger.
        """
        if size == self._size:
            return
        if max(size) > limit:
            raise DeviceError(
                f"a picture of {size[0]}x{size[1]} is larger than this device's textures ({limit} pixels a side); choose a "
                "smaller --size"
            )
        passes = self._swap_passes({})
        if self._size != (0, 0):
            self._kept[self._size] = passes
        while len(self._kept) > self._kept_sizes and (oldest := next(iter(self._kept))) != size:
            _release(self._kept.pop(oldest))
        self._swap_passes(self._kept.pop(size, {}))
        self._size, self._allocated = size, True

    def _swap_passes(self, passes: dict) -> dict:
        """Uses other passes, by attribute; returns the previous ones."""
        before = {name: getattr(self, name) for name in _NAMES}
        for name in _NAMES:
            setattr(self, name, passes.get(name, {} if name == "_rasterisers" else None))
        return before

    def _release_passes(self) -> None:
        """Frees the passes of every size; the next picture makes them again."""
        for passes in (self._swap_passes({}), *self._kept.values()):
            _release(passes)
        self._kept, self._size = {}, (0, 0)


def _release(passes: dict) -> None:
    for made in (*passes["_rasterisers"].values(), *(passes[name] for name in _NAMES if name != "_rasterisers")):
        if made is not None:
            made.release()
