"""The passes of a Renderer whose textures have the picture's size: of the present size, and of a few others that are kept."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import DeviceError, Option
from .passes.averaging import AveragingPass
from .passes.depth_ratios import ParallelDepth, middle_depth
from .passes.fill import Fill
from .passes.fill_cpu import CpuFill
from .passes.filter import DepthFilter
from .passes.filter_cpu import CpuDepthFilter
from .passes.noise_level import NoiseLevel
from .photographs.photo_pass import PhotoPass
from .raster.raster_cpu import CpuRasteriser
from .raster.stations import Confidence

if TYPE_CHECKING:
    import moderngl

    from ...model.appearance.noise import NoiseModel
    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from ..picture.settings import Settings
    from .device.shader import Programs
    from .frame import Frame
    from .network.neural import NeuralStage
    from .photographs.scene_photographs import ScenePhotographs
    from .raster.raster import Rasteriser
    from .stage_times import Stages


@dataclass(slots=True)
class SizedPasses:
    """The passes of one picture size (width, height), each made when it is first needed.

    rasterisers: by kind.  spare_neural: the network of another quality, for callers that alternate between two.
    """

    programs: "Programs"
    size: tuple[int, int]
    rasterisers: "dict[str, Rasteriser]" = field(default_factory=dict)
    filter: "DepthFilter | CpuDepthFilter | None" = None
    fill: Fill | None = None
    confidence: Confidence | None = None
    noise: NoiseLevel | None = None
    averaging: AveragingPass | None = None
    photos: PhotoPass | None = None
    parallel: ParallelDepth | None = None
    neural: "NeuralStage | None" = None
    spare_neural: "NeuralStage | None" = None

    @property
    def networks(self) -> "list[NeuralStage]":
        """The networks' stages that there are."""
        return [stage for stage in (self.neural, self.spare_neural) if stage is not None]

    def filter_for(self, settings: "Settings", rasteriser: "Rasteriser") -> "DepthFilter | CpuDepthFilter":
        """The depth filter of these settings; behind the processor's rasteriser its own, where it knows the preset."""
        here = isinstance(rasteriser, CpuRasteriser) and settings.filter == CpuDepthFilter.preset
        current, wanted = self.filter, (here, settings.filter, settings.filter_levels)
        if current is None or (isinstance(current, CpuDepthFilter), current.preset, current.wanted_levels) != wanted:
            if current is not None:
                current.release()
            current = self.filter = (CpuDepthFilter(self.programs.context, self.size, settings.filter_levels) if here else
                                     DepthFilter(self.programs, self.size, settings.filter, settings.filter_levels))
        return current

    def depth_for(self, rasteriser: "Rasteriser", camera: "Camera", scene: "Scene") -> "moderngl.Texture":
        """The depth that filter, fill and eye-dome lighting take: the rasteriser's, or of an orthographic camera what stands
        for it (viewer.render.passes.depth_ratios)."""
        if camera.orthographic is None:
            return rasteriser.depth
        self.parallel = self.parallel or ParallelDepth(self.programs, self.size)
        return self.parallel.run(rasteriser.depth, camera, middle_depth(camera, scene))

    def filtered(self, settings: "Settings", rasteriser: "Rasteriser", depth: "moderngl.Texture", metre: float
                 ) -> "DepthFilter | CpuDepthFilter":
        """Runs the depth filter and returns it.  depth: of :meth:`depth_for`.  metre: file units in a metre."""
        step = self.filter_for(settings, rasteriser)
        if isinstance(step, CpuDepthFilter):
            assert isinstance(rasteriser, CpuRasteriser)
            same = depth is rasteriser.depth
            depths = rasteriser.depths if same else np.frombuffer(depth.read(alignment=1), np.float32)
            step.run(rasteriser, depths, strength=settings.filter_strength)
        else:
            step.run(rasteriser.colour, depth, strength=settings.filter_strength, metre=metre)
        return step

    def fill_input(self, rasteriser: "Rasteriser", mask: "moderngl.Texture") -> "tuple[moderngl.Texture, moderngl.Texture]":
        """Colours that the fill starts from, and the weight of each pixel: the raw picture and the keep-mask, or, of weighted
        points, the toned picture and the confidence."""
        if not rasteriser.weighted:
            return rasteriser.colour, mask
        self.confidence = self.confidence or Confidence(self.programs, self.size)
        self.confidence.run(rasteriser.colour, rasteriser.weight, mask)
        return self.confidence.toned, self.confidence.confidence

    def fill_pass(self, *, here: bool = False) -> Fill:
        """The fill; ``here``: by loops of the processor, CpuFill, which can also run the passes."""
        if self.fill is None or (here and not isinstance(self.fill, CpuFill)):
            if self.fill is not None:
                self.fill.release()
            self.fill = (CpuFill if here else Fill)(self.programs, self.size)
        return self.fill

    def add_photographs(self, frame: "Frame", photographs: "ScenePhotographs", numbers: list[int],
                        network: "NeuralStage | None", stages: "Stages") -> None:
        """Colours the filled picture from these photographs, and lets them come over that of ``network``; ``frame`` says so
        then."""
        if numbers:
            fill = self.fill_pass()
            assert fill.depth is not None and frame.mask_texture is not None
            self.photos = self.photos or PhotoPass(self.programs, self.size)
            with stages("photographs"):
                self.photos.run(fill.filled, fill.depth, frame.mask_texture, frame.camera, photographs, numbers,
                                neural=network is not None)
            frame.photo_shares["filled"], frame.facts = self.photos.share, replace(frame.facts, photographs=len(numbers))
        if network is not None:
            network.photographs = self.photos if numbers else None

    @property
    def averaging_pass(self) -> AveragingPass:
        """Averaging of the points of a noisy scan."""
        self.averaging = self.averaging or AveragingPass(self.programs, self.size)
        return self.averaging

    def noise_level(self, noise: "NoiseModel | None") -> NoiseLevel | None:
        """noise: of the scene.  None where it is unknown: the network's noise input is then zero."""
        if self.noise is None and noise is not None:
            self.noise = NoiseLevel(self.programs, self.size, noise)
        return self.noise

    def neural_for(self, settings: "Settings", device: str, *, background: bool, keeps_two: bool) -> "NeuralStage":
        """The network's stage.  device: auto, cuda or cpu.  background: what can be prepared on another thread is, and the
        first pictures do without.  keeps_two: the one used before stays for a caller that returns to it."""
        from .network.neural import NeuralStage

        key = (settings.quality, settings.filter != "off", settings.weights, settings.precision, device)
        if self.neural is None or self.neural.key != key:
            self.neural, self.spare_neural = self.spare_neural, self.neural
            if self.spare_neural is not None and not (keeps_two and self.spare_neural.usable):
                self.spare_neural.release()
                self.spare_neural = None
            if self.neural is not None and self.neural.key != key:
                self.neural.release()
                self.neural = None
            self.neural = self.neural or NeuralStage(self.programs, self.size, *key, background=background)
        return self.neural

    def release(self) -> None:
        """Frees all of them."""
        singles = self.filter, self.fill, self.confidence, self.noise, self.averaging, self.photos, self.parallel
        for made in (*self.rasterisers.values(), *singles, *self.networks):
            if made is not None:
                made.release()
        self.rasterisers = {}
        self.filter = self.fill = self.confidence = self.noise = self.averaging = self.photos = self.parallel = None
        self.neural = self.spare_neural = None


class KeptPasses:
    """The passes of the present picture size, ``present``, and of ``kept_sizes`` others.

    limit: pixels along a side of a texture.  allocated: whether textures may have been made since this was last cleared.
    """

    def __init__(self, programs: "Programs", limit: int, kept_sizes: int):
        self._programs, self._limit, self.kept_sizes = programs, limit, kept_sizes
        self.present = SizedPasses(programs, (0, 0))
        self._kept: dict[tuple[int, int], SizedPasses] = {}
        self.allocated = False

    @property
    def networks(self) -> "list[NeuralStage]":
        """The networks' stages of every picture size."""
        return [stage for passes in (self.present, *self._kept.values()) for stage in passes.networks]

    def use(self, size: tuple[int, int]) -> SizedPasses:
        """The passes of a picture size (width, height).  Raises DeviceError where the picture is too large."""
        if size == self.present.size:
            return self.present
        if max(size) > self._limit:
            raise DeviceError(f"a picture of {size[0]}x{size[1]} is larger than this device's textures ({self._limit} pixels "
                              "a side)", remedy=("choose a smaller ", Option("--size")))
        if self.present.size != (0, 0):
            self._kept[self.present.size] = self.present
        while len(self._kept) > self.kept_sizes and (oldest := next(iter(self._kept))) != size:
            self._kept.pop(oldest).release()
        self.present, self.allocated = self._kept.pop(size, None) or SizedPasses(self._programs, size), True
        return self.present

    def release(self) -> None:
        """Frees the passes of every size; the next picture makes them again."""
        for passes in (self.present, *self._kept.values()):
            passes.release()
        self.present, self._kept = SizedPasses(self._programs, (0, 0)), {}
