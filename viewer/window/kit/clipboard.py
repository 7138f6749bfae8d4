"""Text that is copied and pasted: kept in memory, or in the system's clipboard, through GLFW."""

import ctypes
from collections.abc import Callable
from select import select
from time import monotonic
from typing import Any

_ANSWER_S = 1.0
"""Seconds that the program which holds the clipboard has to answer, while this window waits.  One second does not interrupt a
person's thought (Nielsen, Usability Engineering, 1993); a window that stands for longer seems to hang."""
_SELECTION_NOTIFY = 31  # of X.h
_EVENT_BYTES = 192  # sizeof(XEvent) of Xlib.h, with 8-byte long
_CLIENT = ~0x1FFFFF
"""Bits of an X resource's number that tell the connection which made it, as X.org's servers number them."""


class Clipboard:
    """Kept in memory."""

    def __init__(self) -> None:
        self._text = ""

    def read(self) -> str:
        return self._text

    def write(self, text: str) -> None:
        self._text = text


class SystemClipboard(Clipboard):
    """glfw: the module.  window: its handle.  tell: shows a line to the person."""

    def __init__(self, glfw: Any, window: Any, tell: Callable[[str], object] = lambda line: None):
        super().__init__()
        self._glfw, self._window, self._tell = glfw, window, tell
        self._holder: ClipboardHolder | None = None

    def read(self) -> str:
        """The text; "" where the clipboard holds something else, or the program that holds it does not answer."""
        if not self._answers():
            self._tell("The program that holds the clipboard does not answer: nothing is pasted")
            return ""
        found = self._glfw.get_clipboard_string(self._window)
        return found.decode("utf-8", "replace") if found else ""

    def write(self, text: str) -> None:
        self._glfw.set_clipboard_string(self._window, text)

    def close(self) -> None:
        """The window closes."""
        if self._holder is not None:
            self._holder.close()

    def _answers(self) -> bool:
        glfw = self._glfw
        if not hasattr(glfw, "get_platform") or glfw.get_platform() != getattr(glfw, "PLATFORM_X11", None):
            return True
        try:
            self._holder = self._holder or ClipboardHolder()
            return self._holder.answers(glfw.get_x11_window(self._window))
        except OSError:
            return True


class ClipboardHolder:
    """Asks the program that holds X11's clipboard whether it answers, over a connection of its own: GLFW waits for that without
    a limit, so that a program which hangs would stop this window for ever.  Raises OSError where there is no X11."""

    def __init__(self) -> None:
        self._x = x = ctypes.CDLL("libX11.so.6")
        for name in ("XOpenDisplay", "XDefaultRootWindow", "XCreateSimpleWindow", "XInternAtom", "XGetSelectionOwner"):
            getattr(x, name).restype = ctypes.c_void_p if name == "XOpenDisplay" else ctypes.c_ulong
        opened = x.XOpenDisplay(None)
        if not opened:
            raise OSError("no X server")
        self._display = display = ctypes.c_void_p(opened)
        root, numbers = ctypes.c_ulong(x.XDefaultRootWindow(display)), [ctypes.c_ulong(0)] * 2
        self._mine = ctypes.c_ulong(x.XCreateSimpleWindow(display, root, 0, 0, 1, 1, 0, *numbers))
        self._clipboard, self._targets, self._property = (
            ctypes.c_ulong(x.XInternAtom(display, name, 0)) for name in (b"CLIPBOARD", b"TARGETS", b"POINTGLASS_TARGETS"))

    def answers(self, window: int, seconds: float = _ANSWER_S) -> bool:
        """Whether pasting will not wait: another program answers within ``seconds``, or nobody or this window holds the
        clipboard.  window: its number in X."""
        x, display = self._x, self._display
        holder = x.XGetSelectionOwner(display, self._clipboard)
        if not holder or holder & _CLIENT == window & _CLIENT:
            return True
        while self._answered():  # late answers to earlier questions
            pass
        x.XConvertSelection(display, self._clipboard, self._targets, self._property, self._mine, ctypes.c_ulong(0))
        x.XFlush(display)
        end = monotonic() + seconds
        while not self._answered():
            if (left := end - monotonic()) <= 0:
                return False
            select([x.XConnectionNumber(display)], [], [], left)
        return True

    def close(self) -> None:
        """Ends the connection."""
        self._x.XCloseDisplay(self._display)

    def _answered(self) -> bool:
        event = ctypes.create_string_buffer(_EVENT_BYTES)
        return bool(self._x.XCheckTypedWindowEvent(self._display, self._mine, _SELECTION_NOTIFY, event))
