"""Keys and clicks as events of the X server, as a person's keyboard makes them: xdotool's XTEST, not calls of callbacks."""

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
