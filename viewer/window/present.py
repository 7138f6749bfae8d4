"""The last pass: a view's texture, or two split at a line, over a background; and the canvas it is drawn on.

Everything in the window is drawn on this canvas and copied to the screen last, because the canvas can be read back (the
screen's buffer cannot, reliably).  Pictures have row 0 on top.
"""

from typing import TYPE_CHECKING

import numpy as np

from viewer.tools.background import COLOURS, PLAIN

if TYPE_CHECKING:
    import moderngl

    from viewer.render.shader import Programs


def split_column(split: float, width: int) -> int:
    """First pixel column of the right side for a line at ``split`` (0 to 1) of the width."""
    return int(np.clip(round(split * width), 0, width))


class Canvas:
    """Owns what the window shows, (width, height) pixels.  Row 0 of :meth:`read` is the top."""

    def __init__(self, context: "moderngl.Context", programs: "Programs", size: tuple[int, int]):
        self._context, self.size = context, size
        self.texture = context.texture(size, 4, dtype="f1")
        self.framebuffer = context.framebuffer([self.texture])
        self._compose = programs.drawing("present.vert", "present.frag")
        self._copy = programs.drawing("present.vert", "present_copy.frag")
        self._draw_compose = context.vertex_array(self._compose, [])
        self._draw_copy = context.vertex_array(self._copy, [])

    def show(self, left: "moderngl.Texture | None", right: "moderngl.Texture | None" = None, column: int = 0,
             background: str = "plain", area: tuple[int, int, int, int] | None = None) -> None:
        """Draws ``left``, and ``right`` from pixel column ``column`` of the picture on where it is given, over a background (a
        key of COLOURS); without either, the plain background.

        area: left, top, width and height of the picture on the canvas, pixels; None: all of it.
        """
        self.framebuffer.use()
        self._context.enable_only(0)
        x, y, width, height = area or (0, 0, *self.size)
        if left is None or (width, height) != self.size:
            red, green, blue = (c / 255 for c in PLAIN)
            self.framebuffer.clear(red, green, blue, 1.0)
        if left is None:
            return
        bottom = self.size[1] - y - height
        self.framebuffer.viewport = (x, bottom, width, height)
        left.use(0)
        (right or left).use(1)
        self._compose["left"], self._compose["right"] = 0, 1
        self._compose["origin"], self._compose["size"] = (x, bottom), (width, height)
        self._compose["column"] = column if right is not None else width
        self._compose["top"], self._compose["bottom"] = COLOURS[background]
        self._draw_compose.render(vertices=3)
        self.framebuffer.viewport = (0, 0, *self.size)

    def to_screen(self) -> None:
        """Copies the canvas to the window."""
        screen = self._context.screen
        screen.use()
        self._context.viewport = (0, 0, *self.size)
        self._context.enable_only(0)
        self.texture.use(0)
        self._copy["picture"] = 0
        self._draw_copy.render(vertices=3)

    def read(self) -> np.ndarray:
        """(H, W, 3) uint8, row 0 on top: what the window shows."""
        width, height = self.size
        data = self.framebuffer.read(components=3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1].copy()

    def release(self) -> None:
        for owned in (self._draw_compose, self._draw_copy, self.framebuffer, self.texture):
            owned.release()
