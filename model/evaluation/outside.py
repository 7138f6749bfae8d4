"""Methods of others: pictures in a folder, evaluated like those of our methods.

A picture is a PNG named after the rgb file of its view (``view003.jpg`` -> ``view003.png``).  It is in the folder itself, or in
a subfolder named after the density in percent: ``D100``, ``D10``, ``D3``.  The frames of the path are used if all are present.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from PIL import Image, UnidentifiedImageError
from torch import Tensor

from ..common.errors import DataError
from ..data.stations import RoomView

NAMED = 10
"""Largest number of files named in a message, as in model.data.stations.load_scene: they fit a terminal of 24 rows."""


def density_folder(density: float) -> str:
    """``D10`` for 0.1."""
    return f"D{100 * density:g}"


@dataclass(frozen=True)
class Outside:
    """A folder of pictures.  path_frames: whether it contains the frames of the camera path too."""

    name: str
    folder: Path
    path_frames: bool = False

    def file(self, shot: RoomView, density: float) -> Path:
        """Path of the picture of a view."""
        within = self.folder / density_folder(density)
        return (within if within.is_dir() else self.folder) / f"{Path(shot.rgb_file).stem}.png"

    def picture(self, shot: RoomView, density: float) -> Tensor:
        """The picture (3, H, W) of a view, in 0..1."""
        with Image.open(self.file(shot, density)) as image:
            return torch.from_numpy(np.asarray(image.convert("RGB")).copy()).permute(2, 0, 1) / 255


def parse_outside(texts: Sequence[str]) -> dict[str, Path]:
    """Name -> folder of arguments ``NAME=FOLDER``.  Raises DataError."""
    result: dict[str, Path] = {}
    for text in texts:
        name, equals, folder = text.partition("=")
        if not (name.strip() and equals and folder):
            raise DataError("expected NAME=FOLDER", option="--outside", value=text)
        if name.strip() in result:
            raise DataError(f"the name {name.strip()!r} is given twice", option="--outside", value=text)
        result[name.strip()] = Path(folder)
    return result


def _problem(path: Path, shot: RoomView) -> str | None:
    if not path.is_file():
        return f"{path} is missing"
    try:
        with Image.open(path) as image:
            if image.size != (shot.width, shot.height):
                return f"{path} is {image.width}x{image.height}, not {shot.width}x{shot.height}"
            image.load()
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return f"{path} cannot be read as a picture"
    return None


def open_outside(folders: dict[str, Path], views: Sequence[RoomView], frames: Sequence[RoomView],
                 densities: Sequence[float]) -> list[Outside]:
    """Checks all pictures before the evaluation.  Raises DataError naming the first NAMED missing or unreadable ones.

    Either all frames of the path are present or none.
    """
    stems = [Path(shot.rgb_file).stem for shot in (*views, *frames)]
    if folders and len(set(stems[: len(views)])) < len(views):
        raise DataError("two views of this scene share a file name; pictures of outside methods cannot be distinguished")
    found, problems = [], []
    for name, folder in folders.items():
        if not folder.is_dir():
            raise DataError(f"--outside {name}={folder}: no such folder")
        plain = Outside(name, folder)
        needed = [(plain.file(shot, d), shot) for d in densities for shot in views]
        along = [(plain.file(shot, d), shot) for d in densities for shot in frames]
        has_frames = len(set(stems)) == len(stems) and any(path.is_file() for path, _ in along)
        checked = dict(needed + (along if has_frames else []))
        problems += [problem for path, shot in checked.items() if (problem := _problem(path, shot)) is not None]
        found.append(Outside(name, folder, has_frames))
    if problems:
        more = f" and {len(problems) - NAMED} more" if len(problems) > NAMED else ""
        raise DataError(f"{len(problems)} pictures of outside methods cannot be used: {'; '.join(problems[:NAMED])}{more}")
    return found
