"""The pictures of a handle whose sides show other points, such as two dates: each is rendered by itself and copied.

A renderer's textures hold its last picture only, hence the copies.  While the camera moves both sides are rendered in each
frame.  At rest the filled view stands in for a neural one at either side, and the networks run one after the other.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...picture.composition import joined
from ...readers.meshes.mesh_store import kept_mesh
from ...render.described_picture import Composer, picture_of, render
from ...render.passes.develop import read_picture
from .planned_picture import as_planned

if TYPE_CHECKING:
    import moderngl

    from ...picture.spec import PictureSpec
    from ...render.frame import Frame
    from ...render.renderer import Renderer
    from ...render.stage_times import Times
    from ..planning.picture_plan import Plan


@dataclass
class _BothTimes:
    """Times of two frames as if they were one."""

    left: "Times"
    right: "Times"

    @property
    def host(self) -> dict[str, float]:
        return _sums(self.left.host, self.right.host)

    def milliseconds(self) -> dict[str, float]:
        return _sums(self.left.milliseconds(), self.right.milliseconds())

    def total(self) -> float:
        return self.left.total() + self.right.total()


class SidePictures:
    """frames: with textures of their own, left first; () where sides show the same points.  spec: that they were made for.
    views: that they show."""

    def __init__(self, context: "moderngl.Context"):
        self._context = context
        self._composers = Composer(context, kept_mesh), Composer(context, kept_mesh)
        self._textures: dict[tuple[int, str], moderngl.Texture] = {}
        self._buffer: moderngl.Buffer | None = None
        self._plan: Plan | None = None
        self._waiting: list[int] = []
        self._running: tuple[int, Frame] | None = None
        self.frames: tuple[Frame, ...] = ()
        self.spec: PictureSpec | None = None
        self.views: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether no network is still to run."""
        return not self._waiting and self._running is None

    def paint(self, renderer: "Renderer", spec: "PictureSpec", plan: "Plan") -> "Frame":
        """Makes both sides as planned and starts the first network.  Returns the frame of the right side, with the times of
        both.  Raises as Renderer.render."""
        self._running, self.spec, self._plan = None, spec, plan
        views = tuple("filled" if plan.deferred and view == "neural" else view for view in plan.views)
        times = []
        for number, view in enumerate(views):
            frame = self._rendered(renderer, number, view, deferred=False)
            times.append(frame.times)
            self._keep(number, view, frame)
        left, right = self.frames
        self.frames = left, replace(right, times=_BothTimes(*times))  # type: ignore[arg-type]
        self._waiting = [number for number, (drawn, asked) in enumerate(zip(views, plan.views)) if drawn != asked]
        if not right.facts.points_missing:
            self._run_next(renderer)
        return self.frames[1]

    def _rendered(self, renderer: "Renderer", number: int, view: str, *, deferred: bool) -> "Frame":
        assert self.spec is not None and self._plan is not None
        one = as_planned(self.spec.sides[number], replace(self._plan, views=(view,)), None)
        return render(renderer, one, streaming=True, defer_network=deferred)

    def _run_next(self, renderer: "Renderer") -> None:
        """Starts the network of the next side that waits; makes the picture at once where pixels are mapped."""
        while self._waiting:
            number = self._waiting.pop(0)
            frame = self._rendered(renderer, number, "neural", deferred=True)
            if frame.facts.network_pending:
                self._running = number, frame
                return
            if frame.facts.points_missing:
                self._waiting.insert(0, number)  # the picture is made again when they have arrived
                return
            self._keep(number, "neural", frame)

    def finish(self, renderer: "Renderer") -> "Frame | None":
        """The frame whose network has ended since, which is shown from now on; None where none has.  Raises DeviceError."""
        if self._running is None or not renderer.finish_network(self._running[1]):
            return None
        (number, frame), self._running = self._running, None
        self._keep(number, "neural", frame)
        self._run_next(renderer)
        return frame

    def _keep(self, number: int, view: str, frame: "Frame") -> None:
        """Copies what is read of a frame later."""
        def copied(name: str, texture: "moderngl.Texture | None") -> "moderngl.Texture | None":
            return None if texture is None else self._copied((number, name), texture)

        made = {name: self._copied((number, name), texture) for name, texture in frame.textures.items()}
        depth = self._copied((number, "depth"), frame.depth_texture)
        kept = replace(frame, textures=made, depth_texture=depth, mask_texture=copied("mask", frame.mask_texture),
                       filled_depth=copied("filled depth", frame.filled_depth),
                       photo_shares={name: self._copied((number, f"{name} photographs"), texture)
                                     for name, texture in frame.photo_shares.items()},
                       ratio_depth=depth if frame.ratio_depth is frame.depth_texture else copied("ratio", frame.ratio_depth))
        frames, views = [*(self.frames or (kept, kept))], [*(self.views or (view, view))]
        frames[number], views[number] = kept, view
        self.frames, self.views = (frames[0], frames[1]), (views[0], views[1])

    def _copied(self, key: tuple[int, str], texture: "moderngl.Texture") -> "moderngl.Texture":
        """A copy by way of a buffer of the device: the same bytes in any format."""
        kept = self._textures.get(key)
        form = texture.size, texture.components, texture.dtype
        if kept is None or (kept.size, kept.components, kept.dtype) != form:
            if kept is not None:
                kept.release()
            kept = self._textures[key] = self._context.texture(form[0], form[1], dtype=form[2], alignment=1)
            kept.filter = texture.filter
        size = texture.width * texture.height * texture.components * (4 if texture.dtype == "f4" else 1)
        if self._buffer is None or self._buffer.size < size:
            if self._buffer is not None:
                self._buffer.release()
            self._buffer = self._context.buffer(reserve=size)
        texture.read_into(self._buffer, alignment=1)
        kept.write(self._buffer, alignment=1)
        return kept

    def textures(self) -> "list[moderngl.Texture]":
        """The developed picture of each side."""
        assert self.spec is not None
        return [composer.texture(frame, view, side)
                for composer, frame, view, side in zip(self._composers, self.frames, self.views, self.spec.sides)]

    def saved(self, renderer: "Renderer", spec: "PictureSpec", *, exact: bool) -> np.ndarray:
        """(H, W, 3) uint8: both sides with their titles.  exact: whether what is on the screen is what ``spec`` asks for;
        otherwise it is rendered.  Raises PointglassError where it cannot be made."""
        if not exact or not spec.renders_as(self.spec):
            return picture_of(renderer, spec)
        return joined([read_picture(side) for side in self.textures()], spec.background, spec.titles, spec.split_at)

    def forget(self) -> None:
        """The sides show the same points again, or another scene is shown."""
        self.frames, self.views, self.spec, self._plan, self._waiting, self._running = (), (), None, None, [], None

    def release(self) -> None:
        self.forget()
        for owned in (*self._composers, *self._textures.values(), self._buffer):
            if owned is not None:
                owned.release()
        self._textures.clear()
        self._buffer = None


def _sums(one: dict[str, float], other: dict[str, float]) -> dict[str, float]:
    return {stage: one.get(stage, 0.0) + other.get(stage, 0.0) for stage in (*one, *(set(other) - set(one)))}
