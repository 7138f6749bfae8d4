"""Keys and clicks as events of the X server, as a person's keyboard makes them: xdotool's XTEST, not calls of callbacks."""

import ctypes
import shutil
import subprocess

import pytest


def needs_xdotool() -> None:
    """Skips the test where xdotool is not installed."""
    if not shutil.which("xdotool"):
        pytest.skip("xdotool is not installed (apt install xdotool)")


def xdo(*words: object) -> str:
    """Runs xdotool; returns what it printed."""
    done = subprocess.run(["xdotool", *map(str, words)], capture_output=True, text=True, timeout=30, check=True)
    return done.stdout.strip()


def focus(title: str = "pointglass") -> str:
    """Gives the keyboard to the window whose title holds ``title``.  Returns its number."""
    window = xdo("search", "--sync", "--name", title).splitlines()[-1]
    xdo("windowfocus", "--sync", window)
    return window


def keys_of(control_key: str) -> str:
    """xdotool's name of a key of the table of controls: "CTRL_SHIFT_S" is ctrl+shift+s."""
    *held, letter = control_key.split("_")
    return "+".join([*(name.lower() for name in held), letter.lower()])


class _ClientMessage(ctypes.Structure):
    """XClientMessageEvent of Xlib.h."""

    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int), ("display", ctypes.c_void_p),
                ("window", ctypes.c_ulong), ("message_type", ctypes.c_ulong), ("format", ctypes.c_int),
                ("data", ctypes.c_long * 5), ("padding", ctypes.c_long * 24)]


def request_close(display: str, window: int) -> None:
    """Sends WM_DELETE_WINDOW, as the window manager does where its close button is pressed."""
    x = ctypes.CDLL("libX11.so.6")
    x.XOpenDisplay.restype = ctypes.c_void_p
    x.XInternAtom.restype = ctypes.c_ulong
    handle = ctypes.c_void_p(x.XOpenDisplay(display.encode()))
    protocols, delete = (x.XInternAtom(handle, name, 0) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW"))
    event = _ClientMessage(33, 0, 1, None, window, protocols, 32, (ctypes.c_long * 5)(delete))
    x.XSendEvent(handle, ctypes.c_ulong(window), 0, ctypes.c_long(0), ctypes.byref(event))
    x.XCloseDisplay(handle)


def type_letters(display: str, letters: str) -> None:
    """Presses keys that print these letters, each once: spare keys of the X server get them and keep them, so that no program
    that is slow to ask finds another letter there."""
    x, xtest = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
    x.XOpenDisplay.restype, x.XGetKeyboardMapping.restype = ctypes.c_void_p, ctypes.POINTER(ctypes.c_ulong)
    handle = ctypes.c_void_p(x.XOpenDisplay(display.encode()))
    least, most, columns = ctypes.c_int(), ctypes.c_int(), ctypes.c_int()
    x.XDisplayKeycodes(handle, ctypes.byref(least), ctypes.byref(most))
    first, count = least.value, most.value - least.value + 1
    found = x.XGetKeyboardMapping(handle, ctypes.c_ubyte(first), count, ctypes.byref(columns))
    spare = [first + n for n in range(count) if not any(found[n * columns.value : (n + 1) * columns.value])]
    keys = dict(zip(dict.fromkeys(letters), reversed(spare), strict=False))
    for letter, key in keys.items():
        symbols = (ctypes.c_ulong * 2)(*[0x01000000 + ord(letter)] * 2)  # of any character, X.org's keysymdef.h
        x.XChangeKeyboardMapping(handle, key, 2, symbols, 1)
    x.XSync(handle, 0)
    for letter in letters:
        for down in (1, 0):
            xtest.XTestFakeKeyEvent(handle, keys[letter], down, ctypes.c_ulong(0))
    x.XSync(handle, 0)
    x.XFree(found)
    x.XCloseDisplay(handle)
