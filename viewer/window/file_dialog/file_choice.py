"""The state of one file dialog: what is listed, typed, selected and asked.  No imgui, no window.

The text field always has the keyboard.  Its text is the name of a file, or a path: then the list shows the folder that the
path names so far.  Nothing here waits for a disk: folders are listed, and what is chosen is examined, on threads.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..kit.worker import Worker
from .chosen_path import Examined, examine, is_address_text, names_folder, pasted, path_of, with_ending
from .folder_list import Entry, FolderList, natural, words

Endings = Mapping[str, tuple[str, ...]]
"""Kind of file -> its endings, lower case, with the dot; no endings: every file; ``("",)``: a folder, when saving."""
EVERY: Endings = {"All files": ()}


@dataclass(frozen=True)
class Request:
    """What is asked for.

    purpose: the key of the remembered folder.  kind: ``save``, ``open`` or ``folder``.  name: suggested, of a save.
    many: several files may be chosen.  addresses: one of a scan may be typed instead.  done: called with the absolute paths, in
    the turn after they were chosen; not called where the dialog is cancelled.
    """

    purpose: str
    title: str
    kind: str
    done: Callable[[list[Path]], object]
    endings: Endings = field(default_factory=lambda: EVERY)
    name: str = ""
    many: bool = False
    addresses: bool = False


class FileChoice:
    """One dialog that is open.

    folder: the one listed, unless the text names another.  text: of the field; ``filter``: entries begin with it or hold it.
    cursor: row that arrows and clicks moved to, -1 for none.  chosen: names selected with Ctrl or Shift.
    kind: number of the chosen entry of ``request.endings``.  hidden: whether entries that begin with a dot are listed.
    question: the path that would be replaced, None where nothing is asked.  problem: what is wrong, in words.
    result: what was chosen, None until then.  cancelled: the dialog was closed.
    """

    def __init__(self, request: Request, folders: Sequence[Path], wake: Callable[[], None] = lambda: None):
        """folders: where to begin; the first that is there."""
        self.request, self._wake = request, wake
        self.folder = folders[0]
        self.listing = self._first = FolderList(folders[0], wake, folders[1:])
        self.text, self.filter = request.name, ""
        self.cursor, self.chosen, self._anchor = -1, set[str](), 0
        self.kind, self.hidden = 0, False
        self.order, self.descending = "name", False
        self.question: Path | None = None
        self.problem = ""
        self.result: list[Path] | None = None
        self.cancelled = False
        self.moved = True  # the cursor: the list scrolls to it
        self._examining: Worker | None = None
        self._rows: tuple[tuple, list[Entry]] | None = None

    # -- what is listed ----------------------------------------------------------------------------------------------

    @property
    def saving(self) -> bool:
        return self.request.kind == "save"

    @property
    def endings(self) -> tuple[str, ...]:
        """Of the kind of file chosen in the list of kinds."""
        return tuple(self.request.endings.values())[self.kind]

    @property
    def rows(self) -> list[Entry]:
        """The entries that are shown, in order: folders first."""
        key = (self.listing, self.listing.entries, self.filter, self.kind, self.hidden, self.order, self.descending)
        if self._rows is None or any(a is not b and a != b for a, b in zip(self._rows[0], key)):
            before = self._rows[1] if self._rows is not None and self._rows[0][0] is self.listing else []
            name = before[self.cursor].name if 0 <= self.cursor < len(before) else None
            self._rows = key, self._sorted()
            if name is not None:  # the cursor stays on its entry
                self.cursor = next((at for at, entry in enumerate(self._rows[1]) if entry.name == name), -1)
        return self._rows[1]

    def _sorted(self) -> list[Entry]:
        wanted, endings = self.filter.casefold(), self.endings
        shown = []
        for entry in self.listing.entries:
            if entry.hidden and not self.hidden and not self.filter.startswith("."):
                continue
            if wanted and wanted not in entry.name.casefold():
                continue
            suits = entry.folder or (self.request.kind != "folder" and
                                     (not any(endings) or entry.name.lower().endswith(tuple(filter(None, endings)))))
            if suits:
                shown.append(entry)
        shown.sort(key=lambda entry: natural(entry.name))
        if self.order == "size":
            shown.sort(key=lambda entry: entry.size or 0, reverse=self.descending)
        elif self.order == "date":
            shown.sort(key=lambda entry: entry.modified or 0.0, reverse=self.descending)
        elif self.descending:
            shown.reverse()
        begins = [not entry.name.casefold().startswith(wanted) for entry in shown] if wanted else [False] * len(shown)
        ranked = sorted(zip((not entry.folder for entry in shown), begins, range(len(shown))))
        return [shown[number] for _, _, number in ranked]

    def go(self, folder: Path) -> None:
        """Lists another folder; the name of a file that is saved stays."""
        self.folder = folder
        self._list(folder)
        self.text = (self._leaf(self.text) or self.request.name) if self.saving else ""
        self.filter, self.problem, self.question = "", "", None
        self.cursor, self.chosen, self.moved = -1, set(), True

    def _list(self, folder: Path) -> None:
        if folder != self.listing.folder:
            self.listing.cancel()
            self.listing = FolderList(folder, self._wake)

    def refresh(self) -> None:
        """Lists the folder again."""
        self.listing.cancel()
        self.listing = FolderList(self.listing.folder, self._wake)

    def up(self) -> None:
        """To the folder above."""
        self.go(self.listing.folder.parent)

    @staticmethod
    def _leaf(text: str) -> str:
        return os.path.basename(pasted(text))

    # -- text, keys, clicks ------------------------------------------------------------------------------------------

    def type(self, text: str) -> None:
        """The text was changed by typing or pasting."""
        self.text, self.problem, self.question = text, "", None
        self.cursor, self.chosen = -1, set()
        plain = pasted(text)
        head, leaf = ("", "") if is_address_text(plain) else os.path.split(plain)
        if head or plain == "~":
            self._list(path_of(head or plain, self.folder))
            self.filter = "" if plain == "~" else leaf
        else:
            self._list(self.folder)
            self.filter = "" if self.saving else leaf

    def complete(self) -> None:
        """Tab: adds to the text what all names that begin with it have in common."""
        head, leaf = os.path.split(pasted(self.text))
        if is_address_text(pasted(self.text)):
            return
        found = [entry for entry in self.listing.entries if entry.name.casefold().startswith(leaf.casefold())
                 and (self.hidden or leaf.startswith(".") or not entry.hidden)]
        if not found or (not leaf and len(found) > 1 and not head):
            return
        first, last = min(entry.name for entry in found), max(entry.name for entry in found)
        common = first[: next((at for at, (a, b) in enumerate(zip(first, last)) if a != b), min(len(first), len(last)))]
        if len(common) < len(leaf):  # they differ in capital letters
            return
        ending = os.sep if len(found) == 1 and found[0].folder else ""
        text = os.path.join(head, common) + ending
        if text != self.text:
            self.type(text)

    def move(self, rows: int) -> None:
        """Arrow keys: the cursor moves, and the field takes the name of a file."""
        if self.rows:
            self.select(min(max(self.cursor + rows, 0), len(self.rows) - 1))
            self.moved = True

    def select(self, row: int, *, toggle: bool = False, span: bool = False) -> None:
        """A row was clicked or moved to.  toggle: with Ctrl; span: with Shift, from the row selected before."""
        entry = self.rows[row]
        self.problem, self.question = "", None
        if self.request.many and (toggle or span) and not entry.folder:
            names = {other.name for other in self.rows[min(row, self._anchor) : max(row, self._anchor) + 1] if not other.folder}
            if not self.chosen and self.cursor >= 0 and not self.rows[self.cursor].folder:
                self.chosen = {self.rows[self.cursor].name}
            self.chosen = names if span else self.chosen ^ {entry.name}
            self.cursor = row
            self.text = "" if len(self.chosen) != 1 else self._within(next(iter(self.chosen)))
            return
        self.cursor, self._anchor, self.chosen = row, row, set()
        if not entry.folder:
            self.text = self._within(entry.name)
        elif not self.saving:
            self.text = ""

    def _within(self, name: str) -> str:
        """A name of the list as the field has it: relative to the folder where the text did not name another."""
        return name if self.listing.folder == self.folder else str(self.listing.folder / name)

    def open_row(self, row: int) -> None:
        """A double click: goes into a folder, chooses a file."""
        self.select(row)
        entry = self.rows[row]
        if entry.folder:
            self.go(self.listing.folder / entry.name)
        else:
            self.accept()

    def enter(self) -> None:
        """Enter: goes into the folder that arrows selected, else chooses what the text names."""
        if self.question is not None:
            return
        if 0 <= self.cursor < len(self.rows) and self.rows[self.cursor].folder:
            self.go(self.listing.folder / self.rows[self.cursor].name)
        else:
            self.accept()

    def accept(self) -> None:
        """The button: chooses what is selected or typed."""
        if self._examining is not None:
            return
        here = self.listing.folder
        if self.request.kind == "folder":
            selected = 0 <= self.cursor < len(self.rows)
            paths = [here / self.rows[self.cursor].name if selected else path_of(self.text, self.folder) if self.text else here]
        elif len(self.chosen) > 1:
            paths = [here / name for name in sorted(self.chosen, key=natural)]
        elif names_folder(pasted(self.text)):
            self.go(path_of(self.text, self.folder))
            return
        elif not pasted(self.text):
            if 0 <= self.cursor < len(self.rows):
                self.go(here / self.rows[self.cursor].name)
            else:
                self.problem = "Type a name first." if self.saving else "Select a file first."
            return
        else:
            named = self.saving or not self.filter or any(entry.name == self.filter for entry in self.listing.entries)
            if not named and len(self.rows) == 1:  # the only one that the search has left
                self.text = self._within(self.rows[0].name)
            paths = [path_of(self.text, self.folder)]
        ends_as_folder = pasted(self.text).endswith((os.sep, "/"))
        if self.saving and not ends_as_folder:
            paths = [self.named(paths[0])]
        asked = self.saving, self.request.addresses
        self._examining = Worker(lambda: [examine(path, *asked) for path in paths], "Examining", self._wake)

    def named(self, path: Path) -> Path:
        """The path of a file to be saved, with the ending of the chosen kind where the name has none (chosen_path)."""
        return with_ending(path, self.endings, [ending for row in self.request.endings.values() for ending in row if ending])

    def follow(self) -> None:
        """Called in every turn of the loop: takes what the threads found."""
        if self.listing is self._first:
            self.folder = self.listing.folder
        if self._examining is None or not self._examining.finished:
            return
        work, self._examining = self._examining, None
        self._take(work.result or [Examined(self.folder, problem=str(work.error or "it cannot be examined"))])

    @property
    def waiting(self) -> bool:
        """Whether the chosen file is being examined."""
        return self._examining is not None

    def _take(self, found: list[Examined]) -> None:
        folders = [one for one in found if one.folder]
        if found[0].address:
            self.result = [found[0].path]
            return
        if self.request.kind == "folder":
            bad = next((one.problem or f"{one.path}: it is a file, not a folder" for one in found if not one.folder), "")
            if bad:
                self.problem = bad
            else:
                self.result = [one.path for one in found]
            return
        saves_folder = self.saving and "" in self.endings
        if len(found) == 1 and folders and not saves_folder:
            self.text = ""  # it was the folder's name
            self.go(found[0].path)
            return
        bad = next((one for one in found if one.problem or (one.folder and not saves_folder)), None)
        if bad is not None:
            self.problem = bad.problem or f"{bad.path}: it is a folder"
        elif saves_folder and found[0].exists and not found[0].folder:
            self.problem = f"{found[0].path}: a file has this name; choose another"
        elif self.saving and found[0].exists and not saves_folder:
            self.question = found[0].path
        else:
            self.result = [one.path for one in found]

    def answer(self, replace: bool) -> None:
        """The answer to the question whether a file is replaced."""
        path, self.question = self.question, None
        if replace and path is not None:
            self.result = [path]

    def make_folder(self, name: str) -> None:
        """Makes a folder in the one listed, and goes there."""
        name = name.strip()
        if not name:
            return
        made = self.listing.folder / name
        try:
            made.mkdir()
        except (OSError, ValueError) as error:
            why = "there is one of this name already" if isinstance(error, FileExistsError) else (
                "you do not have permission to write here" if isinstance(error, PermissionError)
                else words(error) if isinstance(error, OSError) else str(error))
            self.problem = f"{made}: {why}"
            return
        self.go(made)

    def cancel(self) -> None:
        """Esc: takes the question back, or closes the dialog."""
        if self.question is not None:
            self.question = None
        else:
            self.cancelled = True
