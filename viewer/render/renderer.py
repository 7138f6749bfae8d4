"""``render(scene, camera, settings) -> Frame``: pure, the same arguments give the same bytes.

No history and no timing changes a picture unless the caller passes a history; what a window adds (adaptive quality, refinement)
lives around this module.  A Renderer owns the scene's points on the GPU and the passes of the last picture size.
"""

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from ...model.common.process.memory import give_back
from ...model.reference.soft_z import SoftZ
from ..common.errors import DeviceLostError, InputError
from ..common.text import bytes_text, counted
from ..picture.edits import Edits
from ..picture.settings import MEMORY, Memory, Settings
from ..picture.views import VIEWS, passes_of
from .culling.cull import Culler, DrawList
from .culling.enclosed_directions import OPEN, Directions, Enclosure
from .culling.occlusion import GAP_LEVELS, History, Occlusion, may_hide
from .deferred_network import finish_network, start_network
from .device.context import LOST, context_lost, describe_device
from .device.device_failure import DeviceMemoryError
from .device.shader import Programs
from .frame import Frame, FrameFacts
from .passes.fill import Fill
from .passes.filter import DepthFilter
from .passes.filter_cpu import CpuDepthFilter
from .passes.noise_level import NoiseLevel
from .raster.choose_raster import RASTERISERS as RASTERISERS
from .raster.choose_raster import fastest, make_rasteriser
from .raster.edit_block import block_of, without_clipped_cells
from .raster.points import PointPages
from .raster.raster import Rasteriser
from .raster.raster_compute import ComputeRasteriser
from .raster.raster_cpu import CpuRasteriser
from .raster.stations import Confidence, ScannerPositions, uses_station_weights
from .sized_passes import SizedPasses
from .stage_times import Stages

if TYPE_CHECKING:
    import moderngl

    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from .device.device_class import Workgroup
    from .network.neural import NeuralStage

_WORTH_HALVING = 64 << 20
"""Bytes of points below which giving half of them back is not tried: a choice."""

log = logging.getLogger(__name__)


class Renderer(SizedPasses):
    """Draws one scene.

    raster, device: used where the settings say ``auto``.  memory: limits for the points.  wake: called on another thread when
    points have arrived that a streamed picture lacked, or a network has ended.  kept_sizes: picture sizes besides the last one
    whose passes are kept, for callers that alternate between sizes.
    """

    def __init__(self, context: "moderngl.Context", scene: "Scene", *, raster: str = "auto", device: str = "auto",
                 memory: Memory = MEMORY, wake: Callable[[], None] = lambda: None, kept_sizes: int = 0):
        super().__init__(kept_sizes)
        self.context, self.scene = context, scene
        self.device = describe_device(context)
        self._raster, self._device = raster, device
        self._workgroup: Workgroup | None = None
        self._programs = Programs(context)
        self._culler = Culler(scene)
        self._enclosure = Enclosure(scene)
        self._scanner_positions = ScannerPositions(scene)
        self._make_pages = partial(PointPages, context, scene, self.device.storage_limit, software=self.device.software,
                                   read_ahead=memory.read_ahead, wake=wake)
        self.pages = self._make_pages(budget=memory.gpu)
        self._stages = Stages(context, software=self.device.software)
        self._wake, self._serial = wake, 0

    @property
    def metre(self) -> float:
        """File units in a metre; 1 where the file does not say."""
        metres = self.scene.meta.get("metres_per_unit")
        return 1.0 / metres if metres else 1.0

    def render(self, camera: "Camera", settings: Settings, views: tuple[str, ...] | None = None,
               history: Occlusion | None = None, *, streaming: bool = False, defer_network: bool = False,
               edits: Edits | None = None) -> Frame:
        """Makes the given views (default: that of the settings) of one camera.

        history: visibility in the previous frame, so that hidden cells need not be drawn.  It is used and updated where this
        cannot change the picture (compute rasteriser, no raw view), and otherwise ignored.
        streaming: do not wait for points that are not on the GPU yet.
        edits: clips, hidden stations and the colours of points; None: every point as it is.
        defer_network: start the network on its own thread and return without the neural view, which :meth:`finish_network`
        adds later; it is not started while points are missing.  The fact ``network_pending`` says whether it runs.  The neural
        view is there at once where pixels are mapped, or where one of the same camera still exists.

        Where the device runs out of memory, half of the points' memory is given back and the picture is made again.
        Raises InputError for an unknown view, DeviceError where the device cannot make this picture, DeviceLostError where it
        was reset or hangs.
        """
        views = (settings.view,) if views is None else views
        for view in views:
            if view not in VIEWS:
                raise InputError(f"view {view!r}: expected one of {', '.join(VIEWS)}")
        edits = None if edits is None else edits.shown_in(views)
        while True:
            try:
                frame = self._render(camera, settings, views, history, edits, streaming=streaming, defer_network=defer_network)
                self._check_memory()
                return frame
            except DeviceMemoryError as error:
                if not self._halve_points():
                    raise
                log.warning("%s; continuing with %s of memory for points", error, bytes_text(self.pages.budget))

    def _render(self, camera: "Camera", settings: Settings, views: tuple[str, ...], history: Occlusion | None,
                edits: Edits | None, *, streaming: bool, defer_network: bool) -> Frame:
        self._serial += 1
        passes = passes_of(views)
        for stage in self._networks():
            stage.drop()  # what it may still run is a picture that this one replaces
        if not self.device.software and context_lost(self.context):
            raise DeviceLostError(LOST)
        self._resize((camera.width, camera.height), self.device.texture_limit)
        if "network" in passes:  # before anything is drawn
            from .network.bridge import check_room

            check_room(self.device, self._size)
        stages = self._stages
        stages.begin()
        draws: list[DrawList] = []
        stages.run("cull", lambda: draws.append(self._culler.select(camera, settings.lod)))
        draw = draws[0] if edits is None else without_clipped_cells(draws[0], edits, self.scene)
        soft = self._soft_z(settings)
        if edits is not None and edits.recolours:
            soft = replace(soft, unlit=False)  # a black attribute is a colour
        weighted = uses_station_weights(settings, self._scanner_positions)
        stations = self._scanner_positions.seen_from(camera) if weighted else None
        rasteriser = self._choose(settings, draw, camera, soft, stations, streaming)
        wanted = self._history(history, settings, views, rasteriser)
        used_history: list[bool] = []
        stages.run("raster", lambda: used_history.append(rasteriser.run(
            self.pages, draw, camera, soft, self.pages.prepare(draw.first, draw.count, streaming=streaming),
            history=wanted, stations=stations,
            edits=None if edits is None else block_of(edits, self.scene, camera))))
        pages, textures = self.pages, {"raw": rasteriser.colour}
        drawn = draw.points - pages.missing - pages.left_out - pages.lost
        facts = FrameFacts(
            raster=rasteriser.kind, points_drawn=drawn, points_missing=pages.missing, points_total=self.scene.count,
            cells_drawn=len(draw.cells), cells_total=len(self.scene.cell_coords), points_gpu_bytes=pages.nbytes,
            points_gpu_budget=pages.budget, points_gpu_budget_source=pages.budget_source, opengl=self.device.renderer,
            stations="weighed" if weighted else "equal",  # a value of stats.json, kept
            approximations=(*self._approximations(settings), *pages.approximations),
        )  # fmt: skip
        if used_history[0] and rasteriser.hider is not None:
            hider = rasteriser.hider
            facts = replace(facts, occlusion=cache(partial(hider.tally, hider.serial)),  # once, when asked for
                            approximations=(*facts.approximations, "hidden cells skipped"))
        mask = None
        if "filter" in passes:
            steps: list[DepthFilter | CpuDepthFilter] = []
            stages.run("filter", lambda: steps.append(self._filtered(settings, rasteriser)))
            textures["filtered"], mask = steps[0].filtered, steps[0].mask
            if "fill" in passes:
                facts = self._fill_in(camera, settings, edits, rasteriser, mask, facts, textures,
                                      neural="network" in passes, defer_network=defer_network, streaming=streaming)
        stages.end()
        return Frame(camera, {v: textures[v] for v in views if v in textures}, rasteriser.depth, mask, facts, stages.times)

    def _fill_in(self, camera: "Camera", settings: Settings, edits: Edits | None, rasteriser: Rasteriser,
                 mask: "moderngl.Texture", facts: FrameFacts, textures: dict, *, neural: bool, defer_network: bool,
                 streaming: bool) -> FrameFacts:
        """Adds the filled view, and the neural one, to ``textures``; returns ``facts`` with what ran."""
        stages = self._stages
        network = self._neural_for(settings, background=defer_network or streaming) if neural else None
        fill = self._fill = self._fill or Fill(self._programs, self._size)
        colour, confidence = self._fill_input(rasteriser, mask)
        level = None
        if network and (noise := self._noise_level()):
            stages.run("noise", lambda: noise.run(
                rasteriser.colour, rasteriser.depth, rasteriser.weight, confidence, camera=camera,
                weighted=rasteriser.weighted, detail=settings.detail))
            level = noise.level
        stages.run("fill", lambda: fill.run(
            colour, confidence, rasteriser.depth, noise=level,
            camera=camera, around=self._directions(camera, edits), spacing=self.scene.spacing,
            network=network.bridge.input if network else None))
        textures["filled"] = fill.filled
        if network is None:
            return facts
        pending = None
        if defer_network and network.deferrable:
            pending = start_network(network, camera, stages, textures, serial=self._serial, wake=self._wake,
                                    missing=self.pages.missing)
        else:
            network.drop()
            if not (defer_network or streaming):
                network.settle()
            stages.run("network", network.infer)
            stages.run("present", lambda: network.present(fill.filled))
            network.presented = camera.key
            textures["neural"] = network.picture
        return replace(facts, device=network.device, network=network.name, bridge=network.bridge_name, network_pending=pending,
                       approximations=(*facts.approximations, *network.approximations))

    def finish_network(self, frame: Frame) -> bool:
        """Adds the neural view to a frame that was rendered with ``defer_network``, if its network has ended.

        Returns whether it was added: False while the network runs, and where another picture was rendered since.
        Raises DeviceError where the network failed.
        """
        return finish_network(self._neural, self._fill, frame, self._serial)

    def prefetch(self, camera: "Camera", settings: Settings) -> int:
        """Starts loading the points of a future picture to the GPU, as many as one frame may upload; returns how many are
        still missing."""
        draw = self._culler.select(camera, settings.lod)
        self.pages.prepare(draw.first, draw.count, streaming=True)
        return self.pages.missing

    def _directions(self, camera: "Camera", edits: Edits | None) -> Directions:
        """What separates holes from background: the scan's surfaces; the picture alone where edits drop points of them."""
        around = self._enclosure.around(camera.position)
        return Directions(np.full_like(around.closed, OPEN), None) if edits is not None and edits.drops else around

    def _fill_input(self, rasteriser: Rasteriser, mask: "moderngl.Texture") -> "tuple[moderngl.Texture, moderngl.Texture]":
        """Colours that the fill starts from, and the weight of each pixel: the raw picture and the keep-mask, or, of weighted
        points, the toned picture and the confidence."""
        if not rasteriser.weighted:
            return rasteriser.colour, mask
        self._confidence = self._confidence or Confidence(self._programs, self._size)
        self._confidence.run(rasteriser.colour, rasteriser.weight, mask)
        return self._confidence.toned, self._confidence.confidence

    def _noise_level(self) -> NoiseLevel | None:
        """None where the scan's noise is unknown: the network's noise input is then zero."""
        if self._noise is None and self.scene.noise is not None:
            self._noise = NoiseLevel(self._programs, self._size, self.scene.noise)
        return self._noise

    def _soft_z(self, settings: Settings) -> SoftZ:
        """The depth tolerance; a benchmark replaces it."""
        return SoftZ.preset(settings.soft_z, self.scene.spacing, self.metre, unlit=self.scene.unlit)

    def _history(self, memory: Occlusion | None, settings: Settings, views: tuple[str, ...], rasteriser: Rasteriser
                 ) -> History | None:
        if memory is None or not rasteriser.can_hide or not may_hide(settings, views):
            return None
        step = self._filter_for(settings, rasteriser)
        assert isinstance(step, DepthFilter)  # behind every rasteriser that can hide cells
        return History(memory, self.scene, partial(step.closing, strength=settings.filter_strength, levels=GAP_LEVELS))

    def _approximations(self, settings: Settings) -> list[str]:
        return [] if settings.lod is None else [f"level of detail: {counted(settings.lod, 'point')} per pixel"]

    def _choose(self, settings: Settings, draw: DrawList, camera: "Camera", soft: SoftZ, stations: "np.ndarray | None",
                streaming: bool) -> Rasteriser:
        """The rasteriser asked for; ``auto``: ``cpu`` in software OpenGL, on a GPU the one that measured fastest, fixed for
        this renderer's life."""
        wanted = settings.raster if settings.raster != "auto" else self._raster
        if wanted == "auto" and self.device.software:
            wanted = self._raster = "cpu"
        if wanted == "auto":
            best = fastest(self._programs, self._size, self.device, self.pages, draw, camera, soft, stations,
                           streaming=streaming)
            wanted = self._raster = best.kind
            self._workgroup = best.workgroup if isinstance(best, ComputeRasteriser) else None
            self._rasterisers[wanted] = best
        if wanted not in self._rasterisers:
            self._rasterisers[wanted] = make_rasteriser(wanted, self._workgroup, self._programs, self._size, self.device)
        return self._rasterisers[wanted]

    def _filtered(self, settings: Settings, rasteriser: Rasteriser) -> DepthFilter | CpuDepthFilter:
        """Runs the depth filter and returns it."""
        step = self._filter_for(settings, rasteriser)
        if isinstance(step, CpuDepthFilter):
            assert isinstance(rasteriser, CpuRasteriser)
            step.run(rasteriser, strength=settings.filter_strength)
        else:
            step.run(rasteriser.colour, rasteriser.depth, strength=settings.filter_strength, metre=self.metre)
        return step

    def _filter_for(self, settings: Settings, rasteriser: Rasteriser) -> DepthFilter | CpuDepthFilter:
        """The depth filter of these settings; behind the processor's rasteriser its own, where it knows the preset."""
        here = isinstance(rasteriser, CpuRasteriser) and settings.filter == CpuDepthFilter.preset
        current, wanted = self._filter, (here, settings.filter, settings.filter_levels)
        if current is None or (isinstance(current, CpuDepthFilter), current.preset, current.wanted_levels) != wanted:
            if current is not None:
                current.release()
            current = self._filter = (CpuDepthFilter(self.context, self._size, settings.filter_levels) if here else
                                      DepthFilter(self._programs, self._size, settings.filter, settings.filter_levels))
        return current

    def _neural_for(self, settings: Settings, *, background: bool) -> "NeuralStage":
        """The network's stage.  background: what can be prepared on another thread is, and the first pictures do without."""
        from .network.neural import NeuralStage

        device = settings.device if settings.device != "auto" else self._device
        key = (settings.quality, settings.filter != "off", settings.weights, settings.precision, device)
        if self._neural is None or self._neural.key != key:
            self._neural, self._spare_neural = self._spare_neural, self._neural
            if self._spare_neural is not None and not (self._kept_sizes and self._spare_neural.usable):
                self._spare_neural.release()
                self._spare_neural = None
            if self._neural is not None and self._neural.key != key:
                self._neural.release()
                self._neural = None
            self._neural = self._neural or NeuralStage(self._programs, self._size, *key, background=background)
        return self._neural

    def _check_memory(self) -> None:
        """Raises DeviceMemoryError where OpenGL had no memory for the passes of a new picture size."""
        if self.device.software or not self._allocated:
            return
        self._allocated = False
        if self.context.error == "GL_OUT_OF_MEMORY":
            raise DeviceMemoryError(f"the GPU has no memory left for a picture of {self._size[0]}x{self._size[1]}; choose a "
                                    "smaller --size, or lower --gpu-memory")

    def _halve_points(self) -> bool:
        """Frees the passes and makes the points' pages again with half their budget; False where that cannot help."""
        self._release_passes()
        held, budget = self.pages.nbytes, self.pages.budget
        if held < _WORTH_HALVING:
            return False
        self.pages.release()
        try:
            self.pages = self._make_pages(budget=min(budget, held) // 2)
        except InputError:  # less than the least
            self.pages = self._make_pages(budget=budget)
            return False
        self.pages.budget_source = "halved, the GPU ran out of memory"
        return True

    def release(self) -> None:
        """Frees everything on the GPU, and returns main memory that its pictures held to the system."""
        self._release_passes()
        self._stages.release()
        self.pages.release()
        self._programs.release()
        give_back()
