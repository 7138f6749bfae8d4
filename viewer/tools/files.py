"""Files written beside and renamed, so that nobody ever finds half of one."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Calls ``write`` with a temporary name in the same folder and renames the result to ``path``.

    On any failure, Ctrl-C included, the temporary file is removed and an older ``path`` stays as it was.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        write(beside)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def write_png(path: Path, image: np.ndarray) -> None:
    """Writes (H, W, 3 or 4) uint8, row 0 at the top."""
    from PIL import Image

    write_whole(path, lambda p: Image.fromarray(image).save(p, format="PNG", compress_level=3))


def write_array(path: Path, array: np.ndarray) -> None:
    """Writes a NumPy array as .npy."""

    def save(beside: Path) -> None:
        with beside.open("wb") as file:
            np.save(file, array, allow_pickle=False)

    write_whole(path, save)


def write_json(path: Path, data: object) -> None:
    """Writes indented JSON."""
    write_whole(path, lambda p: p.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8"))
