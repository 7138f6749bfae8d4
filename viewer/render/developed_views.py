"""The developed pictures of a frame (viewer.render.passes.develop), each made once."""

from typing import TYPE_CHECKING

from .passes.develop import Developer, needs

if TYPE_CHECKING:
    import moderngl

    from ..picture.look import Look
    from .device.shader import Programs
    from .frame import Frame


class DevelopedViews:
    """The developed pictures of a frame, each made once and kept until the frame or the look changes."""

    def __init__(self, programs: "Programs"):
        self._programs = programs
        self._developers: dict[str, Developer] = {}
        self._made: dict[str, tuple[Frame, tuple, moderngl.Texture]] = {}

    def texture(self, frame: "Frame", view: str, look: "Look", *, tint: bool, lock: bool) -> "moderngl.Texture":
        """A view of the frame with the look applied: the frame's own texture where the look changes nothing."""
        plain = frame.textures[view]
        if (tint or lock) and view != "raw" and "filtered" not in frame.textures:
            tint = lock = False  # of the frame before they were asked for
        if not needs(look, view, tint=tint, lock=lock):
            return plain
        key = (look, tint, lock, frame.facts.get("network_pending"))  # the network may add its picture later
        made = self._made.get(view)
        if made is not None and made[0] is frame and made[1] == key:
            return made[2]
        developer = self._developers.get(view)
        if developer is None or developer.size != plain.size:
            if developer is not None:
                developer.release()
            developer = self._developers[view] = Developer(self._programs, plain.size)
        texture = developer.run(frame, view, look, tint=tint, lock=lock)
        self._made[view] = frame, key, texture
        return texture

    def release(self) -> None:
        for developer in self._developers.values():
            developer.release()
        self._developers.clear()
        self._made.clear()
