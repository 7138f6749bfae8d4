"""``render(scene, camera, settings) -> Frame``: pure, the same arguments give the same bytes.

No history and no timing decides anything here, unless a caller hands one in; what a window adds (adaptive quality,
refinement) lives around it.  A Renderer owns the scene's points on the GPU and the passes for the last picture size used.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from model.common.memory import give_back
from model.soft_z import SoftZ
from viewer.errors import DeviceError, InputError
from viewer.render.choose_raster import RASTERISERS as RASTERISERS
from viewer.render.choose_raster import fastest, make_rasteriser
from viewer.render.context import describe_device
from viewer.render.cull import Culler, DrawList
from viewer.render.edits import Edits, block_of, without_clipped_cells
from viewer.render.enclosed_directions import OPEN, Directions, Surroundings
from viewer.render.fill import Fill
from viewer.render.filter import DepthFilter
from viewer.render.frame import Frame
from viewer.render.noise_level import NoiseLevel
from viewer.render.occlusion import History, Occlusion, may_hide
from viewer.render.points import PointPages
from viewer.render.raster import Rasteriser
from viewer.render.raster_compute import ComputeRasteriser
from viewer.render.shader import Programs
from viewer.render.stage_times import Stages
from viewer.render.stations import Places, Trust, weighs
from viewer.settings import MEMORY, VIEWS, Memory, Settings
from viewer.text import counted

if TYPE_CHECKING:
    import moderngl

    from viewer.camera import Camera
    from viewer.grid.scene import Scene
    from viewer.render.device_class import Workgroup
    from viewer.render.neural import NeuralStage

def camera_key(camera: "Camera") -> tuple:
    """Equal for cameras that make the same picture."""
    return (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.camera_to_world.tobytes())


_PASSES = ("_rasterisers", "_filter", "_fill", "_trust", "_noise", "_neural")
"""Attributes of a Renderer whose textures have the picture's size."""


def _release(passes: dict) -> None:
    for made in (*passes["_rasterisers"].values(), *(passes[name] for name in _PASSES if name != "_rasterisers")):
        if made is not None:
            made.release()


class Renderer:
    """Draws one scene.  raster, device: defaults for settings that say ``auto``.  memory: what the points may take.
    wake: called on another thread when points have arrived that a streamed picture lacked, or a network has ended.
    kept_sizes: picture sizes besides the last one whose passes are kept, for callers that change between sizes."""

    def __init__(self, context: "moderngl.Context", scene: "Scene", *, raster: str = "auto", device: str = "auto",
                 memory: Memory = MEMORY, wake: Callable[[], None] = lambda: None, kept_sizes: int = 0):
        self.context, self.scene = context, scene
        self.device = describe_device(context)
        self._raster, self._device = raster, device
        self._workgroup: Workgroup | None = None
        self._programs = Programs(context)
        self._culler = Culler(scene)
        self._surroundings = Surroundings(scene)
        self._places = Places(scene)
        self.pages = PointPages(
            context, scene, self.device.storage_limit, budget=memory.gpu, software=self.device.software,
            read_ahead=memory.read_ahead, wake=wake,
        )  # fmt: skip
        self._stages = Stages(context, software=self.device.software)
        self._rasterisers: dict[str, Rasteriser] = {}
        self._filter: DepthFilter | None = None
        self._fill: Fill | None = None
        self._trust: Trust | None = None
        self._noise: NoiseLevel | None = None
        self._neural: NeuralStage | None = None
        self._wake, self._serial = wake, 0
        self._size = (0, 0)
        self._kept_sizes = kept_sizes
        self._kept: dict[tuple[int, int], dict] = {}

    @property
    def metre(self) -> float:
        """File units in a metre; 1 where the file does not say."""
        metres = self.scene.meta.get("metres_per_unit")
        return 1.0 / metres if metres else 1.0

    def render(self, camera: "Camera", settings: Settings, views: tuple[str, ...] | None = None,
               history: Occlusion | None = None, *, streaming: bool = False, defer_network: bool = False,
               edits: Edits | None = None) -> Frame:
        """Makes the given views (default: that of the settings) of one camera.

        history: what was seen in the frame before, so that hidden cells need not be drawn; used, and brought up to date,
        where that cannot change the picture (compute rasteriser, no raw view) and otherwise left alone.
        streaming: do not wait for points that are not on the GPU yet.
        edits: clips, hidden stations and the colours of points; None: every point as it is.
        defer_network: start the network on its own thread and return without the neural view, which :meth:`finish_network`
        adds later; where points are missing it is not started.  The fact ``network_pending`` tells whether it runs.  The
        neural view is there at once where pixels are mapped, or where one of the same camera still exists.
        """
        self._serial += 1
        views = (settings.view,) if views is None else views
        edits = None if edits is None else edits.shown_in(views)
        for view in views:
            if view not in VIEWS:
                raise InputError(f"view {view!r}: expected one of {', '.join(VIEWS)}")
        self._resize((camera.width, camera.height))
        if "neural" in views:  # now, and not when everything before the network has been drawn
            from viewer.render.bridge import check_room

            check_room(self.device, self._size)
        stages = self._stages
        stages.begin()
        draws: list[DrawList] = []
        stages.run("cull", lambda: draws.append(self._culler.select(camera, settings.lod)))
        draw = draws[0] if edits is None else without_clipped_cells(draws[0], edits, self.scene)
        soft = self._soft_z(settings)
        if edits is not None and edits.recolours:
            soft = replace(soft, unlit=False)  # a black attribute is a colour
        stations = self._places.seen_from(camera) if weighs(settings, self._places) else None
        rasteriser = self._choose(settings, draw, camera, soft, stations, streaming)
        wanted = self._history(history, settings, views)
        hid: list[bool] = []
        stages.run("raster", lambda: hid.append(rasteriser.run(
            self.pages, draw, camera, soft, self.pages.prepare(draw.first, draw.count, streaming=streaming),
            history=wanted, stations=stations,
            edits=None if edits is None else block_of(edits, self.scene, camera))))
        pages, textures = self.pages, {"raw": rasteriser.colour}
        drawn = draw.points - pages.missing - pages.left_out - pages.lost
        facts: dict = {
            "raster": rasteriser.kind,
            "points_drawn": drawn,
            "points_missing": pages.missing,
            "points_total": self.scene.count,
            "cells_drawn": len(draw.cells),
            "cells_total": len(self.scene.cell_coords),
            "points_gpu_bytes": pages.nbytes,
            "opengl": self.device.renderer,
            "device": None,
            "network": None,
            "stations": "weighed" if stations is not None else "equal",
            "approximations": [*self._approximations(settings), *pages.approximations],
        }
        if hid[0] and rasteriser.hider is not None:
            hider = rasteriser.hider
            tally = cache(partial(hider.tally, hider.serial))
            facts["occlusion"] = tally  # looked up when asked for, and once: it waits for the GPU
            facts["points_drawn"] = lambda: drawn - tally()["points_hidden"]
            facts["approximations"].append("hidden cells skipped")
        mask = None
        if set(views) - {"raw"}:
            step = self._filter_for(settings)
            stages.run("filter", lambda: step.run(
                rasteriser.colour, rasteriser.depth, strength=settings.filter_strength, metre=self.metre))
            textures["filtered"], mask = step.filtered, step.mask
            if {"filled", "neural"} & set(views):
                neural = self._neural_for(settings) if "neural" in views else None
                fill = self._fill = self._fill or Fill(self._programs, self._size)
                colour, confidence = self._trusted(rasteriser, step.mask)
                level = None
                if neural and (noise := self._noise_level()):
                    stages.run("noise", lambda: noise.run(
                        rasteriser.colour, rasteriser.depth, rasteriser.weight, confidence, camera=camera,
                        weighed=rasteriser.weighed, detail=settings.detail))
                    level = noise.level
                stages.run("fill", lambda: fill.run(
                    colour, confidence, rasteriser.depth, noise=level,
                    camera=camera, around=self._directions(camera, edits), spacing=self.scene.spacing,
                    network=neural.bridge.input if neural else None))
                textures["filled"] = fill.filled
                if neural:
                    if defer_network and neural.deferrable:
                        self._start_network(neural, camera, stages, facts, textures)
                    else:
                        neural.drop()
                        stages.run("network", neural.infer)
                        stages.run("present", lambda: neural.present(fill.filled))
                        neural.presented = camera_key(camera)
                        textures["neural"] = neural.picture
                    facts |= {"device": neural.device, "network": neural.name, "bridge": neural.bridge_name}
                    facts["approximations"] = [*facts["approximations"], *neural.approximations]
        stages.end()
        return Frame({v: textures[v] for v in views if v in textures}, rasteriser.depth, mask, facts, stages.times)

    @property
    def network_busy(self) -> bool:
        """Whether a network runs on its own thread, for a picture of any size."""
        stages = (self._neural, *(passes["_neural"] for passes in self._kept.values()))
        return any(stage is not None and stage.busy for stage in stages)

    def _start_network(self, neural: "NeuralStage", camera: "Camera", stages: Stages, facts: dict, textures: dict) -> None:
        """Starts the network for this picture, and keeps the picture before it where the camera is the same."""
        key = camera_key(camera)
        if neural.presented == key:
            textures["neural"] = neural.picture
        facts["camera_key"] = key
        facts["network_pending"] = not self.pages.missing
        if facts["network_pending"]:
            serial = self._serial
            stages.run("hand over", lambda: neural.start(serial, self._wake))
        else:
            neural.drop()

    def finish_network(self, frame: Frame) -> bool:
        """Adds the neural view to a frame that was rendered with ``defer_network``, if its network has ended.

        Returns whether it was added: False while the network runs, and where another picture was rendered since.
        Raises DeviceError where the network failed.
        """
        neural, fill = self._neural, self._fill
        if neural is None or fill is None or not frame.facts.get("network_pending"):
            return False
        milliseconds = neural.finish(self._serial, fill.filled)
        if milliseconds is None:
            return False
        neural.presented = frame.facts["camera_key"]
        frame.textures["neural"] = neural.picture
        frame.facts["network_pending"] = False
        frame.times.add("network", milliseconds)
        return True

    def _directions(self, camera: "Camera", edits: Edits | None) -> Directions:
        """What tells holes from background: the scan's surfaces; the picture alone where points of them were dropped."""
        around = self._surroundings.around(camera.position)
        return Directions(np.full_like(around.closed, OPEN), None) if edits is not None and edits.drops else around

    def prefetch(self, camera: "Camera", settings: Settings) -> int:
        """Has points of a picture to come brought to the GPU, as many as one frame may; returns how many are still missing."""
        draw = self._culler.select(camera, settings.lod)
        self.pages.prepare(draw.first, draw.count, streaming=True)
        return self.pages.missing

    def _trusted(self, rasteriser: Rasteriser, mask: "moderngl.Texture") -> "tuple[moderngl.Texture, moderngl.Texture]":
        """What the fill starts from, and what each pixel of it counts: the raw picture and the keep-mask, or, of weighed
        points, both by how far it is trusted."""
        if not rasteriser.weighed:
            return rasteriser.colour, mask
        self._trust = self._trust or Trust(self._programs, self._size)
        self._trust.run(rasteriser.colour, rasteriser.weight, mask)
        return self._trust.toned, self._trust.trust

    def _noise_level(self) -> NoiseLevel | None:
        """None where the scan's noise is unknown: the network's noise input is then zero."""
        if self._noise is None and self.scene.noise is not None:
            self._noise = NoiseLevel(self._programs, self._size, self.scene.noise)
        return self._noise

    def _soft_z(self, settings: Settings) -> SoftZ:
        """The depth tolerance; a bench tries others."""
        return SoftZ.preset(settings.soft_z, self.scene.spacing, self.metre, unlit=self.scene.unlit)

    def _history(self, memory: Occlusion | None, settings: Settings, views: tuple[str, ...]) -> History | None:
        if memory is None or not may_hide(settings, views):
            return None
        return History(memory, self.scene, self._filter_for(settings), settings.filter_strength)

    def _approximations(self, settings: Settings) -> list[str]:
        return [] if settings.lod is None else [f"level of detail: {counted(settings.lod, 'point')} per pixel"]

    def _choose(self, settings: Settings, draw: DrawList, camera: "Camera", soft: SoftZ, stations: "np.ndarray | None",
                streaming: bool) -> Rasteriser:
        """The rasteriser asked for; ``auto``: on a GPU the one that measured fastest, fixed for this renderer's life."""
        wanted = settings.raster if settings.raster != "auto" else self._raster
        if wanted == "auto" and self.device.software:
            wanted = self._raster = "compute"
        if wanted == "auto":
            best = fastest(self._programs, self._size, self.device, self.pages, draw, camera, soft, stations,
                           streaming=streaming)
            wanted = self._raster = best.kind
            self._workgroup = best.workgroup if isinstance(best, ComputeRasteriser) else None
            self._rasterisers[wanted] = best
        if wanted not in self._rasterisers:
            self._rasterisers[wanted] = make_rasteriser(wanted, self._workgroup, self._programs, self._size, self.device)
        return self._rasterisers[wanted]

    def _filter_for(self, settings: Settings) -> DepthFilter:
        current = self._filter
        if current is None or (current.preset, current.wanted_levels) != (settings.filter, settings.filter_levels):
            if current is not None:
                current.release()
            current = self._filter = DepthFilter(self._programs, self._size, settings.filter, settings.filter_levels)
        return current

    def _neural_for(self, settings: Settings) -> "NeuralStage":
        from viewer.render.neural import NeuralStage

        device = settings.device if settings.device != "auto" else self._device
        key = (settings.quality, settings.filter != "off", settings.weights, settings.precision, device)
        if self._neural is None or self._neural.key != key:
            if self._neural is not None:
                self._neural.release()
                self._neural = None
            self._neural = NeuralStage(self._programs, self._size, *key)
        return self._neural

    def _resize(self, size: tuple[int, int]) -> None:
        if size == self._size:
            return
        if max(size) > self.device.texture_limit:
            raise DeviceError(
                f"a picture of {size[0]}x{size[1]} is larger than this device's textures ({self.device.texture_limit} "
                "pixels a side); choose a smaller --size"
            )
        passes = self._swap_passes({})
        if self._size != (0, 0):
            self._kept[self._size] = passes
        while len(self._kept) > self._kept_sizes and (oldest := next(iter(self._kept))) != size:
            _release(self._kept.pop(oldest))
        self._swap_passes(self._kept.pop(size, {}))
        self._size = size

    def _swap_passes(self, passes: dict) -> dict:
        """Uses other passes, by attribute; returns those used before."""
        before = {name: getattr(self, name) for name in _PASSES}
        for name in _PASSES:
            setattr(self, name, passes.get(name, {} if name == "_rasterisers" else None))
        return before

    def _release_passes(self) -> None:
        for passes in (self._swap_passes({}), *self._kept.values()):
            _release(passes)
        self._kept = {}

    def release(self) -> None:
        """Frees everything on the GPU, and gives back what memory its pictures kept."""
        self._release_passes()
        self._stages.release()
        self.pages.release()
        self._programs.release()
        give_back()
