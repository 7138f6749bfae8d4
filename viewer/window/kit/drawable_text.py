"""Text enters imgui at one place, so that no name can end the window.

Imgui takes UTF-8, and its binding raises TypeError for a text that has none: half a character (an unpaired surrogate), which
names of files that are not UTF-8 have in Python (PEP 383).  Every function of imgui that takes a text escapes it then, as
viewer.common.text.printable does, in place of a hundred places that would have to remember it.  The letters that were drawn are
noted there, too, so that a font can be found that has them (viewer.window.kit.font_fallback).
"""

import functools
from typing import Any

from ...common.text import printable

_MARK = "takes_any_text"
LETTERS: set[str] = set()
"""Characters beyond ASCII that were given to imgui since the process began."""


def accept_any_text(imgui: Any) -> None:
    """Lets the functions of a module of imgui that take a text take any.  Once for all windows; again does nothing."""
    if getattr(imgui, _MARK, False):
        return
    for owner in (imgui, imgui.ImDrawList):
        for name, found in list(vars(owner).items()):
            if type(found).__name__ in ("nb_func", "nb_method") and ": str" in (found.__doc__ or ""):
                setattr(owner, name, _any_text(found))
    setattr(imgui, _MARK, True)


def _any_text(call: Any) -> Any:
    @functools.wraps(call)
    def drawn(*values: Any, **named: Any) -> Any:
        for value in (*values, *named.values()):
            if type(value) is str and not value.isascii():
                LETTERS.update(value)
            elif type(value) is list and value and type(value[0]) is str:  # of a list of choices
                LETTERS.update(*value)
        try:
            return call(*values, **named)
        except TypeError:  # raised before anything is drawn
            return call(*map(drawable, values), **{name: drawable(value) for name, value in named.items()})

    return drawn


def drawable(value: Any) -> Any:
    """A text, or a list of texts, without halves of characters; anything else as it is."""
    if isinstance(value, list):
        return [drawable(item) for item in value]
    if isinstance(value, str) and any("\ud800" <= letter <= "\udfff" for letter in value):
        return printable(value, lines=True)
    return value
