"""Writes a film's pictures: an MP4 (H.264, by PyAV's FFmpeg) or a folder of PNG files that can be continued.

An MP4 appears whole or not at all.  A folder takes one PNG a frame, each written beside and renamed, and ``film.json``, which
says what the pictures were made of: with ``resume`` the frames that are there are kept, if they were made of the same.
"""

import contextlib
import json
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from ....model.common.files.atomic_write import write_atomic
from ....model.common.files.json_file import write_json
from ...common.errors import InputError, Option
from ...common.file_names import inside
from ...common.files import out_folder, write_png
from ...common.progress import progress
from ...picture.camera import Camera
from ...work.pictures.finished_pictures import whole_png

RECORD = "film.json"
QUALITY = 18
"""x264's constant rate factor: visually lossless for most; 0 is lossless, each 6 halve the bytes."""
PRESET = "medium"
REPEATABLE = "threads=1:lookahead-threads=1:sync-lookahead=0:mbtree=0"
"""x264 parameters under which the same pictures give the same bytes.  With macroblock trees (the default) 5 to 30 % of the
encodings of twelve small frames differed, on a CPU with AVX-512; without, none of 600."""

Draw = Callable[[Camera], np.ndarray]
"""A camera -> (H, W, 3) uint8."""


def write_mp4(path: Path, cameras: Sequence[Camera], draw: Draw, *, size: tuple[int, int], fps: Fraction) -> None:
    """Encodes one picture a camera.  Raises as :func:`encode_mp4`."""
    with progress(len(cameras), "filming", "frame") as meter:
        encode_mp4(path, _counted(map(draw, cameras), meter.update), size=size, fps=fps)


def encode_mp4(path: Path, pictures: Iterable[np.ndarray], *, size: tuple[int, int], fps: Fraction) -> None:
    """Encodes pictures (H, W, 3) uint8, in their order.  Raises InputError where sides are odd (H.264 halves the colour's
    resolution) or the file cannot be written."""
    check_mp4(path, size)
    try:
        write_atomic(path, lambda beside: _encode(beside, pictures, size, fps))
    except OSError as error:
        why = error.strerror or str(error)
        raise InputError(f"cannot be written ({why})", file=path, remedy="make room, or choose another place for it") from None


def check_mp4(path: Path, size: tuple[int, int]) -> None:
    """Raises InputError as :func:`encode_mp4`, before there is a picture."""
    if size[0] % 2 or size[1] % 2:
        raise InputError(f"an MP4 needs even sides, not {size[0]}x{size[1]}", file=path,
                         remedy=("choose another ", Option("--size"), ", or give a folder for PNGs"))
    if not path.parent.is_dir():
        raise InputError("its folder does not exist", file=path, remedy=f"make {path.parent} first")


def _counted(pictures: Iterable[np.ndarray], update: Callable[[int], None]) -> Iterable[np.ndarray]:
    for picture in pictures:
        yield picture
        update(1)


def _encode(path: Path, pictures: Iterable[np.ndarray], size: tuple[int, int], fps: Fraction) -> None:
    import av

    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        options = {"crf": str(QUALITY), "preset": PRESET, "x264-params": REPEATABLE}
        stream = container.add_stream("libx264", rate=fps, options=options)
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"  # what every player shows
        stream.codec_context.thread_count = 1  # the same bytes on every machine
        stream.codec_context.color_range = 1  # limited
        stream.codec_context.colorspace = 1  # BT.709, as players assume of HD
        stream.codec_context.color_primaries = 1
        stream.codec_context.color_trc = 1
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def frame_files(cameras: Sequence[Camera]) -> list[str]:
    """The names of what :func:`write_folder` writes."""
    return [*(f"{camera.name}.png" for camera in cameras), RECORD]


def write_folder(out: Path, cameras: Sequence[Camera], draw: Draw, *, made_of: dict, resume: bool,
                 describe: Callable[[Camera], dict[str, str]] | None = None) -> int:
    """Writes ``out/NAME.png`` for each camera; returns how many were made now.

    made_of: JSON-able, what determines the pictures.  resume: keep the frames that are there and can be read to their end.
    describe: gives the text inside a camera's PNG.
    Raises InputError where they were made of something else, or where there are some and ``resume`` is not asked for.
    """
    left = frames_left(out, cameras, made_of=made_of, resume=resume)
    with out_folder(out), progress(len(cameras), "filming", "frame") as meter:
        meter.update(len(cameras) - len(left))
        begin_folder(out, made_of)
        for camera in left:
            write_frame(out, camera, draw(camera), describe(camera) if describe is not None else None)
            meter.update(1)
    return len(left)


def frames_left(out: Path, cameras: Sequence[Camera], *, made_of: dict, resume: bool) -> list[Camera]:
    """The cameras whose frames are not there yet.  Arguments and errors as of :func:`write_folder`."""
    there = {path.name for path in out.glob("*.png")} if out.is_dir() else set()
    wanted = json.loads(json.dumps(made_of))
    if there.intersection(frame_files(cameras)):
        if not resume:
            raise InputError("holds frames already", file=out,
                             remedy=("add ", Option("--resume"), " to keep them, or choose another ", Option("--out")))
        if (kept := _read(out / RECORD)) != wanted:
            other = next((key for key in wanted if kept.get(key) != wanted[key]), "content")
            raise InputError(f"the frames there were made with another {other}", file=out / RECORD,
                             remedy=("choose another ", Option("--out")))
    kept_names = {name for name in there if whole_png(out / name)}
    return [camera for camera in cameras if f"{camera.name}.png" not in kept_names]


def begin_folder(out: Path, made_of: dict) -> None:
    """Writes the record of a folder of frames, which is there, unless it has it already."""
    with contextlib.suppress(InputError):  # one that cannot be read, of a folder without frames
        if _read(out / RECORD) == json.loads(json.dumps(made_of)):
            return
    write_json(out / RECORD, made_of)


def write_frame(out: Path, camera: Camera, picture: np.ndarray, text: dict[str, str] | None) -> None:
    """Writes ``out/NAME.png``.  picture: (H, W, 3) uint8.  text: inside the PNG.  Raises InputError."""
    try:
        write_png(inside(out, f"{camera.name}.png"), picture, text)
    except OSError as error:
        raise InputError(f"{out / camera.name}.png: cannot be written ({error.strerror or error})",
                         remedy=("make room, then go on with ", Option("--resume"))) from None


def _read(record: Path) -> dict:
    """What the frames in a folder were made of.  Raises InputError where the record is there and cannot be read."""
    if not record.exists():
        return {}
    try:
        found = json.loads(record.read_text(encoding="utf-8"))
        if not isinstance(found, dict):
            raise ValueError
        return found
    except (OSError, ValueError, RecursionError):
        raise InputError("cannot be read, so that nothing is known of the frames there", file=record,
                         remedy="remove it to make them again, or choose another --out") from None
