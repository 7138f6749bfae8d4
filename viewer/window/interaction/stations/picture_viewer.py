"""A photograph looked at by itself over the view: zoomed with the wheel, moved with the mouse, saved as a file.

For photographs of the scan, with a pose or without one, and for pictures that are attached to notes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ....common.errors import PointglassError
from ....common.file_names import safe_name
from ....readers.e57.e57_pictures import StoredPicture, picture_file, picture_of
from ...kit.theme import fitted
from ...kit.widgets import compact_button, tooltip_beside
from ...kit.worker import Worker
from ...saving.capture import write_beside
from ..editing import end
from ..tool import ToolContext

if TYPE_CHECKING:
    import moderngl

LONGEST = 8192
"""Pixels of a photograph's longer side as it is shown: what every GPU has as a texture."""
_NOTCH = 1.25
"""Factor of the zoom by one notch of the wheel."""
_MOST = 32.0
"""Window pixels per pixel of the photograph, at most."""


@dataclass(frozen=True)
class Viewed:
    """A photograph.  key: what it is of, to tell it by.  read: longest side in pixels -> (H, W, 3) uint8 sRGB, and the (width,
    height) of its file; on a thread.  file: its bytes as they are stored, and the ending of its name.  Both raise
    PointglassError."""

    key: object
    name: str
    read: Callable[[int], tuple[np.ndarray, tuple[int, int]]]
    file: Callable[[], tuple[bytes, str]]


def of_scan(stored: StoredPicture) -> Viewed:
    """A photograph inside a scan."""
    return Viewed(stored, stored.name, partial(picture_of, stored), partial(picture_file, stored))


def file_name(name: str) -> str:
    """The name of a photograph as that of a file, without an ending: names from a file may hold anything."""
    return safe_name(name.removesuffix(".jpg").removesuffix(".png"), "photograph")


class PictureViewer:
    """viewed: the photograph that is shown, None where the viewer is closed.  zoom: window pixels per pixel of the photograph
    as shown, None: as large as fits.  centre: the share of its width and height that lies in the middle of the viewer."""

    def __init__(self) -> None:
        self.viewed: Viewed | None = None
        self.zoom: float | None = None
        self.centre = np.array([0.5, 0.5])
        self.problem = ""
        self.full = (0, 0)
        self._image: np.ndarray | None = None
        self._texture: moderngl.Texture | None = None
        self._worker: Worker | None = None

    def shows(self, key: object) -> bool:
        """Whether the photograph with this key is shown."""
        return self.viewed is not None and self.viewed.key is key

    def open(self, context: ToolContext, viewed: Viewed) -> None:
        """Shows a photograph; it is decoded on a thread."""
        self.close_picture()
        self.viewed = viewed
        self._worker = Worker(lambda: viewed.read(LONGEST), "Decoding the photograph", context.session.loads.wake)

    def close_picture(self) -> None:
        """Closes the viewer."""
        if self._texture is not None:
            self._texture.release()
        self.viewed, self._image, self._texture, self._worker = None, None, None, None
        self.zoom, self.centre, self.problem = None, np.array([0.5, 0.5]), ""

    def follow(self) -> None:
        """Takes the photograph that a thread has decoded."""
        if self._worker is not None and self._worker.finished:
            done, self._worker = self._worker, None
            self.problem = str(done.error or "")
            if done.result is not None:
                self._image, self.full = done.result

    def close(self) -> None:
        """The window closes."""
        end(self._worker)
        self.close_picture()

    def save(self, context: ToolContext) -> None:
        """Asks where the photograph is saved; the file holds the bytes that the scan holds."""
        viewed = self.viewed
        if viewed is None:
            return
        try:
            data, ending = viewed.file()
        except PointglassError as error:
            context.session.notices.say("The photograph cannot be saved", error)
            return
        kind = {"JPEG, as it is stored": (".jpg", ".jpeg")} if ending == ".jpg" else {"PNG, as it is stored": (".png",)}

        def write(path) -> None:
            try:
                write_beside(path, data)
            except PointglassError as error:
                context.session.notices.say("The photograph was not saved", error)
            else:
                context.tell_saved(path)

        context.files.save("photographs", "Save the photograph", file_name(viewed.name) + ending, kind, write)

    # -- drawing -----------------------------------------------------------------------------------------------------

    def draw(self, ui: Any, context: ToolContext) -> None:
        """The photograph over the whole picture, and a row of buttons above it."""
        if self.viewed is None:
            return
        density, area = context.session.area.density, context.session.area
        left, top, width, height = (value / density for value in (*area.origin, *area.size))
        ui.set_next_window_pos((left, top))
        ui.set_next_window_size((width, height))
        ui.set_next_window_bg_alpha(1.0)
        ui.push_style_var(ui.StyleVar_.window_rounding, 0.0)
        flags = (ui.WindowFlags_.no_decoration | ui.WindowFlags_.no_move | ui.WindowFlags_.no_saved_settings
                 | ui.WindowFlags_.no_scroll_with_mouse | ui.WindowFlags_.no_nav)
        ui.begin("photograph", None, flags)
        ui.pop_style_var()
        self._row(ui, context)
        if self.viewed is not None and self._image is not None:
            self._picture(ui, context)
        elif self.viewed is not None:
            ui.text_wrapped(self.problem or "Decoding…")
        ui.end()

    def _row(self, ui: Any, context: ToolContext) -> None:
        assert self.viewed is not None
        for label, act, tip in (
            ("Fit", lambda: self.look(None), "the whole photograph"), ("1:1", lambda: self.look(1.0), "one pixel a pixel"),
            ("Save…", lambda: self.save(context), "the file as it is stored"),
            ("Close", self.close_picture, "back to the view (Esc)"),
        ):  # fmt: skip
            if label != "Fit":
                ui.same_line()
            if compact_button(label, context.theme):
                act()
            if ui.is_item_hovered():
                tooltip_beside(ui, tip)
        if self.viewed is None:
            return
        ui.same_line()
        ui.align_text_to_frame_padding()
        shown = f" · {100 * self.zoom:.0f} %" if self.zoom is not None else ""
        size = f" · {self.full[0]} x {self.full[1]}" if self._image is not None else ""
        ui.text_unformatted(fitted(f"{self.viewed.name}{size}{shown}", ui.get_content_region_avail().x))

    def look(self, zoom: float | None) -> None:
        """Shows the photograph at another size; None: as large as fits."""
        self.zoom = zoom
        if zoom is None:
            self.centre = np.array([0.5, 0.5])

    def _picture(self, ui: Any, context: ToolContext) -> None:
        assert self._image is not None
        if self._texture is None:
            self._texture = context.texture(self._image)
        at, room = ui.get_cursor_screen_pos(), ui.get_content_region_avail()
        room = np.array([max(room.x, 1.0), max(room.y, 1.0)])
        size = np.array(self._image.shape[1::-1], float)
        fits = float((room / size).min())
        scale = min(fits, 1.0) if self.zoom is None else self.zoom
        ui.invisible_button("##photograph", tuple(room))
        middle, io = np.array([at.x, at.y]) + room / 2, ui.get_io()
        if ui.is_item_hovered() and io.mouse_wheel:
            wanted = float(np.clip(scale * _NOTCH**io.mouse_wheel, min(fits, 1.0), _MOST))
            under = np.array([io.mouse_pos.x, io.mouse_pos.y]) - middle
            self.centre += under / size * (1 / scale - 1 / wanted)  # what is under the pointer stays there
            self.zoom = scale = wanted
        if ui.is_item_active() and self.zoom is not None:
            self.centre -= np.array([io.mouse_delta.x, io.mouse_delta.y]) / (size * scale)
        half = np.minimum(room / (2 * size * scale), 0.5)  # no farther than its edges
        self.centre = np.clip(self.centre, half, 1 - half)
        low = middle - self.centre * size * scale
        high = low + size * scale
        draw = ui.get_window_draw_list()
        draw.push_clip_rect((at.x, at.y), (at.x + room[0], at.y + room[1]), True)
        draw.add_image(ui.ImTextureRef(self._texture.glo), tuple(low), tuple(high))
        draw.pop_clip_rect()
