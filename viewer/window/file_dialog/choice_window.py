"""Draws the file dialog inside the window (:class:`.file_choice.FileChoice`) with imgui, and gives it keys and clicks."""

from collections.abc import Sequence
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from ..kit import theme
from ..kit.chosen_button import ChosenButton
from ..kit.theme import Theme, fitted, text_in
from ..kit.widgets import button, compact_button, hint
from .entries_table import draw_entries
from .file_choice import FileChoice
from .file_dialogs import FileDialogs

POPUP = "files"
_WIDE, _HIGH = 860.0, 560.0
"""Largest size of the dialog, design units."""
_PLACES = 168.0
"""Width of the list of places, design units."""
_PAGE = 12  # rows that Page Up and Page Down move
_ANSWERS = ("Keep it", "Replace it")
_FLAGS = (
    imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_nav
)  # fmt: skip


class ChoiceWindow:
    """Draws the dialog that is open; keeps what only the drawing needs."""

    def __init__(self) -> None:
        self._of: FileChoice | None = None
        self._shown_text = ""  # what the field held in the frame before
        self._new_folder: str | None = None  # the name that is typed, None where no folder is being made
        self._kinds_open = False  # the list of kinds of file, which takes the keys
        self._focus_folder = False  # whether the field of its name is to get the keyboard
        self._chosen = ChosenButton()  # of the question

    def draw(self, files: FileDialogs, style: Theme, *, covered: bool) -> None:
        """covered: a message is open, which hides the dialog for as long as it is there."""
        choice = files.choice
        if choice is not self._of:
            self._of, self._new_folder = choice, None
        if choice is None or covered:
            return
        if not imgui.is_popup_open(POPUP):
            imgui.open_popup(POPUP)
        size, px = imgui.get_io().display_size, style.px
        imgui.set_next_window_pos(ImVec2(size.x / 2, size.y / 2), 0, ImVec2(0.5, 0.5))
        imgui.set_next_window_size(ImVec2(min(px(_WIDE), size.x - px(32)), min(px(_HIGH), size.y - px(32))))
        imgui.set_next_window_bg_alpha(1.0)
        if not imgui.begin_popup_modal(POPUP, None, _FLAGS)[0]:
            return
        imgui.push_font(style.bold, theme.TITLE)
        imgui.text_unformatted(fitted(choice.request.title, imgui.get_content_region_avail().x))
        imgui.pop_font()
        naming = self._new_folder is not None
        self._folder_row(choice, style)
        metrics = imgui.get_style()
        below = 2 * imgui.get_frame_height() + 2 * metrics.item_spacing.y + style.px(22)
        height = max(imgui.get_content_region_avail().y - below, px(60))
        narrow = imgui.get_content_region_avail().x < px(480)
        if not narrow:
            self._places(choice, files, style, height)
            imgui.same_line(0, px(8))
        draw_entries(choice, style, height)
        self._message(choice, style)
        asked = choice.question is not None
        if not asked:
            self._chosen.forget()
            self._entry(choice, style)
            self._buttons(choice, files, style)
        else:
            self._question(choice, style)
        if not imgui.is_window_appearing():  # the key of this frame closed what covered the dialog
            self._keys(choice, naming, asked)
        if choice.cancelled or choice.result is not None:
            imgui.close_current_popup()
        imgui.end_popup()

    # -- the folder --------------------------------------------------------------------------------------------------

    def _folder_row(self, choice: FileChoice, style: Theme) -> None:
        """Up, the folders that lead here, each to be clicked, and a new folder."""
        px, here = style.px, choice.listing.folder
        if compact_button("Up", style):
            choice.up()
        hint("The folder above (Alt + Up)", style)
        right = ["New folder"] if self._new_folder is None else ["Make", "Cancel"]
        metrics = imgui.get_style()
        reserved = sum(imgui.calc_text_size(text).x + 2 * px(6) + metrics.item_spacing.x for text in right)
        if self._new_folder is not None:
            imgui.same_line()
            imgui.set_next_item_width(imgui.get_content_region_avail().x - reserved)
            if self._focus_folder:
                imgui.set_keyboard_focus_here()
                self._focus_folder = False
            entered, self._new_folder = imgui.input_text_with_hint(
                "##new folder", "name of the new folder", self._new_folder, imgui.InputTextFlags_.enter_returns_true)
            imgui.same_line()
            if compact_button("Make", style) or entered:
                choice.make_folder(self._new_folder)
                self._new_folder = None
                return
            imgui.same_line()
            if compact_button("Cancel##new folder", style):
                self._new_folder = None
            return
        shown = _crumbs(here, imgui.get_content_region_avail().x - imgui.get_item_rect_size().x - reserved - px(24), style)
        for number, (name, folder) in enumerate(shown):
            imgui.same_line(0, px(8) if number == 0 else px(2))
            imgui.push_id(number)
            imgui.push_style_color(imgui.Col_.button, (0, 0, 0, 0))
            imgui.push_style_var(imgui.StyleVar_.frame_border_size, 0.0)
            if compact_button(name, style):
                choice.go(folder)
            imgui.pop_style_var()
            imgui.pop_style_color()
            hint(str(folder), style)
            imgui.pop_id()
        imgui.same_line(imgui.get_window_width() - metrics.window_padding.x - reserved + metrics.item_spacing.x)
        if compact_button("New folder", style):
            self._new_folder, self._focus_folder = "", True

    def _places(self, choice: FileChoice, files: FileDialogs, style: Theme, height: float) -> None:
        px = style.px
        imgui.push_style_color(imgui.Col_.border, theme.LINE)
        imgui.begin_child("places", ImVec2(px(_PLACES), height), imgui.ChildFlags_.borders)
        imgui.pop_style_color()
        imgui.push_font(style.regular, theme.SMALL)
        for title, places in _places_of(choice, files):
            text_in(theme.DIM, title)
            for number, (name, folder) in enumerate(places):
                imgui.push_id(f"{title}{number}")
                width = imgui.get_content_region_avail().x
                if imgui.selectable(fitted(name, width), folder == choice.listing.folder)[0]:
                    choice.go(folder)
                hint(str(folder), style)
                imgui.pop_id()
            imgui.dummy(ImVec2(0, px(2)))
        imgui.pop_font()
        imgui.end_child()

    # -- name, kinds, buttons ----------------------------------------------------------------------------------------

    def _message(self, choice: FileChoice, style: Theme) -> None:
        """One line below the list: what is wrong, or how much is listed."""
        text, colour = choice.problem, theme.BAD
        if not text:
            number, colour = len(choice.rows), theme.DIM
            text = f"{number:,} shown"
            if choice.request.kind == "folder":
                text = f"{number:,} folders, {sum(not entry.folder for entry in choice.listing.entries):,} files here"
            text += ", listing…" if not choice.listing.finished else ""
            if len(choice.chosen) > 1:
                text = f"{len(choice.chosen)} files selected"
            elif choice.waiting:
                text = "Examining…"
        imgui.push_font(style.regular, theme.SMALL)
        text_in(colour, fitted(text, imgui.get_content_region_avail().x))
        hint(choice.problem, style)
        imgui.pop_font()

    def _entry(self, choice: FileChoice, style: Theme) -> None:
        """The field, which takes the keyboard whenever nothing else has it."""
        focused = imgui.is_window_focused(imgui.FocusedFlags_.child_windows | imgui.FocusedFlags_.no_popup_hierarchy)
        if self._new_folder is None and focused and not imgui.is_any_item_active():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1)
        asked = "name or path" if choice.saving else "type to search; a path, ~ and Tab work as in a terminal"
        if choice.request.addresses:
            asked = "type to search; a path, Tab, and an address of a scan (https://…, s3://…) work as in a terminal"
        replaced = choice.text != self._shown_text

        def edited(data: imgui.InputTextCallbackData) -> int:
            completes = data.event_flag == imgui.InputTextFlags_.callback_completion
            if completes:
                choice.complete()
            if completes or replaced:
                data.delete_chars(0, data.buf_text_len)
                data.insert_chars(0, choice.text)
            return 0

        flags = (imgui.InputTextFlags_.callback_always | imgui.InputTextFlags_.callback_completion
                 | imgui.InputTextFlags_.auto_select_all)
        before = choice.text
        changed, text = imgui.input_text_with_hint("##name", asked, choice.text, flags, edited)
        if changed and text != choice.text and choice.text == before:
            choice.type(text)
        self._shown_text = choice.text

    def _buttons(self, choice: FileChoice, files: FileDialogs, style: Theme) -> None:
        px, kinds = style.px, list(choice.request.endings)
        names = {"save": "Save", "open": "Open", "folder": "Open this folder"}
        do = names[choice.request.kind]
        width = max(px(96), imgui.calc_text_size(do).x + px(28))
        if choice.request.kind != "folder":
            room = min(px(220), imgui.get_content_region_avail().x - width - px(96) - px(24))
            imgui.set_next_item_width(room)
            shown = fitted(kinds[choice.kind], room - imgui.get_frame_height() - px(16))
            self._kinds_open = imgui.begin_combo("##kind", shown)
            if self._kinds_open:
                for number, (name, endings) in enumerate(choice.request.endings.items()):
                    if imgui.selectable(_kind_text(name, endings), number == choice.kind)[0]:
                        _choose_kind(choice, number)
                imgui.end_combo()
            imgui.same_line()
        if imgui.get_window_width() > px(620):  # Ctrl + H does it, too
            choice.hidden = imgui.checkbox("Hidden files", choice.hidden)[1]
            hint("Show names that begin with a dot (Ctrl + H)", style)
            imgui.same_line()
        if files.has_system and imgui.get_window_width() > px(760):
            inside = imgui.checkbox("Always here", files.folders.in_window)[1]
            files.prefer_window(inside)
            hint("Choose files in this window, not in the system's dialog", style)
            imgui.same_line()
        imgui.set_cursor_pos_x(imgui.get_window_width() - imgui.get_style().window_padding.x - width - px(96) - px(8))
        if button("Cancel", style, width=px(96)):
            choice.cancel()
        imgui.same_line(0, px(8))
        if button(do, style, width=width, primary=True):
            choice.accept()

    def _question(self, choice: FileChoice, style: Theme) -> None:
        """Whether the file that is there is replaced, in place of the field."""
        px, path = style.px, choice.question
        assert path is not None
        text = f"{path.name} exists already in {path.parent}."
        imgui.align_text_to_frame_padding()
        text_in(theme.WARN, fitted(text, imgui.get_content_region_avail().x))
        hint(text, style)
        imgui.set_cursor_pos_x(imgui.get_window_width() - imgui.get_style().window_padding.x - 2 * px(140) - px(8))
        pressed = self._chosen.follow(path, _ANSWERS, _ANSWERS[0], appearing=imgui.is_window_appearing())
        for label in _ANSWERS:
            if button(label, style, width=px(140), primary=label == self._chosen.label):
                pressed = label
            if label == _ANSWERS[0]:
                imgui.same_line(0, px(8))
        if pressed:
            choice.answer(pressed == _ANSWERS[1])

    def _keys(self, choice: FileChoice, naming: bool, asked: bool) -> None:
        """naming: whether keys belong to the name of a new folder.  asked: whether they belong to the question."""
        key, pressed, io = imgui.Key, imgui.is_key_pressed, imgui.get_io()
        enter = pressed(key.enter, False) or pressed(key.keypad_enter, False)
        if self._kinds_open:
            if pressed(key.escape, False):
                imgui.internal.close_popups_except_modals()
        elif pressed(key.escape, False):
            if naming:
                self._new_folder = None
            else:
                choice.cancel()
        elif not naming and not asked:
            if enter:
                choice.enter()
            elif pressed(key.up_arrow) and io.key_alt:
                choice.up()
            elif pressed(key.h, False) and io.key_ctrl:
                choice.hidden = not choice.hidden
            elif pressed(key.f5, False):
                choice.refresh()
            else:
                for name, rows in (("up_arrow", -1), ("down_arrow", 1), ("page_up", -_PAGE), ("page_down", _PAGE)):
                    if pressed(getattr(key, name)):
                        choice.move(rows)


def _choose_kind(choice: FileChoice, number: int) -> None:
    """Another kind of file; the ending of a name that is to be saved follows."""
    before, choice.kind = choice.endings, number
    name, after = choice.text, choice.endings
    if choice.saving and before and after:
        for ending in before:
            if ending and name.lower().endswith(ending):
                name = name[: -len(ending)]
                break
        choice.text = name + after[0]


def _kind_text(name: str, endings: Sequence[str]) -> str:
    shown = " ".join(f"*{ending}" for ending in endings[:3] if ending)
    return f"{name} ({shown}{' …' if len(endings) > 3 else ''})" if shown else name


def _crumbs(here: Path, width: float, style: Theme) -> list[tuple[str, Path]]:
    """Name and path of the folders that lead to ``here``, as many of the last ones as ``width`` pixels hold."""
    rows: list[tuple[str, Path]] = []
    for folder in (here, *here.parents):
        name = folder.name + "/" if folder.name else str(folder)
        if not rows:
            name = fitted(name, max(width - style.px(40), style.px(60)))
        width -= imgui.calc_text_size(name).x + 2 * style.px(6) + style.px(2)
        if rows and width < 0:
            return rows
        rows.insert(0, (name, folder))
    return rows


def _places_of(choice: FileChoice, files: FileDialogs) -> list[tuple[str, list[tuple[str, Path]]]]:
    """Headings, each with names and paths of folders."""
    places = [("Home", Path.home()), ("Working folder", Path.cwd())]
    scan = files.scan_folder()
    if scan is not None:
        places.append(("The scan's folder", scan.absolute()))
    places.append(("Computer", Path(Path.cwd().anchor)))
    names = [folder.name for folder in files.folders.recent]
    recent = [(f"{folder.parent.name}/{folder.name}" if names.count(folder.name) > 1 else folder.name or str(folder), folder)
              for folder in files.folders.recent]
    folders = [folder for _, folder in places]
    places = [each for number, each in enumerate(places) if each[1] not in folders[:number]]  # a folder stands there once
    return [("Places", places)] + ([("Recent", recent)] if recent else [])
