"""Opens a file that was saved, or its folder, with the program that the desktop has for it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path


def open_path(path: Path) -> bool:
    """Opens a file or folder.  Returns whether the desktop was asked to; False where it has no way to be asked."""
    if sys.platform == "win32":
        os.startfile(path)  # type: ignore[attr-defined]  # there is no other platform that has it
        return True
    opener = shutil.which("open" if sys.platform == "darwin" else "xdg-open")
    if opener is None:
        return False
    quiet = subprocess.DEVNULL
    subprocess.Popen([opener, str(path)], stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)
    return True
