"""Letters that the typeface of the interface lacks, from fonts of this machine: Chinese, Japanese, Korean, Hebrew, Thai, ...

A font is looked for when one of its letters is first drawn, on a thread, because the search reads the fonts of the machine.
Then it is added behind the typeface; imgui makes its glyphs as they are needed.  Letters stand one after the other from left
to right, as imgui sets them: it does not join or reorder the letters of scripts that need it.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from .drawable_text import LETTERS

if TYPE_CHECKING:
    from imgui_bundle import imgui


class FontFallback:
    """The fonts that were added to ``typefaces``, which belong to the present imgui context.  size: of all, design units.

    wake: called on the thread of the search when a font was found.
    """

    def __init__(self, typefaces: "Sequence[imgui.ImFont]", size: float, wake: Callable[[], None]):
        self._typefaces, self._size, self._wake = typefaces, size, wake
        self._known: set[str] = set()
        self._found: list[Path] = []
        self._added: set[Path] = set()
        self._searching = False

    def follow(self) -> None:
        """Called between two frames: adds the fonts that were found, and looks for those of letters drawn since."""
        if self._searching:
            return
        found, self._found = self._found, []
        for path in dict.fromkeys(found):
            if path not in self._added:
                self._add(path)
        fresh = LETTERS - self._known
        self._known |= fresh
        lacked = [letter for letter in sorted(fresh) if not self._typefaces[0].is_glyph_in_font(ord(letter))]
        if lacked:
            self._searching = True
            Thread(target=self._look_for, args=(lacked,), name="pointglass fonts", daemon=True).start()

    def _look_for(self, letters: Sequence[str]) -> None:
        from ...common.fonts import font_with, needs_shape

        found = (font_with(letter) for letter in letters if needs_shape(letter) and not "\ud800" <= letter <= "\udfff")
        try:
            self._found = [path for path in found if path is not None]
        finally:
            self._searching = False
            self._wake()

    def _add(self, path: Path) -> None:
        from imgui_bundle import imgui

        self._added.add(path)
        for typeface in self._typefaces:
            merged = imgui.ImFontConfig()
            merged.merge_mode, merged.dst_font = True, typeface
            imgui.get_io().fonts.add_font_from_file_ttf(str(path), self._size, merged)
