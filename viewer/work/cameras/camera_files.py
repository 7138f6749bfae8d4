"""Cameras from files: nerfstudio, COLMAP and TUM trajectories, told apart by name and content.

Whatever a file's own axes, what comes back is :class:`viewer.picture.camera.Camera`: OpenGL camera axes, camera to world, the
scan's coordinates.  Distortion is refused, never ignored.  Every error is one line with file, frame and value.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.files.json_file import write_json
from ...common.errors import InputError
from ...common.file_names import unique_names
from ...picture.camera import Camera
from ...picture.json_values import to_json
from ...readers.formats import refuse_address
from .colmap import find_model, read_text_model
from .colmap_binary import read_binary_model
from .nerfstudio import read_json
from .parse import read_text, shown
from .tum import read_tum

if TYPE_CHECKING:
    from ..document import FilmTitle

_COLMAP_FILES = ("images.txt", "cameras.txt", "images.bin", "cameras.bin")
_UNDISTORTED = ("nerfstudio/transforms_undistorted.json", "dslr/nerfstudio/transforms_undistorted.json")  # of ScanNet++
_TRANSFORMS = ("transforms.json", "nerfstudio/transforms.json", "dslr/nerfstudio/transforms.json")


@dataclass(frozen=True)
class CameraFormat:
    """names: in the help.  endings: of its files.  place: what is to be read for a path, None where it is of another format.
    read: reads that; its second argument is (width, height) of the pictures, for files that hold none."""

    names: tuple[str, ...]
    endings: tuple[str, ...]
    place: Callable[[Path], Path | None]
    read: Callable[[Path, tuple[int, int] | None], list[Camera]]


def read_cameras(path: Path, *, size: tuple[int, int] | None = None) -> list[Camera]:
    """All cameras of a file, or of a COLMAP folder, in its order, with names that are safe and unique as file names.

    size: width and height that every camera is resized to; for formats that hold none, the size itself.
    Raises InputError.
    """
    path = Path(path)
    with np.errstate(all="ignore"):  # what overflows is refused in words, not warned about
        cameras = _read(path, size)
    if not cameras:
        raise InputError("holds no cameras", file=path)
    if size is not None:
        try:
            cameras = [camera.resized(*size) for camera in cameras]
        except InputError as error:
            raise InputError(f"at size {size[0]}x{size[1]}: {error}", file=path) from None
    return _named(cameras)


def _read(path: Path, size: tuple[int, int] | None) -> list[Camera]:
    refuse_address(path)
    if not path.is_dir() and not path.is_file():
        raise InputError("no such camera file", file=path)
    for row in CAMERA_FORMATS:
        if (place := row.place(path)) is not None:
            return row.read(place, size)
    raise InputError("no cameras.txt and images.txt, or cameras.bin and images.bin, and no transforms.json in this folder",
                     file=path)  # fmt: skip


def _json_place(path: Path) -> Path | None:
    """The JSON file, that of a folder too; where a folder has COLMAP's files as well, only an undistorted one."""
    if path.is_dir():
        names = _UNDISTORTED if find_model(path) else (*_UNDISTORTED, *_TRANSFORMS)
        return next((path / name for name in names if (path / name).is_file()), None)
    if path.name in _COLMAP_FILES:
        return None
    return path if path.suffix.lower() == ".json" or read_text(path).lstrip()[:1] in ("{", "[") else None


def _colmap_place(path: Path) -> Path | None:
    """The folder of the model."""
    return find_model(path) if path.is_dir() else path.parent if path.name in _COLMAP_FILES else None


def _read_colmap(folder: Path, _: tuple[int, int] | None) -> list[Camera]:
    """A COLMAP model from its text files where they are there, else from its binary ones."""
    for suffix, read in ((".txt", read_text_model), (".bin", read_binary_model)):
        if (folder / f"cameras{suffix}").is_file() and (folder / f"images{suffix}").is_file():
            return read(folder)
    for there, missing in (("cameras", "images"), ("images", "cameras")):
        for suffix in (".txt", ".bin"):
            if (folder / f"{there}{suffix}").is_file():
                raise InputError(f"{folder / missing}{suffix}: no such file; COLMAP cameras need cameras{suffix} and "
                                 f"images{suffix} together")
    raise InputError("no cameras.txt and images.txt, or cameras.bin and images.bin, in this folder", file=folder)


CAMERA_FORMATS = (
    CameraFormat(("transforms.json", "camera_path.json"), (".json",), _json_place, read_json),
    CameraFormat(("a COLMAP folder",), (".txt", ".bin"), _colmap_place, _read_colmap),
    CameraFormat(("a TUM trajectory",), (".txt",), lambda path: path if path.is_file() else None, read_tum),
)
"""In the order in which they are tried."""
_NAMES = [name for row in CAMERA_FORMATS for name in row.names]
KNOWN_CAMERAS = f"{', '.join(_NAMES[:-1])} or {_NAMES[-1]}"
"""For the help."""
CAMERA_ENDINGS = tuple(dict.fromkeys(ending for row in CAMERA_FORMATS for ending in row.endings))
"""For file dialogs."""


def write_camera_path(path: Path, cameras: Iterable[Camera], *, fps: float = 24.0, seconds: float | None = None,
                      stays: Sequence[float] = (), ease: bool = False, title: "FilmTitle | None" = None,
                      captions: "Sequence[FilmTitle | None]" = ()) -> None:
    """Writes nerfstudio's camera_path.json, as ``read_cameras`` reads it back.

    The format knows one size for all, square pixels and a centred principal point; other cameras are refused
    (InputError) rather than changed.  seconds: of the film; None: one frame a camera.  stays, ease: as of Pace; they are
    written where they are not 0 and not false, as ``stay`` of a camera and ``ease``, which only pointglass reads; so are the
    opening title, as ``title``, and a camera's caption, as ``caption``.
    """
    cameras = list(cameras)
    if not cameras:
        raise InputError("no cameras to write", file=path)
    all_stays, all_captions = [*stays, *[0.0] * len(cameras)], [*captions, *[None] * len(cameras)]
    width, height = cameras[0].width, cameras[0].height
    for n, camera in enumerate(cameras):
        where = f"{path}: frame {n} ({shown(camera.name)})"
        if (camera.width, camera.height) != (width, height):
            shape = f"{camera.width}x{camera.height}"
            raise InputError(f"{where}: {shape}, but the first is {width}x{height}; this format holds one size")
        _refuse_orthographic(camera, where)
        lens, plain = (camera.fx, camera.cx, camera.cy), (camera.fy, width / 2, height / 2)
        if not np.allclose(lens, plain, rtol=1e-6, atol=1e-6):
            raise InputError(
                f"{where}: fx {camera.fx:g}, fy {camera.fy:g}, centre ({camera.cx:g}, {camera.cy:g}): "
                "this format holds only square pixels and a centred picture"
            )
    frames = [
        {
            "camera_to_world": camera.camera_to_world.ravel().tolist(), "fov": camera.vertical_fov,
            "aspect": width / height, "name": camera.name, **({"stay": stay} if stay > 0 else {}),
            **({"caption": to_json(caption)} if caption is not None else {}),
        }
        for camera, stay, caption in zip(cameras, all_stays, all_captions)
    ]
    write_json(path, {
        "camera_type": "perspective", "render_width": width, "render_height": height, "fps": fps,
        "seconds": len(frames) / fps if seconds is None else seconds, "camera_path": frames, **({"ease": True} if ease else {}),
        **({"title": to_json(title)} if title is not None else {}),
    })


def write_transforms(path: Path, cameras: Iterable[Camera]) -> None:
    """Writes nerfstudio's transforms.json, from which ``read_cameras`` reads the same cameras, to the bit.

    A camera without a name is read back as frame_00000 and so on.  Raises InputError where there are none, or an orthographic
    one.
    """
    cameras = list(cameras)
    for camera in cameras:
        _refuse_orthographic(camera, str(path))
    frames = [
        {
            **({"file_path": f"images/{camera.name}.png"} if camera.name else {}),
            "w": camera.width, "h": camera.height, "fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy,
            "transform_matrix": camera.camera_to_world.tolist(),
        }
        for camera in cameras
    ]  # fmt: skip
    if not frames:
        raise InputError("no cameras to write", file=path)
    write_json(path, {"camera_model": "PINHOLE", "frames": frames})


def _refuse_orthographic(camera: Camera, where: str) -> None:
    if camera.orthographic is not None:
        which = f"camera {shown(camera.name)}" if camera.name else "a camera"
        raise InputError(f"{where}: {which} is orthographic; this format holds pinholes only")


def _named(cameras: list[Camera]) -> list[Camera]:
    """Cameras whose names are safe and unique as file names."""
    names = unique_names([camera.name for camera in cameras], "camera")
    return [camera if name == camera.name else replace(camera, name=name) for camera, name in zip(cameras, names, strict=True)]
