"""The last pass: a view's texture, or two split at a line, over a background; and the canvas it is drawn on.

On software OpenGL this pass costs as much as a stage of the picture, so that each pixel reads one texture and divides nothing:
two views are two draws, each into its columns, and the background's colour of each row is a texture made on the host.

Everything in the window is drawn on this canvas and copied to the screen last, because the canvas can be read back (the
screen's buffer cannot, reliably).  Pictures have row 0 on top.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...picture.background import PLAIN, rows

if TYPE_CHECKING:
    import moderngl

    from ...render.device.shader import Programs


class Canvas:
    """Owns what the window shows, (width, height) pixels.  Row 0 of :meth:`read` is the top."""

    def __init__(self, context: "moderngl.Context", programs: "Programs", size: tuple[int, int]):
        self._context, self.size = context, size
        self.texture = context.texture(size, 4, dtype="f1")
        self.framebuffer = context.framebuffer([self.texture])
        self._exact = programs.drawing("present.vert", "present.frag", INTERPOLATED=None)
        self._interpolated = programs.drawing("present.vert", "present.frag", INTERPOLATED=1)
        self._behind: tuple[str, moderngl.Texture] | None = None
        self._copy = programs.drawing("present.vert", "present_copy.frag")
        self._draw_exact = context.vertex_array(self._exact, [])
        self._draw_interpolated = context.vertex_array(self._interpolated, [])
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
        column = width if right is None else column
        self._draw(left, (x, bottom), (width, height), (0, column), background)
        if right is not None:
            self._draw(right, (x, bottom), (width, height), (column, width), background)
        self.framebuffer.scissor = None  # type: ignore[assignment]  # the whole canvas
        self.framebuffer.viewport = (0, 0, *self.size)

    def _draw(self, view: "moderngl.Texture", origin: tuple[int, int], size: tuple[int, int], columns: tuple[int, int],
              background: str) -> None:
        """Draws the pixel columns from columns[0] to columns[1], exclusive, of a picture of ``size`` whose lower left corner
        is at ``origin`` of the canvas."""
        first, end = columns
        if end <= first:
            return
        exact = view.size == size
        program = self._exact if exact else self._interpolated
        self.framebuffer.scissor = (origin[0] + first, origin[1], end - first, size[1])
        view.use(0)
        self._rows(background, size[1]).use(1)
        program["view"], program["rows"] = 0, 1
        program["origin"], program["size"] = origin, size
        (self._draw_exact if exact else self._draw_interpolated).render(vertices=3)

    def _rows(self, background: str, height: int) -> "moderngl.Texture":
        """The background's colour of each row, (1, height) pixels, row 0 on top."""
        if self._behind is None or self._behind[0] != background or self._behind[1].height != height:
            if self._behind is not None:
                self._behind[1].release()
            texture = self._context.texture((1, height), 3, rows(background, height).tobytes(), alignment=1)
            self._behind = background, texture
        return self._behind[1]

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
        behind = [] if self._behind is None else [self._behind[1]]
        for owned in (self._draw_exact, self._draw_interpolated, self._draw_copy, self.framebuffer, self.texture, *behind):
            owned.release()
