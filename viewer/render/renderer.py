"""``render(scene, camera, settings) -> Frame``: pure, the same arguments give the same bytes.

No history changes a picture unless the caller passes one, and no timing but this: a GPU chooses its rasteriser by the time that
each takes (``choice``), and two of them may differ there in a few pixels.  What a window adds (adaptive quality, refinement)
lives around this module.  A Renderer owns the scene's points on the GPU and the passes of the last picture size.
"""

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...model.common.process.memory import give_back
from ...model.reference.soft_z import SoftZ
from ..common.errors import DeviceLostError, InputError, Option
from ..common.text import bytes_text
from ..grid.records.levelled_marks import levelled_marks
from ..grid.records.point_marks import marks_of
from ..picture.edits import Edits
from ..picture.settings import MEMORY, Memory, Settings
from ..picture.views import VIEWS, passes_of
from .culling.cull import Culler, DrawList
from .culling.enclosed_directions import OPEN, Directions, Enclosure
from .culling.occlusion import GAP_LEVELS, History, Occlusion, may_hide
from .deferred_network import NetworkRuns
from .device.context import CONTEXT_LOST, LOST, describe_device
from .device.device_failure import DeviceMemoryError
from .device.shader import Programs
from .filling import fill_in
from .frame import Frame, FrameFacts, raster_facts
from .passes.filter import DepthFilter
from .photographs.scene_photographs import ScenePhotographs
from .raster.choose_raster import RASTERISERS as RASTERISERS
from .raster.choose_raster import RasterChoice, fastest
from .raster.edit_block import block_of, without_clipped_cells
from .raster.mark_pages import MarkPages
from .raster.points import PointPages
from .raster.raster import Rasteriser
from .raster.stations import ScannerPositions, uses_station_weights
from .sized_passes import KeptPasses, SizedPasses
from .stage_times import Stages

if TYPE_CHECKING:
    import moderngl

    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from .network.neural import NeuralStage

_WORTH_HALVING = 64 << 20
"""Bytes of points below which giving half of them back is not tried: a choice."""

log = logging.getLogger(__name__)


class Renderer:
    """Draws one scene.

    raster, device: used where the settings say ``auto``.  memory: limits for the points.  wake: called on another thread when
    points have arrived that a streamed picture lacked, or a network has ended.  kept_sizes: picture sizes besides the last one
    whose passes are kept, for callers that alternate between sizes.
    """

    def __init__(self, context: "moderngl.Context", scene: "Scene", *, raster: str = "auto", device: str = "auto",
                 memory: Memory = MEMORY, wake: Callable[[], None] = lambda: None, kept_sizes: int = 0):
        self.context, self.scene = context, scene
        self.device = describe_device(context)
        self._device, self.choice = device, RasterChoice(raster, self.device)
        self._programs = Programs(context)
        self._sizes = KeptPasses(self._programs, self.device.texture_limit, kept_sizes)
        self._culler = Culler(scene)
        self._enclosure = Enclosure(scene)
        self._scanner_positions = ScannerPositions(scene)
        self._make_pages = partial(PointPages, context, scene, self.device.storage_limit, software=self.device.software,
                                   read_ahead=memory.read_ahead, wake=wake)
        self.pages = self._make_pages(budget=memory.gpu)
        self._marks = MarkPages(context)
        self._stages = Stages(context, software=self.device.software)
        self._runs, self._serial = NetworkRuns(self._stages, wake), 0
        self.photographs = ScenePhotographs(scene, wake)

    @property
    def _passes(self) -> SizedPasses:
        """The passes of the last picture's size."""
        return self._sizes.present

    @property
    def network_busy(self) -> bool:
        """Whether a network runs on its own thread, for a picture of any size."""
        return any(stage.busy for stage in self._sizes.networks)

    @property
    def keeps_network(self) -> bool:
        """Whether the network of an earlier picture goes on (``keep_network``)."""
        return self._runs.keeps

    @property
    def metre(self) -> float:
        """File units in a metre; 1 where the file does not say."""
        metres = self.scene.meta.metres_per_unit
        return 1.0 / metres if metres else 1.0

    def render(self, camera: "Camera", settings: Settings, views: tuple[str, ...] | None = None,
               history: Occlusion | None = None, *, streaming: bool = False, defer_network: bool = False,
               edits: Edits | None = None, filled_depth: bool = False, keep_network: bool = False) -> Frame:
        """Makes the given views (default: that of the settings) of one camera.

        history: visibility in the previous frame, so that hidden cells need not be drawn.  It is used and updated where this
        cannot change the picture (compute rasteriser, no raw view), and otherwise ignored.
        streaming: do not wait for points that are not on the GPU yet.
        edits: clips, hidden stations and the colours of points; None: every point as it is.
        defer_network: start the network on its own thread and return without the neural view, which :meth:`finish_network`
        adds later; it is not started while points are missing.  The fact ``network_pending`` says whether it runs.  The neural
        view is there at once where pixels are mapped, or where one of the same camera still exists.
        filled_depth: Frame.filled_depth is made.  keep_network: a network under way for an earlier picture goes on, for
        :meth:`finish_earlier`, as long as later pictures are made with this, too.

        Where the device runs out of memory, half of the points' memory is given back and the picture is made again.
        Raises InputError for an unknown view, DeviceError where the device cannot make this picture, DeviceLostError where it
        was reset or hangs.
        """
        views = (settings.view,) if views is None else views
        if unknown := [view for view in views if view not in VIEWS]:
            raise InputError(f"view {unknown[0]!r}: expected one of {', '.join(VIEWS)}")
        self.photographs.placed = () if edits is None else edits.photographs
        edits = None if edits is None else edits.shown_in(views)
        while True:
            try:
                frame = self._render(camera, settings, views, history, edits, streaming=streaming, defer_network=defer_network,
                                     filled_depth=filled_depth, keep_network=keep_network)
                if self._sizes.allocated or not streaming:  # else as the next picture begins, which asks in any case
                    self._check_device(camera.width, camera.height)
                self._sizes.allocated = False
                return frame
            except DeviceMemoryError as error:
                if not self._halve_points():
                    raise
                log.warning("%s; continuing with %s of memory for points", error, bytes_text(self.pages.budget))

    def _render(self, camera: "Camera", settings: Settings, views: tuple[str, ...], history: Occlusion | None,
                edits: Edits | None, *, streaming: bool, defer_network: bool, filled_depth: bool, keep_network: bool) -> Frame:
        self._serial, wanted = self._serial + 1, passes_of(views)
        self._begin((camera.width, camera.height), neural="network" in wanted, keep_network=keep_network)
        stages = self._stages
        stages.begin()
        with stages("cull"):
            draw = self._culler.select(camera, settings.lod)
        if edits is not None:
            draw = without_clipped_cells(draw, edits, self.scene)
        rasteriser, facts = self._rasterise(camera, settings, views, draw, history, edits, streaming=streaming)
        textures = {"raw": rasteriser.colour}
        frame = Frame(camera, textures, rasteriser.depth, None, facts, stages.times)
        depth = frame.ratio_depth = self._passes.depth_for(rasteriser, camera, self.scene)
        if "filter" in wanted:
            with stages("filter"):
                step = self._passes.filtered(settings, rasteriser, depth, self.metre)
            textures["filtered"], frame.mask_texture = step.filtered, step.mask
            if "fill" in wanted:
                network = None
                if "network" in wanted:
                    network = self._neural_for(settings, background=defer_network or streaming)
                photos = self.photographs.ready(camera, settings, edits, wait=not streaming)
                textures["filled"] = fill_in(
                    self._passes, stages, self.scene, frame, rasteriser, step, settings, edits, network,
                    around=self._directions(camera, edits), software=self.device.software,
                    with_depth=filled_depth or bool(photos))
                frame.filled_depth = self._passes.fill_pass().depth if filled_depth else None
                self._passes.add_photographs(frame, self.photographs, photos, network, stages)
                if network is not None:
                    frame.facts = self._runs.run(network, frame, self._serial, deferred=defer_network, streaming=streaming,
                                                 keep=keep_network, missing=self.pages.missing)
        stages.end()
        frame.textures = {view: textures[view] for view in views if view in textures}
        return frame

    def _begin(self, size: tuple[int, int], *, neural: bool, keep_network: bool) -> None:
        """Uses the passes of a picture size, where nothing speaks against it.  Raises DeviceError, DeviceLostError."""
        if not keep_network:
            for stage in self._sizes.networks:
                stage.drop()  # what it may still run is a picture that this one replaces
            self._runs.forget_earlier()
        self._check_device(*size)
        self._sizes.use(size)
        if neural:  # before anything is drawn
            from .network.bridge import check_room

            check_room(self.device, size)

    def _rasterise(self, camera: "Camera", settings: Settings, views: tuple[str, ...], draw: DrawList,
                   history: Occlusion | None, edits: Edits | None, *, streaming: bool) -> tuple[Rasteriser, FrameFacts]:
        """Draws the points.  Returns the rasteriser, which holds the picture, and the facts of the frame so far."""
        soft = self._soft_z(settings).at_distance(camera.orthographic)
        if edits is not None and edits.recolours:
            soft = replace(soft, unlit=False)  # a black attribute is a colour
        weighted = uses_station_weights(settings, self._scanner_positions) and camera.orthographic is None
        stations = self._scanner_positions.seen_from(camera) if weighted else None
        rasteriser = self._choose(settings, draw, camera, soft, stations, streaming)
        recalled = None if camera.orthographic else self._history(history, settings, views, rasteriser)
        marks = None if edits is None else (marks_of if edits.changes is None else levelled_marks)(self.scene, edits)
        with self._stages("raster"):
            rounds = self.pages.prepare(draw.first, draw.count, streaming=streaming)
            hides = rasteriser.run(self.pages, draw, camera, soft, rounds, history=recalled, stations=stations,
                                   edits=None if edits is None else block_of(edits, self.scene, camera, marks),
                                   marks=None if marks is None else self._marks.use(marks))
        facts = raster_facts(rasteriser, draw, self.pages, self.scene, settings, opengl=self.device.renderer, weighted=weighted,
                             hides=hides)  # fmt: skip
        return rasteriser, facts

    def finish_network(self, frame: Frame) -> bool:
        """Adds the neural view to a frame that was rendered with ``defer_network``, if its network has ended.

        Returns whether it was added: False while the network runs, and where another picture was rendered since.
        Raises DeviceError where the network failed.
        """
        return self._runs.finish(self._passes.neural, self._passes.fill, frame, self._serial)

    def finish_earlier(self, target: "moderngl.Texture") -> bool:
        """Writes the neural picture whose network went on (``keep_network``) into ``target``, of its size, once it has ended;
        its alpha is the network's own.  Returns whether it did.  Raises DeviceError where the network failed."""
        return self._runs.finish_earlier(target)

    def prefetch(self, camera: "Camera", settings: Settings) -> int:
        """Starts loading the points of a future picture to the GPU, as many as one frame may upload; returns how many are
        still missing."""
        draw = self._culler.select(camera, settings.lod)
        self.pages.prepare(draw.first, draw.count, streaming=True)
        return self.pages.missing

    def _directions(self, camera: "Camera", edits: Edits | None) -> Directions:
        """What separates holes from background: the scan's surfaces; the picture alone where edits drop much of them."""
        around, dropped = self._enclosure.around(camera.position), edits is not None and edits.drops_much(self.scene.count)
        if dropped or camera.orthographic:  # its rays come from no one place
            return Directions(np.full_like(around.closed, OPEN), None if dropped else self._enclosure.occupancy)
        return around

    def _soft_z(self, settings: Settings) -> SoftZ:
        """The depth tolerance; a benchmark replaces it."""
        return SoftZ.preset(settings.soft_z, self.scene.spacing, self.metre, unlit=self.scene.unlit)

    def _history(self, memory: Occlusion | None, settings: Settings, views: tuple[str, ...], rasteriser: Rasteriser
                 ) -> History | None:
        if memory is None or not rasteriser.can_hide or not may_hide(settings, views):
            return None
        step = self._passes.filter_for(settings, rasteriser)
        assert isinstance(step, DepthFilter)  # behind every rasteriser that can hide cells
        return History(memory, self.scene, partial(step.closing, strength=settings.filter_strength, levels=GAP_LEVELS))

    def _choose(self, settings: Settings, draw: DrawList, camera: "Camera", soft: SoftZ, stations: "np.ndarray | None",
                streaming: bool) -> Rasteriser:
        """The rasteriser asked for; ``auto``: ``cpu`` in software OpenGL, on a GPU the one that measured fastest, fixed for
        this renderer's life."""
        passes = self._passes
        return self.choice.rasteriser(
            settings.raster, passes.rasterisers, self._programs, passes.size,
            lambda: fastest(self._programs, passes.size, self.device, self.pages, draw, camera, soft, stations,
                            streaming=streaming))

    def _neural_for(self, settings: Settings, *, background: bool) -> "NeuralStage":
        """The network's stage, as SizedPasses.neural_for; a benchmark replaces it."""
        device = settings.device if settings.device != "auto" else self._device
        return self._passes.neural_for(settings, device, background=background, keeps_two=self._sizes.kept_sizes > 0)

    def _check_device(self, width: int, height: int) -> None:
        """Raises DeviceLostError after a reset of the driver, and DeviceMemoryError where it lacked memory for what was made
        since the last call: passes are made in the picture that first needs them."""
        error = None if self.device.software else self.context.error
        if error == CONTEXT_LOST:
            raise DeviceLostError(LOST)
        if error == "GL_OUT_OF_MEMORY":
            raise DeviceMemoryError(f"the GPU has no memory left for a picture of {width}x{height}",
                                    remedy=("choose a smaller ", Option("--size"), ", or lower ", Option("--gpu-memory")))

    def _halve_points(self) -> bool:
        """Frees the passes and makes the points' pages again with half their budget; False where that cannot help."""
        self._sizes.release()
        self.photographs.free_gpu()
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
        self._sizes.release()
        self._stages.release()
        self.photographs.release()
        self.pages.release()
        self._marks.release()
        self._programs.release()
        give_back()
