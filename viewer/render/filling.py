"""From the filtered picture to the filled one and the network's input: noise level, averaging of sparse points, fill.

By compute passes, or in compiled loops where OpenGL is software and the processor rasterises: both make the same bytes, and
llvmpipe takes four times as long (viewer/bench/README.md).
"""

from functools import partial
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
    from .passes.filter import DepthFilter
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
    once = partial(_fill_once, passes, stages, scene, frame, rasteriser, step, settings, around=around, software=software,
                   with_depth=with_depth)
    shown = widening_of(settings, edits, scene.noise, FOR_PICTURE)
    if network is not None:
        texture = once(network, averaging=FOR_NETWORK, widened=widening_of(settings, edits, scene.noise, FOR_NETWORK),
                       stage="input " if shown else "")
        if not shown:
            return texture
    return once(None, averaging=FOR_PICTURE, widened=shown)


def _fill_once(passes: "SizedPasses", stages: "Stages", scene: "Scene", frame: "Frame", rasteriser: "Rasteriser",
               step: "DepthFilter | CpuDepthFilter", settings: "Settings", network: "NeuralStage | None", *,
               around: "Directions", software: bool, with_depth: bool, averaging: "Averaging", widened: float, stage: str = ""
               ) -> "moderngl.Texture":
    """One run, averaged as ``averaging`` says if ``widened``, of its widening_of, is above 0.  stage: prefix of the stages'
    names."""
    # loops: where the network's input stays in main memory, too
    here = software and isinstance(rasteriser, CpuRasteriser) and (network is None or network.deferrable)
    fill, camera, depth = passes.fill_pass(here=here), frame.camera, frame.ratio_depth
    assert depth is not None
    colour, weight = passes.fill_input(rasteriser, step.mask)
    noise = passes.noise_level(scene.noise) if network or widened else None
    measured, options = weight, {"camera": camera, "weighted": rasteriser.weighted}
    if noise and (widened or not here):
        given = rasteriser.colour, rasteriser.depth, rasteriser.weight, weight
        with stages(stage + ("noise" if not here else "averaging")):
            if widened:
                noise.run(*given, **options, detail=1.0)
                weight = passes.averaged(weight, noise.level, depth, 1.0 / (camera.fx * scene.spacing), averaging)
            if network and not here and not (widened and settings.detail == 1.0):
                noise.run(*given, **options, detail=settings.detail)
    more = {"camera": camera, "around": around, "spacing": scene.spacing, "with_depth": with_depth, "widened": widened}
    loops = fill if here and isinstance(fill, CpuFill) else None
    if loops is not None and isinstance(rasteriser, CpuRasteriser):
        levels = None
        weights = _weights(step.kept if isinstance(step, CpuDepthFilter) and weight is step.mask else
                           _values(weight, np.uint8 if weight.dtype == "f1" else np.float32))
        if noise and network:
            with stages(f"{stage}noise"):
                levels = noise.run_here(rasteriser.colours, rasteriser.depths, rasteriser.weights, weights, **options,
                                        detail=settings.detail)
        with stages(f"{stage}fill"):
            colours = rasteriser.colours if measured is step.mask else _values(colour, np.uint32)
            depths = rasteriser.depths if depth is rasteriser.depth else _values(depth, np.float32)
            loops.run_here(colours, weights, depths, noise=levels, network=network is not None, **more)
    else:
        with stages(f"{stage}fill"):
            fill.run(colour, weight, depth, noise=noise.level if noise else None,
                     network=network.bridge.input if network else None, **more)
    if network is not None:
        network.give(loops)
    return fill.filled


def _weights(values: np.ndarray) -> np.ndarray:
    return values if values.dtype == np.float32 else np.multiply(values, _BYTE, dtype=np.float32)


def _values(texture: "moderngl.Texture", kind: type) -> np.ndarray:
    """(P,) of a texture: a number of this kind for each pixel.  Writable, as other arrays: numba compiles loops for either."""
    made = np.empty(texture.width * texture.height, kind)
    texture.read_into(made, alignment=1)
    return made
