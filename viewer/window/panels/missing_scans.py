"""Scans of a project that are not there: the window asks where they are, checks the answer, and opens the project with it."""

import contextlib
import os
from pathlib import Path
from typing import Protocol

from imgui_bundle import ImVec2, imgui

from ...common.errors import InputError
from ...readers.formats import FORMATS
from ...work.moved_scans import MissingScans, ScanPlace, difference
from ...work.project import is_project, places_in
from ..file_dialog.file_dialogs import FileDialogs
from ..kit import theme
from ..kit.chosen_button import ChosenButton
from ..kit.theme import Theme, fitted
from ..kit.widgets import button
from ..session.session import Session

_FLAGS = (
    imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_move | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_saved_settings
)  # fmt: skip
_POPUP = "missing scans"


class Host(Protocol):
    """What the question needs of the window: what is being opened, and dialogs that ask for a file."""

    session: Session
    files: FileDialogs


class MissingScansDialog:
    """asked: the scans that are missing, as the loader found them, None where none is.  doubt: a file that a person chose and
    why it may be another scan, None where nothing speaks against it."""

    def __init__(self) -> None:
        self.asked: MissingScans | None = None
        self.doubt: tuple[Path, str] | None = None
        self._places: dict[str, ScanPlace] = {}
        self._found: dict[str, str | None] = {}  # path in the project -> where it is now; None: left out
        self._left: list[Path] = []
        self._chosen = ChosenButton()

    def follow(self, app: Host) -> None:
        """Called in every turn of the loop: takes over what the loader has found missing."""
        news, app.session.loads.missing = app.session.loads.missing, None
        if news is not None:
            self.asked, self.doubt, self._found, self._left = news, None, {}, list(news.scans)
            self._places = {}
            with contextlib.suppress(InputError):  # an autosave is no project, and has no places
                self._places = places_in(news.project)

    @property
    def scan(self) -> Path:
        """The scan that is asked for now, as the project has it."""
        return self._left[0]

    def locate(self, app: Host) -> None:
        """Asks for the file, or the folder, that the scan is now."""
        scan, place = self.scan, self._place(self.scan)
        nearest = next((folder for folder in scan.parents if folder.is_dir()), None)
        known = any(scan.suffix.lower() in row.suffixes for row in FORMATS)
        if not scan.suffix or (place.size is None and not known):
            app.files.open_folder("scans", f"Locate {scan.name}", lambda folder: self.take(app, folder))
        else:
            app.files.open("scans", f"Locate {scan.name}", {f"Like {scan.name}": (scan.suffix.lower(),)},
                           lambda files: self.take(app, files[0]), folder=nearest)

    def _place(self, scan: Path) -> ScanPlace:
        return self._places.get(str(scan), ScanPlace())

    def take(self, app: Host, chosen: Path) -> None:
        """A person chose a file: it is used where nothing speaks against it."""
        text = difference(chosen, str(self.scan), self._place(self.scan))
        if text:
            self.doubt = chosen, text
        else:
            self.use(app, chosen)

    def use(self, app: Host, chosen: Path | None) -> None:
        """The scan asked for is ``chosen`` (None: left out); others that lie beside it are found with it."""
        self.doubt = None
        self._found[str(self._left.pop(0))] = None if chosen is None else str(chosen)
        for scan in list(self._left):
            other = scan if chosen is None else chosen.parent / scan.name
            if other.exists() and not difference(other, str(scan), self._place(scan)):
                self._found[str(scan)] = str(other)
                self._left.remove(scan)
        if not self._left and self.asked is not None:
            self.asked = None
            app.session.work.located.update(self._found)
            app.session.loads.open_again()

    def cancel(self) -> None:
        """Takes the last choice back, or gives the project up."""
        if self.doubt is not None:
            self.doubt = None
        else:
            self.asked = None

    def draw(self, app: Host, style: Theme, *, covered: bool) -> None:
        """covered: a message or a file dialog is open, which hides the question meanwhile."""
        if self.asked is None or covered:
            return
        if not imgui.is_popup_open(_POPUP):
            imgui.open_popup(_POPUP)
        size, px = imgui.get_io().display_size, style.px
        imgui.set_next_window_pos(ImVec2(size.x / 2, size.y / 2), 0, ImVec2(0.5, 0.5))
        imgui.set_next_window_bg_alpha(1.0)
        if not imgui.begin_popup_modal(_POPUP, None, _FLAGS)[0]:
            return
        width = min(px(560), size.x - px(96))
        imgui.push_font(style.bold, theme.TITLE)
        of = self.asked.project.name if is_project(self.asked.project) else "Unsaved work"  # else the name of an autosave
        imgui.text_unformatted(fitted(f"{of}: a scan is not there", width))
        imgui.pop_font()
        imgui.push_text_wrap_pos(px(16) + width)
        more = f"\n{len(self._left) - 1} more are missing; those beside it are found with it." if self._left[1:] else ""
        asked = f"{os.path.normpath(self.scan)}{more}"
        text = f"{self.doubt[0]}\n{self.doubt[1]} Use it all the same?" if self.doubt else asked
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.dummy(ImVec2(width, px(4)))
        appearing = imgui.is_window_appearing()  # then the key of this frame closed what covered the question
        other, disabled = ("Use it", "") if self.doubt is not None else ("Leave it out", self._last_visible())
        labels = [other, "Cancel", "Locate…"][bool(disabled):]
        entered = self._chosen.follow((self.asked, self.scan, self.doubt), labels, "Locate…", appearing=appearing)
        pressed, doubt = self._buttons(style, width, other, disabled) or entered, self.doubt
        if pressed == "Use it" and doubt is not None:
            self.use(app, doubt[0])
        elif pressed == "Leave it out":
            self.use(app, None)
        elif pressed == "Cancel" or (not appearing and imgui.is_key_pressed(imgui.Key.escape, False)):
            self.cancel()
        elif pressed:
            self.doubt = None
            self.locate(app)
        imgui.end_popup()

    def _buttons(self, style: Theme, width: float, other: str, disabled: str) -> str:
        """Draws the buttons, ``other`` at the left.  Returns the label of the one that was clicked, "" for none."""
        px, clicked = style.px, ""
        explained = "Opens the project without this scan, which stays in it" if self.doubt is None else ""
        if button(other, style, width=px(120), disabled=disabled, explained=explained, primary=other == self._chosen.label):
            clicked = other
        imgui.same_line()
        imgui.set_cursor_pos_x(px(16) + width - 2 * px(120) - px(8))
        for label in ("Cancel", "Locate…"):
            if button(label, style, width=px(120), primary=label == self._chosen.label):
                clicked = label
            if label == "Cancel":
                imgui.same_line(0, px(8))
        return clicked

    def _last_visible(self) -> str:
        """Why the scan cannot be left out."""
        if self.asked is None or len(self._places) > len([path for path, now in self._found.items() if now is None]) + 1:
            return ""
        return "It is the only scan of the project"
