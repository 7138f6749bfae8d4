"""Where the picture lies in the window: its place, its size, the panels beside it, and whether the size has settled.

Frames: logical pixels for the interface, framebuffer pixels for the picture; ``density`` is framebuffer pixels per logical
pixel.  No imgui and no GL.
"""

from collections.abc import Callable

from ..kit.layout import Layout, Panels, Rect, arrange

_SETTLE_SECONDS = 0.3
"""Seconds that a window must have kept its size before the network runs for it: a drag of its edge passes through many."""


class WindowArea:
    """size: of the picture; window_size: of the framebuffer; pixels, both (0, 0) while minimised.  last_size: of the picture,
    as it was before it was minimised.
    origin: left and top of the picture, framebuffer pixels.  panels: which are open.  layout: where everything is."""

    def __init__(self, size: tuple[int, int], clock: Callable[[], float]):
        self._clock = clock
        self.size = self.window_size = size
        self.last_size = size if min(size) > 0 else (16, 9)
        self.origin, self.density = (0, 0), 1.0
        self.panels = Panels()
        self.layout = Layout(Rect(0.0, 0.0, *map(float, size)))
        self._resized = -_SETTLE_SECONDS
        self._scale: float | None = None  # of the interface, once it was arranged

    @property
    def visible(self) -> bool:
        """Whether the picture has any pixels."""
        return min(self.size) > 0

    @property
    def aspect(self) -> float:
        """Width over height of the picture."""
        width, height = self.last_size
        return width / height

    @property
    def settles_in(self) -> float:
        """Seconds until the picture's size counts as settled; not above 0: it has."""
        return self._resized + _SETTLE_SECONDS - self._clock()

    def place_of(self, size: tuple[int, int]) -> tuple[int, int, int, int]:
        """Left, top, width, height, framebuffer pixels, of a picture of ``size``.  One of a former size keeps its scale and its
        middle until the next is made: a camera's field of view is that of the height, which folding a panel leaves."""
        (left, top), (width, height) = self.origin, self.size
        return left + (width - size[0]) // 2, top + (height - size[1]) // 2, *size

    def resize(self, size: tuple[int, int]) -> bool:
        """The framebuffer's size in pixels; (0, 0) while minimised.  The picture has all of it until :meth:`arrange`.

        Returns whether the picture's size changed.
        """
        if size == self.window_size:
            return False
        self.window_size = size
        return self._place((0, 0), size)

    def arrange(self, *, panels: bool, scale: float | None = None) -> bool:
        """Gives the picture the space that panels and status bar leave.

        panels: whether there are any; else the picture has all.  scale: interface pixels per design unit; None: that of
        the last call, nothing before the first.  Returns whether the picture's size changed.
        """
        self._scale = scale if scale is not None else self._scale
        if self._scale is None or min(self.window_size) == 0:
            return False
        width, height = (pixels / self.density for pixels in self.window_size)
        self.panels.fit(width, self._scale)
        self.layout = arrange(width, height, self._scale, self.panels) if panels else Layout(Rect(0.0, 0.0, width, height))
        picture = self.layout.picture
        left, top = round(picture.left * self.density), round(picture.top * self.density)
        right = round((picture.left + picture.width) * self.density)
        bottom = round((picture.top + picture.height) * self.density)
        return self._place((left, top), (max(right - left, 1), max(bottom - top, 1)))

    def _place(self, origin: tuple[int, int], size: tuple[int, int]) -> bool:
        self.origin = origin
        changed = size != self.size
        if changed:
            self.size, self._resized = size, self._clock()
            self.last_size = size if self.visible else self.last_size
        return changed
