"""The viewport: the renderer of the scene, the last picture it made, and the canvas on which that is shown.

Owns GL objects and knows no window.  The session plans the pictures; the interface is drawn on the canvas later.
"""

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import DeviceError, DeviceLostError, PointglassError
from ...picture.background import composite
from ...picture.composition import joined, split_column
from ...picture.settings import Memory
from ...readers.meshes.mesh_store import kept_mesh
from ...render.culling.occlusion import Occlusion
from ...render.described_picture import Composer, render
from ...render.passes.develop import read_picture
from ...render.raster.points import UPLOAD_SECONDS
from ..planning.adaptive_lod import TARGET_CPU_MS, TARGET_GPU_MS
from ..session.loading import Loaded
from ..session.session import Session
from .frame_rate import FrameRate
from .moved_picture import MovedPicture
from .photo_layer import PhotoLayer
from .pixel_reader import PixelReader
from .planned_picture import as_planned
from .points_in_picture import PointsInPicture
from .present import Canvas
from .side_pictures import SidePictures

if TYPE_CHECKING:
    import moderngl

    from ...grid.scene import Scene
    from ...picture.spec import PictureSpec
    from ...render.frame import Frame
    from ...render.renderer import Renderer
    from ..planning.picture_plan import Plan

_NO_MEMORY = "not enough memory for its points"
_KEPT_SIZES = 2  # internal resolutions besides the last one: they change while the camera moves
_UPLOAD_SECONDS = 0.1  # between two pictures at rest that wait for points


class Viewport:
    """Makes the pictures that a session plans, and reports how they were made and what they cost.

    renderer: of the scene shown, None at first.  frame: the last picture, None where there is none.
    pixels: reads its depth, mask and views.  photos: lays a photograph over it.  context: the window's.
    sides: the pictures of a handle between two dates; ``frame`` is that of the right one then.  memory: what points may take.
    canvas: what the window shows, None until something was shown.  wake: called on a thread of the renderer's own
    when points have come.
    """

    def __init__(self, context: "moderngl.Context", session: Session, *, memory: Memory, wake: Callable[[], None]):
        from ...render.device.shader import Programs

        self.context, self._session, self._memory, self._wake = context, session, memory, wake
        self._programs = Programs(context)
        self._composer = Composer(context, kept_mesh)
        self.pixels = PixelReader(context)
        self.photos = PhotoLayer(context, self.pixels)
        self.sides = SidePictures(context)
        self._points = PointsInPicture(session, self.pixels)
        self.moved = MovedPicture(context, self._programs)
        self.renderer: Renderer | None = None
        self.canvas: Canvas | None = None
        self.frame: Frame | None = None
        self._unreported: tuple[Plan, Frame] | None = None  # a picture whose cost was not reported yet
        self._shown: tuple[str, ...] = ()
        self._asked: tuple[str, ...] = ()  # the views that those stand for
        self._moved_frame: Frame | None = None  # the last picture with a moved neural picture as its filled view
        self._seen = Occlusion()
        self._problem: str | None = None
        self._rate = FrameRate()

    def upload(self, loaded: Loaded) -> bool:
        """Uploads a loaded scene to the GPU.  False where that fails; the previous scene stays and a message says why."""
        try:
            renderer = self._made(loaded.scene)
        except (PointglassError, MemoryError) as error:
            self._session.notices.say("This scan cannot be shown", error if str(error) else _NO_MEMORY)
            return False
        if self.renderer is not None:
            self.renderer.release()
        self._forget(renderer)
        self._session.picture.adaptive_lod.target_ms = TARGET_CPU_MS if renderer.device.software else TARGET_GPU_MS
        self._session.accept(loaded)
        self._rate.clear()
        return True

    def _made(self, scene: "Scene") -> "Renderer":
        """A new renderer: beside the present one or, where the device has no memory for both, in its place.  Where there is no
        memory for this scene alone, the previous renderer is made again."""
        try:
            renderer = self._new(scene)
        except (DeviceError, MemoryError):
            if self.renderer is None:
                raise
        else:
            if self.renderer is None or not renderer.pages.short:
                return renderer
            renderer.release()
        before = self.renderer.scene
        self.renderer.release()
        self._forget(None)
        try:
            return self._new(scene)
        except (PointglassError, MemoryError):
            self._forget(self._new(before))
            self._session.picture.dirty = True
            raise

    def _new(self, scene: "Scene") -> "Renderer":
        from ...render.renderer import Renderer

        return Renderer(self.context, scene, memory=self._memory, wake=self._wake, kept_sizes=_KEPT_SIZES)

    def _forget(self, renderer: "Renderer | None") -> None:
        """Uses another renderer, which has made no picture yet.  No texture of the last pictures is kept."""
        self.renderer, self._shown, self._asked = renderer, (), ()
        self.frame = self._moved_frame = self._unreported = self._problem = None
        for owner in (self.photos, self.sides, self.moved):
            owner.release()
        for part in (self._composer, self.pixels, self._points):
            part.forget()

    def clear(self) -> None:
        """Releases the scene; the canvas shows the background."""
        if self.renderer is not None:
            self.renderer.release()
        self._forget(None)
        self._rate.clear()

    def note_arrivals(self) -> bool:
        """At rest (a moving picture does this itself): uploads points that have arrived; the picture is made again if it waited
        for them, else they are prefetched.  Returns whether more are ready for the next call."""
        if self.renderer is None or self._session.flight.moving:
            return False
        pages = self.renderer.pages
        self._session.picture.dirty |= self.renderer.photographs.arrived
        if not (pages.arrived or pages.idle):
            return False
        self._session.picture.dirty |= pages.pending
        try:
            return pages.take_in(_UPLOAD_SECONDS if pages.pending else UPLOAD_SECONDS)
        except (PointglassError, MemoryError) as error:
            self._unreported = None
            self._session.failed(error if str(error) else _NO_MEMORY)
            return False

    @property
    def shares_processors(self) -> bool:
        """Whether pictures are drawn by the processors that also run the interface and, without CUDA, the network."""
        return self.renderer is not None and self.renderer.device.software

    def paint(self) -> None:
        """Makes the picture that the session plans now."""
        session, renderer = self._session, self.renderer
        if renderer is None:
            return
        session.view_settings.give_photographs(renderer)
        session.picture.contended = self.shares_processors and renderer.network_busy and not renderer.keeps_network
        plan, spec = session.screen.plan, session.spec
        try:
            frame = self._frame_of(renderer, spec, plan)
        except DeviceLostError:
            raise  # ends the window with its message and exit code 3
        except (PointglassError, MemoryError) as error:
            self.frame = self._unreported = None
            self.sides.forget()
            session.failed(error if str(error) else _NO_MEMORY)
            return
        self._rate.add(perf_counter())
        # beside a network: its time says nothing of pictures that have the processors to themselves
        self._report(replace(plan, contended=True) if renderer.keeps_network else plan, frame)
        self._points.look(frame, moving=plan.moving)
        before, self._problem = self._problem, renderer.pages.problem
        if self._problem and self._problem != before:
            session.notices.say("A part of this scan cannot be read", self._problem)

    def _frame_of(self, renderer: "Renderer", spec: "PictureSpec", plan: "Plan") -> "Frame":
        """The picture as planned; of two dates that of the right one."""
        if spec.other_edits is not None:
            self._moved_frame = self._session.picture.moved = None
            self.frame = self.sides.paint(renderer, spec, plan)
            self._shown, self._asked = self.sides.views, spec.views
            return self.frame
        self.sides.forget()
        begun = self.moved.prepare(spec, plan, renderer)
        more = (*(("filled",) if plan.deferred else ()), *(("neural",) if begun else ()))
        frame = self.frame = render(
            renderer, as_planned(spec, plan, begun), self._seen if plan.hides else None, more=more, streaming=True,
            defer_network=plan.deferred or begun is not None, filled_depth=self.moved.takes(spec),
            keep_network=begun is not None or (plan.moving and renderer.keeps_network))
        self._moved_frame = self.moved.drew(frame, spec, begun=renderer.keeps_network and begun is not None)
        self._shown = tuple(view if view in frame.textures else "filled" for view in plan.views)
        self._asked, self._session.picture.moved = spec.views, self.moved.share
        return frame

    def follow(self) -> bool:
        """Takes the readings of the picture that have arrived.  Returns whether the session knows something new by them."""
        return self._points.follow()

    def finish_network(self) -> bool:
        """Shows the neural view of the last picture if its network has ended since.  Returns whether it did."""
        plan, frame, renderer = self._session.picture.pending, self.frame, self.renderer
        if plan is None or frame is None or renderer is None or self._session.screen.needs_picture:
            return False
        try:
            if self.sides.frames:
                if (done := self.sides.finish(renderer)) is not None and self.sides.complete:
                    self._session.completed(done.cost)
                self.frame, self._shown = self.sides.frames[1], self.sides.views
                return done is not None
            if not renderer.finish_network(frame):
                return False
        except DeviceLostError:
            raise
        except PointglassError as error:
            self.frame = self._unreported = None
            self.sides.forget()
            self._session.failed(error)
            return True
        self._shown, self._moved_frame, self._session.picture.moved = plan.views, None, None
        self.moved.arrive(frame.textures["neural"])
        self._session.completed(frame.cost)
        return True

    def _report(self, plan: "Plan", frame: "Frame") -> None:
        """Reports a picture and its cost to the session.  While the camera moves on a GPU, the cost is reported with the next
        picture, so that the GPU never waits for a query."""
        self.settle()
        if plan.moving and self.renderer is not None and not self.renderer.device.software:
            facts = frame.facts
            self._session.shown(plan, hides=facts.occlusion is not None, approximations=facts.approximations)
            self._unreported = plan, frame
            return
        cost, facts = frame.cost, frame.facts
        if facts.network_pending is None and self.sides.complete:
            self._session.drew(plan, cost)
            return
        self._session.shown(plan, hides=facts.occlusion is not None, approximations=facts.approximations,
                            shown=self._shown, pending=True)
        self._session.learn(plan, cost)

    def settle(self) -> None:
        """Reports the cost of the last picture of a movement."""
        before, self._unreported = self._unreported, None
        if before is not None:
            self._session.learn(before[0], before[1].cost)

    @property
    def frame_rate(self) -> float | None:
        """Pictures a second while something moves; None at rest."""
        return self._rate.per_second if self._session.flight.moving else None

    def show(self) -> Canvas:
        """The last picture in its place, or the background where there is none, on a canvas of the window's size."""
        session, chosen = self._session, self._session.view_settings
        if self.canvas is None or self.canvas.size != session.area.window_size:
            if self.canvas is not None:
                self.canvas.release()
            self.canvas = Canvas(self.context, self._programs, session.area.window_size)
        camera = session.screen.camera
        if self.sides.frames:
            sides = self.sides.textures()
        else:
            shown = zip(self._shown, self._asked, strict=True) if self.frame is not None else ()
            sides = [self._developed(view, wait=session.flight.moving, moved=view != asked) for view, asked in shown]
        column = split_column(chosen.split_at, camera.width)
        self.canvas.show(*(sides or [None]), column=column, background=chosen.background,
                         area=session.area.place_of((camera.width, camera.height)))
        return self.canvas

    def _developed(self, view: str, *, wait: bool = True, moved: bool = False, whole: bool = False) -> "moderngl.Texture":
        """A view of the last picture as its description has it.  moved: as it stands in for the neural one.  wait: for the
        pixels under a photograph over it, which else follows later.  whole: for the photograph, too."""
        spec, photo = self._session.picture.spec, self._session.work.photo
        assert self.frame is not None and spec is not None
        made = self._composer.texture(self._moved_frame or self.frame if moved else self.frame, view, spec)
        if photo is None or self.renderer is None or spec.camera.orthographic is not None:
            return made
        return self.photos.over(self.frame, view, made, spec.camera, photo, self.renderer, wait=wait, whole=whole)

    def shown_picture(self) -> np.ndarray | None:
        """(H, W, 3) uint8: the picture on the screen, without the interface; None where there is none."""
        if self.frame is None or not self._shown:
            return None
        try:
            made = self.sides.textures()[-1] if self.sides.frames else self._developed(self._shown[-1])
            return composite(read_picture(made), self._session.view_settings.background)
        except Exception:  # a lost context has no picture; this is only a thumbnail
            return None

    def full_picture(self) -> np.ndarray | None:
        """(H, W, 3) uint8: what is shown, without the interface and at full quality, a comparison with the names of its sides;
        None without a scene.  Raises PointglassError where it cannot be made."""
        session = self._session
        if self.renderer is None or min(session.area.size) == 0:
            return None
        plan, spec = session.screen.full_plan, session.spec
        if spec.other_edits is not None:
            session.picture.dirty |= not session.screen.exact  # a network that runs is given up
            return self.sides.saved(self.renderer, spec, exact=session.screen.exact)
        if self.frame is None or not session.screen.exact:
            self.frame, self._shown, self._asked = render(self.renderer, spec), spec.views, spec.views
            self._report(plan, self.frame)
        images = [read_picture(self._developed(view, whole=True)) for view in spec.views]
        return joined(images, spec.background, spec.titles, spec.split_at)

    def release(self) -> None:
        for owned in (self.renderer, self.canvas, self._composer, self.photos, self.sides, self.moved, self.pixels,
                      self._programs):
            if owned is not None:
                owned.release()
        self.renderer = self.canvas = None
