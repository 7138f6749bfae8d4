"""The sheet of the Section tool before it is saved: drawn coarsely on a thread, over the picture, anew when the cut changes."""

from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Any

import numpy as np

from ...kit.worker import Worker
from ..editing import end
from ..tool import ToolContext

if TYPE_CHECKING:
    import moderngl

LONGEST = 1400
"""Pixels of the longer side of a preview; about what a window has room for."""
LEAST_DPI, MOST_DPI = 4, 110
"""Pixels an inch of a preview's paper."""
_SHARE = 0.86
"""Share of the picture that a preview takes at most."""


def preview_dpi(extent: float, scale: float, metres: float) -> int:
    """Pixels an inch at which a sheet of something ``extent`` file units long, at 1:``scale``, is about LONGEST pixels long."""
    inches = extent * metres / scale / 0.0254
    return int(np.clip(LONGEST / max(inches, 1e-9), LEAST_DPI, MOST_DPI))


class SheetPreview:
    """shown: whether the preview is open.  problem: why there is none, in a line.  image: (H, W, 3) uint8, None until drawn."""

    def __init__(self) -> None:
        self.shown, self.problem = False, ""
        self.image: np.ndarray | None = None
        self._texture: moderngl.Texture | None = None
        self._of: Hashable = None
        self._worker: Worker | None = None

    def follow(self, context: ToolContext, of: Hashable, draw: Callable[[], np.ndarray] | None) -> None:
        """Called in every turn: begins a drawing where what it is drawn of has changed, and takes one that is ready.

        of: what the sheet is drawn of.  draw: makes its picture, None where there is nothing to draw.
        """
        if self._worker is not None and self._worker.finished:
            done, self._worker = self._worker, None
            self.problem = str(done.error or "")
            if not done.cancelled:
                self._keep(done.result if done.error is None else None)
        if not self.shown:
            self._of = None
            self._keep(None)
            return
        if draw is None or of == self._of:
            return
        if self._worker is not None:
            self._worker.cancel()
            self._of = None
            return  # the next turn begins the drawing of now
        self._of, self._worker = of, Worker(draw, "Drawing the preview", context.session.loads.wake)

    def draw(self, ui: Any, context: ToolContext) -> None:
        """The sheet over the middle of the picture, with a button that closes it."""
        if not self.shown:
            return
        (left, top), (width, height) = context.session.area.origin, context.session.area.size
        density = context.session.area.density
        left, top, width, height = (value / density for value in (left, top, width, height))
        ui.set_next_window_pos((left + width / 2, top + height / 2), ui.Cond_.always, (0.5, 0.5))
        flags = (ui.WindowFlags_.no_decoration | ui.WindowFlags_.always_auto_resize | ui.WindowFlags_.no_move
                 | ui.WindowFlags_.no_saved_settings)
        ui.begin("sheet preview", None, flags)
        if self.image is not None:
            rows, columns = self.image.shape[:2]
            scale = min(1.0, _SHARE * width / columns, (_SHARE * height - context.theme.px(40)) / rows)
            if self._texture is None:
                self._texture = context.texture(self.image)
            ui.image(ui.ImTextureRef(self._texture.glo), (columns * scale, rows * scale))
        else:
            ui.text_unformatted(self.problem or "Drawing…")
        if ui.button("Close preview"):
            self.shown = False
        if self._worker is not None and self.image is not None:
            ui.same_line()
            ui.text_unformatted("Drawing anew…")
        ui.end()

    def close(self) -> None:
        """Ends a drawing and frees the texture."""
        end(self._worker)
        self._worker = None
        self._keep(None)

    def _keep(self, image: np.ndarray | None) -> None:
        if self._texture is not None:
            self._texture.release()
            self._texture = None
        self.image = image
