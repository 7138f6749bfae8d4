"""From the filtered picture to the filled one and the network's input: noise level, averaging of sparse points, fill.

By compute passes, or in compiled loops where OpenGL is software and the processor rasterises: both make the same bytes, and
llvmpipe takes four times as long (viewer/bench/README.md).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...model.reference.fill_constants import FOR_NETWORK, FOR_PICTURE
from .passes.averaging import widening_of
from .passes.fill_cpu import CpuFill
from .passes.filter_cpu import CpuDepthFilter
from .raster.raster_cpu import CpuRasteriser

if TYPE_CHECKING:
    import moderngl

    from ...model.reference.fill_constants import Averaging
    from ..grid.scene import Scene
    from ..picture.edits import Edits
    from ..picture.settings import Settings
    from .culling.enclosed_directions import Directions
    from .frame import Frame
    from .network.neural import NeuralStage
    from .passes.fill import Fill
    from .passes.filter import DepthFilter
    from .passes.noise_level import NoiseLevel
    from .raster.raster import Rasteriser
    from .sized_passes import SizedPasses
    from .stage_times import Stages

_BYTE = np.float32(1.0 / 255.0)


def fill_in(passes: "SizedPasses", stages: "Stages", scene: "Scene", frame: "Frame", rasteriser: "Rasteriser",
            step: "DepthFilter | CpuDepthFilter", settings: "Settings", edits: "Edits | None", network: "NeuralStage | None", *,
            around: "Directions", software: bool, with_depth: bool) -> "moderngl.Texture":
    """The filled view of a frame whose depth filter ``step`` has run; also writes the input of ``network``, where one is given:
    before it, where the two are averaged differently, so that the filled view is the same with and without.

    around: the directions from the camera.  software: whether OpenGL is.  with_depth: whether the fill's depth is made, too.
    """
    filling = _Filling(passes, stages, scene, frame, rasteriser, step, settings, around, with_depth)
    shown = widening_of(settings, edits, scene.noise, FOR_PICTURE)
    if network is not None:
        widened = widening_of(settings, edits, scene.noise, FOR_NETWORK)
        texture = filling.run(network, FOR_NETWORK, widened, "input " if shown else "", software=software)
        if not shown:
            return texture
    return filling.run(None, FOR_PICTURE, shown, software=software)


@dataclass(frozen=True)
class _Filling:
    """What both runs of a picture's fill have in common; as of :func:`fill_in`."""

    passes: "SizedPasses"
    stages: "Stages"
    scene: "Scene"
    frame: "Frame"
    rasteriser: "Rasteriser"
    step: "DepthFilter | CpuDepthFilter"
    settings: "Settings"
    around: "Directions"
    with_depth: bool

    def run(self, network: "NeuralStage | None", averaging: "Averaging", widened: float, stage: str = "", *, software: bool
            ) -> "moderngl.Texture":
        """The filled picture, averaged as ``averaging`` says where ``widened``, its widening_of, is above 0.  stage: prefix of
        the stages' names."""
        # loops: where the network's input stays in main memory, too
        here = software and isinstance(self.rasteriser, CpuRasteriser) and (network is None or network.deferrable)
        fill = self.passes.fill_pass(here=here)
        noise = self.passes.noise_level(self.scene.noise) if network or widened else None
        loops = fill if here and isinstance(fill, CpuFill) else None
        if loops is not None and isinstance(self.rasteriser, CpuRasteriser):
            self._by_loops(loops, self.rasteriser, noise, network, averaging, widened, stage)
        else:
            self._by_passes(fill, noise, network, averaging, widened, stage)
        if network is not None:
            network.give(loops)
        return fill.filled

    @property
    def _depth(self) -> "moderngl.Texture":
        assert self.frame.ratio_depth is not None
        return self.frame.ratio_depth

    @property
    def _feature_scale(self) -> float:
        return 1.0 / (self.frame.camera.fx * self.scene.spacing)

    def _again(self, network: "NeuralStage | None", widened: float) -> bool:
        """Whether the network's noise level is another than the one that averaging takes."""
        return network is not None and not (widened and self.settings.detail == 1.0)

    def _by_loops(self, fill: CpuFill, rasteriser: CpuRasteriser, noise: "NoiseLevel | None", network: "NeuralStage | None",
                  averaging: "Averaging", widened: float, stage: str) -> None:
        colour, weight = self.passes.fill_input(rasteriser, self.step.mask)
        own, camera = weight is self.step.mask, self.frame.camera  # own: without stations the arrays are what is filled
        weights = _weights(self.step.kept if own and isinstance(self.step, CpuDepthFilter) else
                           _values(weight, np.uint8 if weight.dtype == "f1" else np.float32))
        colours = rasteriser.colours if own else _values(colour, np.uint32)
        depths = rasteriser.depths if self._depth is rasteriser.depth else _values(self._depth, np.float32)
        given, levels = (rasteriser.colours, rasteriser.depths, rasteriser.weights, weights), None
        if noise and widened:
            with self.stages(f"{stage}averaging"):
                levels = noise.run_here(*given, camera=camera, weighted=rasteriser.weighted, detail=1.0)
                weights = self.passes.averaging_pass.run_here(weights, levels, depths, self._feature_scale, averaging)
        if noise and self._again(network, widened):
            with self.stages(f"{stage}noise"):
                levels = noise.run_here(*given, camera=camera, weighted=rasteriser.weighted, detail=self.settings.detail)
        with self.stages(f"{stage}fill"):
            fill.run_here(colours, weights, depths, camera=camera, around=self.around, spacing=self.scene.spacing,
                          network=network is not None, noise=levels, with_depth=self.with_depth, widened=widened)

    def _by_passes(self, fill: "Fill", noise: "NoiseLevel | None", network: "NeuralStage | None", averaging: "Averaging",
                   widened: float, stage: str) -> None:
        rasteriser, camera, average = self.rasteriser, self.frame.camera, self.passes.averaging_pass if widened else None
        colour, weight = self.passes.fill_input(rasteriser, self.step.mask)
        given = rasteriser.colour, rasteriser.depth, rasteriser.weight, weight
        if noise:
            with self.stages(f"{stage}noise"):
                if average is not None:
                    noise.run(*given, camera=camera, weighted=rasteriser.weighted, detail=1.0)
                    average.run(weight, noise.level, self._depth, self._feature_scale, averaging)
                    weight = average.averaged
                if self._again(network, widened):
                    noise.run(*given, camera=camera, weighted=rasteriser.weighted, detail=self.settings.detail)
        with self.stages(f"{stage}fill"):
            fill.run(colour, weight, self._depth, camera=camera, around=self.around, spacing=self.scene.spacing,
                     noise=noise.level if noise else None, network=network.bridge.input if network else None,
                     with_depth=self.with_depth, widened=widened)


def _weights(values: np.ndarray) -> np.ndarray:
    return values if values.dtype == np.float32 else np.multiply(values, _BYTE, dtype=np.float32)


def _values(texture: "moderngl.Texture", kind: type) -> np.ndarray:
    """(P,) of a texture: a number of this kind for each pixel.  Writable, as other arrays: numba compiles loops for either."""
    made = np.empty(texture.width * texture.height, kind)
    texture.read_into(made, alignment=1)
    return made
