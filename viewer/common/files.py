"""Pictures and arrays, and several files at once, written beside and renamed (model.common.files.atomic_write)."""

import contextlib
import io
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ...model.common.files.atomic_write import write_atomic
from ...model.common.files.folders import made_folder
from ...model.common.files.temporary import temporary_folder
from ...model.common.process.signals import uninterrupted
from .errors import InputError, Option
from .file_names import inside


@contextlib.contextmanager
def out_folder(out: Path) -> Iterator[None]:
    """Makes the folder of ``--out``; where the block fails, what it made and left empty goes again.  Raises InputError."""
    with made_folder(out, make=False):
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            why = "a file has this name" if out.is_file() else error.strerror
            raise InputError(f"cannot make this folder ({why})", file=out,
                             remedy=("choose another ", Option("--out"))) from None
        yield


def write_together(folder: Path, files: dict[str, Callable[[Path], object]]) -> None:
    """Writes several files, name -> what writes it at a path, so that all appear in ``folder`` or none.

    They are written in a folder of their own beside, which goes again on any failure.  Raises InputError
    naming the file, or the folder where nothing can be written there at all.
    """
    with contextlib.ExitStack() as stack:
        try:
            beside = stack.enter_context(temporary_folder(folder / next(iter(files))))
        except OSError as error:
            raise InputError(f"cannot be written to ({error.strerror or error})", file=folder,
                             remedy=("make room or writing allowed there, or choose another ", Option("--out"))) from None
        for name, write in files.items():
            _named(folder / name, lambda write=write, name=name: write(inside(beside, name)))
        for name in files:
            if (folder / name).is_dir():
                raise InputError("is a folder", file=folder / name, remedy=("remove it, or choose another ", Option("--out")))
        with uninterrupted():
            for name in files:
                _named(folder / name, lambda name=name: (beside / name).replace(folder / name))


def _named(path: Path, work: Callable[[], object]) -> None:
    """Does ``work``; where it fails, says that it was ``path`` which could not be written."""
    try:
        work()
    except OSError as error:  # NumPy's on a full disk has neither a number nor a name
        why = error.strerror or f"no space left? {error}"
        raise InputError(f"cannot be written ({why})", file=path,
                         remedy=(f"free space in {path.parent}, or choose another ", Option("--out"))) from None


def write_png(path: Path, image: np.ndarray, text: dict[str, str] | None = None) -> None:
    """Writes (H, W, 3 or 4) uint8, or (H, W) as grey levels, row 0 at the top.  text: keyword -> text, kept inside the PNG."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    kept = PngInfo()
    for key, value in (text or {}).items():
        kept.add_itxt(key, value)
    write_atomic(path, lambda p: Image.fromarray(image).save(p, format="PNG", compress_level=3, pnginfo=kept))


def png_bytes(image: np.ndarray) -> bytes:
    """(H, W, 3) uint8 as the bytes of a PNG file."""
    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(image).save(data, format="PNG", compress_level=3)
    return data.getvalue()


def write_array(path: Path, array: np.ndarray) -> None:
    """Writes a NumPy array as .npy."""

    def save(beside: Path) -> None:
        with beside.open("wb") as file:
            np.save(file, array, allow_pickle=False)

    write_atomic(path, save)
