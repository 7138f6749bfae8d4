"""Titles of a film in the window: the fields of the opening title and of a keyframe's caption, and both over the view.

Over the view titles are as in the film, for a picture of the view's size: while the preview plays, and while one is typed.
"""

from dataclasses import replace
from math import isfinite
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from ....common.fonts import title_fonts, undrawable, undrawable_line
from ....work.cameras.keyframes import titles_along
from ....work.document import LONGEST_TEXT, LONGEST_TITLE, CameraPath, FilmTitle
from ....work.pictures.film_titles import TimedTitle, title_sheet
from ...kit import theme
from ...kit.theme import packed
from ...kit.widgets import tooltip_beside
from ..tool import ToolContext

if TYPE_CHECKING:
    import moderngl

    from ...kit.overlay import OverlayCanvas

_LINES = 3.0
"""Height of a field, in lines."""
_MOST_KEPT = 12
"""Textures of titles that are kept: each letter that is typed makes one."""


class TitleFields:
    """typed: the title that is being typed and whether it is the opening one, None while none is."""

    def __init__(self) -> None:
        self.typed: tuple[FilmTitle, bool] | None = None
        self._textures: dict[tuple[object, ...], tuple[moderngl.Texture, int, int]] = {}

    @staticmethod
    def prepare() -> None:
        """Loads what draws letters, beside the window: the first letter that is typed would wait for it."""
        Thread(target=lambda: title_sheet("A", True, 64, 64) and undrawable("A", title_fonts()), daemon=True).start()

    def field(self, ui: Any, context: ToolContext, title: FilmTitle | None, opening: bool) -> FilmTitle | None:
        """The rows of a title; returns what it is now.  ui: the imgui module."""
        name = "opening title" if opening else "caption"
        text = title.text if title is not None else ""
        changed, text = ui.input_text_multiline(f"##{name}", text, (-1, _LINES * ui.get_text_line_height()),
                                                ui.InputTextFlags_.word_wrap)
        active = ui.is_item_active()
        if ui.is_item_hovered() and not active:
            tooltip_beside(ui, "over the beginning of the film; lines after the first are smaller" if opening
                               else "at the lower left, from when the camera arrives at this keyframe")
        if not text and not active:
            low, pad = ui.get_item_rect_min(), ui.get_style().frame_padding
            ui.get_window_draw_list().add_text((low.x + pad.x, low.y + pad.y), packed(theme.DIM), f"{name}…")
        if changed and not ui.is_key_pressed(ui.Key.escape):  # Esc leaves the field; imgui would take back what was typed
            title = replace(title or FilmTitle("."), text=text[:LONGEST_TEXT]) if text.strip() else None
        ui.set_next_item_width(-1)
        ui.begin_disabled(title is None)  # drawn all the same: what follows would move while the first letter is typed
        turned, seconds = ui.drag_float(f"##{name} seconds", (title or FilmTitle(".")).seconds, 0.05, 0.1, LONGEST_TITLE,
                                        "shown %.1f s", ui.SliderFlags_.always_clamp)
        ui.end_disabled()
        if title is None:
            return None
        if turned and isfinite(seconds):
            title = replace(title, seconds=seconds)
        if letters := undrawable(title.text, title_fonts()):
            ui.text_wrapped(f"It cannot be drawn: {undrawable_line(letters)}.")
        if active:
            self.typed = title, opening
        return title

    def draw(self, overlay: "OverlayCanvas", context: ToolContext, path: CameraPath, at: float | None) -> None:
        """Over the view.  at: seconds of the film that is shown, None while no preview plays."""
        if at is not None:
            for title in titles_along(path).shown:
                self._draw(overlay, context, title, title.opacity(at))
        elif self.typed is not None:
            title, opening = self.typed
            self._draw(overlay, context, TimedTitle(title.text, 0.0, title.seconds, opening), 1.0)
        self.typed = None  # the panel, which is drawn later in each frame, says so again

    def _draw(self, overlay: "OverlayCanvas", context: ToolContext, title: TimedTitle, opacity: float) -> None:
        from imgui_bundle import imgui

        left, top, width, height = overlay.area
        density = context.session.area.density
        size = round(width * density), round(height * density)
        if opacity <= 0 or min(size) < 1:
            return
        texture, x, y = self._texture(context, (title.text, title.opening, *size))
        low = left + x / density, top + y / density
        high = low[0] + texture.width / density, low[1] + texture.height / density
        tint = packed(imgui.ImVec4(1, 1, 1, 1), opacity)
        overlay.draw_list.add_image(imgui.ImTextureRef(texture.glo), low, high, (0, 0), (1, 1), tint)

    def _texture(self, context: ToolContext, key: tuple[Any, ...]) -> "tuple[moderngl.Texture, int, int]":
        if key not in self._textures:
            if len(self._textures) >= _MOST_KEPT:
                self._textures.pop(next(iter(self._textures)))[0].release()
            sheet, left, top = title_sheet(*key)
            size = sheet.shape[1], sheet.shape[0]
            made = context.viewport.context.texture(size, 4, np.ascontiguousarray(sheet).tobytes())
            self._textures[key] = made, left, top
        return self._textures[key]

    def close(self) -> None:
        """Releases the textures."""
        while self._textures:
            self._textures.popitem()[1][0].release()
