"""The neural picture in flight: the last one that the network made, moved to the camera of the present filled picture.

On a processor the network takes as long as several pictures.  While the filled view stands in for it, in flight and until it
has run at rest, the neural picture made last (the keyframe) is moved by depth (viewer.render.passes.reprojection).  Where
pictures leave time for it, the network makes new ones beside the flight.  Pictures that are saved know nothing of this.
"""

from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

from ...render.device.context import describe_device
from ...render.passes.reprojection import Keyframe, Reprojection

if TYPE_CHECKING:
    import moderngl
    import numpy as np

    from ...picture.spec import PictureSpec
    from ...render.device.shader import Programs
    from ...render.frame import Frame
    from ...render.renderer import Renderer
    from ..planning.picture_plan import Plan

_LEAST_SHARE = 0.2
"""Of the pixels that a moved picture must give.  Moving takes 5 of 54 ms at half of 1280x720 on two cores (studio), however few
they are: a choice."""


class MovedPicture:
    """Owns a keyframe, the one that comes after it, and the picture on the screen made of the former.

    share: of the pixels shown last that were moved; None where nothing was.
    """

    def __init__(self, context: "moderngl.Context", programs: "Programs"):
        self._context, self._programs = context, programs
        self._shown: Keyframe | None = None
        self._coming: Keyframe | None = None
        self._spare: Keyframe | None = None
        self._step: Reprojection | None = None
        self._key: object = None
        self._software = describe_device(context).software
        self._beside = False  # whether networks run on a thread beside the pictures here
        self.share: float | None = None

    @property
    def place(self) -> "np.ndarray | None":
        """(3,) file coordinates: where the picture that is moved was made; None where there is none."""
        return None if self._shown is None or self._shown.camera is None else self._shown.camera.position

    @staticmethod
    def takes(spec: "PictureSpec") -> bool:
        """Whether pictures like this are moved: neural ones of pinholes."""
        return "neural" in spec.views and spec.camera.orthographic is None

    def prepare(self, spec: "PictureSpec", plan: "Plan", renderer: "Renderer") -> str | None:
        """The picture of ``spec`` is drawn next, as planned.  Takes the neural picture that has been made meanwhile, and
        returns the network to start beside this picture; None where there is none, or it is not the time.

        Raises DeviceError where a network failed.
        """
        pinhole = spec.camera.orthographic is None
        key = spec.settings, spec.edits, pinhole
        if key != self._key:  # keyframes show something else
            self.forget()
            self._key = key
        if self._coming is not None and renderer.finish_earlier(self._coming.picture):
            self.arrive()
        free = self._beside and not (renderer.network_busy or renderer.pages.missing)
        begins = pinhole and plan.moving and plan.spare and free
        return plan.keyframes if begins else None

    def drew(self, frame: "Frame", spec: "PictureSpec", *, begun: bool) -> "Frame | None":
        """``frame`` was drawn for ``spec``.  begun: a network was started beside it.  Returns the frame to show instead, with a
        moved neural picture as its filled view; None where the frame itself is to be shown."""
        self.share, pending = None, frame.facts.network_pending
        if not self.takes(spec):
            return None
        self._beside |= bool(pending)
        if begun or pending:
            self.hold(frame)
        elif "neural" in frame.textures:
            self.hold(frame)
            self.arrive(frame.textures["neural"])
        if "neural" in frame.textures:
            return None
        begins = perf_counter()
        made = self.over(frame, spec)
        if made is not None and self._software:  # a GPU has not done it yet
            frame.times.add("move", (perf_counter() - begins) * 1e3)
        return made

    def hold(self, frame: "Frame") -> None:
        """The neural picture of ``frame`` follows: its depth is kept until then."""
        size = frame.camera.width, frame.camera.height
        if self._coming is None:
            self._coming, self._spare = self._spare, None
        if self._coming is not None and self._coming.size != size:
            self._coming.release()
            self._coming = None
        self._coming = self._coming or Keyframe(self._context, size)
        assert frame.filled_depth is not None
        used = self._software or self._beside  # elsewhere the network keeps up, and reading pixels would wait for the GPU
        self._coming.take_depth(frame.camera, frame.filled_depth, frame.textures.get("filled") if used else None)

    def arrive(self, picture: "moderngl.Texture | None" = None) -> None:
        """The neural picture held for has been made: ``picture``, or what was written since."""
        if self._coming is None:
            return
        if picture is not None:
            self._coming.take_picture(picture)
        else:
            self._coming.compare()
        before, self._shown, self._coming = self._shown, self._coming, None
        if before is not None:
            self._retire(before)

    def _retire(self, keyframe: Keyframe) -> None:
        """Keeps one whose textures the next can use."""
        if self._spare is None:
            self._spare = keyframe
        else:
            keyframe.release()

    def over(self, frame: "Frame", spec: "PictureSpec") -> "Frame | None":
        """``frame`` with a moved neural picture as its filled view; None where there is none, or ``spec`` compares pixels with
        measured ones."""
        self.share, keyframe, depth = None, self._shown, frame.filled_depth
        size = frame.camera.width, frame.camera.height
        if keyframe is None or depth is None or spec.tint or spec.edits.lock_measured or keyframe.size[0] < depth.width:
            return None
        if self._step is None or self._step.size != size:
            if self._step is not None:
                self._step.release()
            self._step = Reprojection(self._programs, size)
        moved = self._step.run(frame.textures["filled"], depth, frame.camera, keyframe)
        self.share = self._step.share
        if self._software and self.share < _LEAST_SHARE:  # left behind; a GPU tells it a frame late
            self._shown = None
            self._retire(keyframe)
        return replace(frame, textures={**frame.textures, "filled": moved})

    def forget(self) -> None:
        """Gives up every keyframe: the scene, its settings or its edits are others."""
        for owned in (self._shown, self._coming, self._spare, self._step):
            if owned is not None:
                owned.release()
        self._shown = self._coming = self._spare = self._step = self._key = self.share = None

    release = forget
