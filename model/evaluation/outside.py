"""Other people's methods: pictures they left in a folder, judged like ours.

A picture is a PNG named after its view's rgb file (``view003.jpg`` -> ``view003.png``), straight in the folder or, where its
density matters, in a subfolder named after it in percent: ``D100``, ``D10``, ``D3``.  The same for ``path`` frames, if all are
there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from PIL import Image, UnidentifiedImageError
from torch import Tensor

from model.data.dataset import DataError
from model.data.stations import RoomView

NAMED = 10  # at most, in a message


def density_folder(density: float) -> str:
    """``D10`` for 0.1."""
    return f"D{100 * density:g}"


@dataclass(frozen=True)
class Outside:
    """A folder of pictures.  path_frames: whether the frames of the camera move are there too."""

    name: str
    folder: Path
    path_frames: bool = False

    def file(self, shot: RoomView, density: float) -> Path:
        """Where the picture of a view must lie."""
        within = self.folder / density_folder(density)
        return (within if within.is_dir() else self.folder) / f"{Path(shot.rgb_file).stem}.png"

    def picture(self, shot: RoomView, density: float) -> Tensor:
        """(3, H, W) in 0..1."""
        with Image.open(self.file(shot, density)) as image:
            return torch.from_numpy(np.asarray(image.convert("RGB")).copy()).permute(2, 0, 1) / 255


def parse_outside(texts: Sequence[str]) -> dict[str, Path]:
    """``NAME=FOLDER`` arguments.  Raises DataError."""
    result: dict[str, Path] = {}
    for text in texts:
        name, equals, folder = text.partition("=")
        if not (name.strip() and equals and folder):
            raise DataError(f"--outside {text!r}: expected NAME=FOLDER")
        if name.strip() in result:
            raise DataError(f"--outside {text!r}: the name {name.strip()!r} is given twice")
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
    """Checks every picture that will be needed before anything is computed.  Raises DataError naming the first ten bad ones.

    Path frames may be left out, all of them; a few of them are as bad as a missing view.
    """
    stems = [Path(shot.rgb_file).stem for shot in (*views, *frames)]
    if folders and len(set(stems[: len(views)])) < len(views):
        raise DataError("two views of this scene share a file name; pictures of outside methods cannot be told apart")
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
