"""The fields of one note in the panel: its text, status, link and attached picture."""

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ....readers.decoded_picture import ending_of
from ....work.notes.annotation import PICTURE_ENDINGS, STATUSES, Annotation, is_address, is_picture_name
from ....work.notes.attached_picture import attached_bytes, attached_picture
from ....work.notes.shared_pictures import remember_attached
from ...kit.theme import OVERLAY_COLOURS, fitted, packed
from ...kit.widgets import compact_button, tooltip_beside
from ...kit.worker import Worker
from ..editing import end
from ..stations.picture_viewer import PictureViewer, Viewed
from ..tool import ToolContext
from .note_markers import COLOUR_OF

if TYPE_CHECKING:
    import moderngl

_LINES = 5.5
"""Of the text field."""
_ASKS = 8
"""Frames: imgui takes the press and the release of the click that made the note in frames of their own, some frames late, and
gives up the keys with them."""
_THUMBNAIL = 512
"""Pixels of a small picture's longer side: twice what the panel is wide."""


class NoteActions(Protocol):
    """What the fields do with a note of the document: the tool."""

    def change(self, context: ToolContext, number: int, label: str, gesture: object = None, **changes: Any) -> None: ...
    def fly_to(self, context: ToolContext, number: int) -> None: ...
    def delete(self, context: ToolContext, number: int) -> None: ...


class NoteFields:
    """viewer: shows an attached picture over the view."""

    def __init__(self) -> None:
        self._asks, self._active = 0, False  # frames in which the text still asks for the keys; whether it has them
        self.viewer = PictureViewer()
        self._path = ""
        self._small: np.ndarray | None = None
        self._problem = ""
        self._texture: moderngl.Texture | None = None
        self._worker: Worker | None = None

    def type(self) -> None:
        """The text takes the keys from the next frame on."""
        self._asks, self._active = _ASKS, False

    @property
    def asks(self) -> bool:
        """Whether the text asks for the keys, or has just got them."""
        return self._asks > 0

    def follow(self, context: ToolContext, note: Annotation | None) -> None:
        """Reads the attached picture of the note that is shown, on a thread; only of that one."""
        self.viewer.follow()
        path = note.picture if note is not None else ""
        if path != self._path:
            self._forget()
            self._path = path
            if path:
                self._worker = Worker(lambda: attached_picture(path, _THUMBNAIL)[0], "Reading the picture",
                                      context.session.loads.wake)
        if self._worker is not None and self._worker.finished:
            done, self._worker = self._worker, None
            self._small, self._problem = done.result, str(done.error or "")

    def _forget(self) -> None:
        if self._texture is not None:
            self._texture.release()
        if self._worker is not None:
            self._worker.cancel()
        self._path, self._small, self._problem, self._texture, self._worker = "", None, "", None, None
        self.viewer.close_picture()

    def close(self) -> None:
        """The window closes."""
        end(self._worker)
        self._forget()
        self.viewer.close()

    def draw(self, ui: Any, context: ToolContext, tool: NoteActions, number: int) -> None:
        """The fields of a note; each change is a step of the document."""
        note = context.document.annotations[number]
        ui.push_id(note.made or str(number))  # of another note it is another field, which has not the text being typed
        if self._asks > 0 and not self._active:
            ui.set_keyboard_focus_here()
        changed, text = ui.input_text_multiline("##text", note.text, (-1, _LINES * ui.get_text_line_height()),
                                                ui.InputTextFlags_.word_wrap)
        self._asks, self._active = max(self._asks - 1, 0), ui.is_item_active()
        if self._asks > 0:
            context.wake()  # a window at rest draws no further frame
        if changed and not ui.is_key_pressed(ui.Key.escape):  # Esc leaves the field; imgui would take back what was typed
            tool.change(context, number, "Text of a note", ("note text", number), text=text)
        if not note.text and not ui.is_item_active():
            low, pad = ui.get_item_rect_min(), ui.get_style().frame_padding
            at = low.x + pad.x, low.y + pad.y
            ui.get_window_draw_list().add_text(at, packed(OVERLAY_COLOURS["dim"]), "What is to be said here")
        self._status(ui, context, tool, number)
        self._link(ui, context, tool, number)
        self._picture(ui, context, tool, number)
        ui.begin_disabled(note.view is None)
        if ui.button("Fly to it"):
            tool.fly_to(context, number)
        if ui.is_item_hovered():
            tooltip_beside(ui, "To where it was written")
        ui.end_disabled()
        ui.same_line()
        if ui.button("Delete note"):
            tool.delete(context, number)
        ui.pop_id()

    def _status(self, ui: Any, context: ToolContext, tool: NoteActions, number: int) -> None:
        note = context.document.annotations[number]
        ui.set_next_item_width(-1)
        if ui.begin_combo("##status", STATUSES[note.status].name):
            for key, status in STATUSES.items():
                if ui.selectable(status.name, key == note.status)[0] and key != note.status:
                    tool.change(context, number, "Status of a note", status=key)
            ui.end_combo()
        if ui.is_item_hovered():
            tooltip_beside(ui, "What has become of it; the colour of its marker")

    def _link(self, ui: Any, context: ToolContext, tool: NoteActions, number: int) -> None:
        note = context.document.annotations[number]
        opens = is_address(note.link)
        ui.set_next_item_width(-64.0 * context.theme.scale if opens else -1)
        changed, link = ui.input_text_with_hint("##link", "link: https://…", note.link)
        if changed:
            tool.change(context, number, "Link of a note", ("note link", number), link=link.strip())
        if opens:
            ui.same_line()
            if compact_button("Open", context.theme):
                webbrowser.open(note.link)
            if ui.is_item_hovered():
                tooltip_beside(ui, f"Open {note.link} in the browser")
        elif note.link and not ui.is_item_active():
            ui.text_wrapped("A link begins with https:// or http://")

    def _picture(self, ui: Any, context: ToolContext, tool: NoteActions, number: int) -> None:
        note = context.document.annotations[number]
        if not note.picture:
            if ui.button("Attach a picture…"):
                context.files.open("photographs", "Attach a picture", {"Pictures": PICTURE_ENDINGS},
                                   lambda paths: self._attach(context, tool, note, paths))
            return
        if self._small is not None:
            if self._texture is None:
                self._texture = context.texture(self._small)
            rows, columns = self._small.shape[:2]
            scale = min(ui.get_content_region_avail().x / columns, 1.0)
            ui.image(ui.ImTextureRef(self._texture.glo), (columns * scale, rows * scale))
            if ui.is_item_hovered():
                tooltip_beside(ui, "Click: look at it over the view")
            if ui.is_item_clicked():
                self.look(context, note.picture)
        else:
            ui.text_wrapped(self._problem or "Reading the picture…")
        ui.text_unformatted(fitted(Path(note.picture).name, ui.get_content_region_avail().x))
        if compact_button("Look at it", context.theme):
            self.look(context, note.picture)
        ui.same_line()
        if compact_button("Take it off", context.theme):
            tool.change(context, number, "Take a picture off", picture="")

    def look(self, context: ToolContext, path: str) -> None:
        """Shows an attached picture over the view."""
        def file() -> tuple[bytes, str]:
            data = attached_bytes(path)
            return data, ending_of(data, path)

        self.viewer.open(context, Viewed(path, Path(path).stem, lambda longest: attached_picture(path, longest), file))

    def _attach(self, context: ToolContext, tool: NoteActions, asked: Annotation, paths: list[Path]) -> None:
        """Attaches to the note for which the dialog was opened: notes may have been deleted or edited since."""
        path, notes = str(paths[0]), context.document.annotations
        place = next((number for number, note in enumerate(notes) if note.identity == asked.identity), None)
        if not is_picture_name(path):
            context.toast(f"{paths[0].name} is not attached: a picture ends in {', '.join(PICTURE_ENDINGS)}")
        elif place is not None:
            remember_attached(path)
            tool.change(context, place, "Attach a picture", picture=path)


def swatch(ui: Any, context: ToolContext, note: Annotation) -> None:
    """The colour of a note's status, on the line of what comes next."""
    side, at = ui.get_text_line_height() * 0.6, ui.get_cursor_screen_pos()
    top = at.y + 0.5 * (ui.get_text_line_height() - side)
    colour = packed(OVERLAY_COLOURS[COLOUR_OF[note.status]])
    ui.get_window_draw_list().add_rect_filled((at.x, top), (at.x + side, top + side), colour, context.theme.px(2.0))
