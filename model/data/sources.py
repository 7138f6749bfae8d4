"""Opens data folders of any supported format as places for training or evaluation.

The format is recognised by the contents: ``scene.json`` (stations and views), ``splits/`` and ``data/`` (ScanNet++), frames
with depth and poses (RGB-D), or subfolders with ``scene.json``.
"""

from collections.abc import Sequence
from pathlib import Path

from ..common.errors import DataError
from .dataset import TruePlace


def open_places(folders: Sequence[Path]) -> list[TruePlace]:
    """The places in the given folders.  Raises DataError naming the first folder without a place, or what is wrong in it."""
    return [place for folder in folders for place in _open(Path(folder))]


def rooms_below(folder: Path) -> list[Path]:
    """The folders directly in ``folder`` that hold a room, that is a ``scene.json``, by name."""
    return sorted(path.parent for path in folder.glob("*/scene.json"))


def room_folders(folders: Sequence[Path]) -> list[Path]:
    """The rooms that folders are or contain, in the order given, those in one folder by name.  Raises DataError naming the
    first folder with none."""
    found = []
    for folder in folders:
        rooms = [folder] if (folder / "scene.json").exists() else rooms_below(folder)
        if not rooms:
            wrong = "no scene.json in this folder or in those in it" if folder.is_dir() else "no such folder"
            raise DataError(wrong, file=folder, remedy="give a room, a folder of rooms, or a scan")
        found += rooms
    return found


def _open(folder: Path) -> list[TruePlace]:
    if not folder.is_dir():
        raise DataError("no such folder", file=folder, remedy="give a folder with scene.json, of ScanNet++ or of RGB-D frames")
    if (folder / "scene.json").is_file():
        from .stations import load_scene

        return [load_scene(folder)]
    if (folder / "splits").is_dir() and (folder / "data").is_dir():
        from .images.scannetpp import load_scannetpp, scenes

        return [load_scannetpp(folder, scene) for scene in scenes(folder, "nvs_sem_train")]
    if any((folder / name).exists() for name in ("transforms.json", "groundtruth.txt", "pose")):
        from .images.rgbd import load_rgbd

        return [load_rgbd(folder)]
    if below := rooms_below(folder):
        from .stations import load_scene

        return [load_scene(path) for path in below]
    raise DataError("neither scene.json, nor ScanNet++, nor RGB-D frames with poses in this folder", file=folder)
