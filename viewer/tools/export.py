"""Pictures of a list of cameras, as PNG files that carry the cameras' names, without a window."""

from pathlib import Path
from typing import TYPE_CHECKING

from model.folders import made_folder
from viewer.errors import InputError
from viewer.progress import progress
from viewer.settings import Settings
from viewer.tools.files import write_array, write_json, write_png

if TYPE_CHECKING:
    from viewer.camera import Camera
    from viewer.render.renderer import Renderer


def parse_size(text: str) -> tuple[int, int]:
    """``960x720`` -> (960, 720).  Raises InputError."""
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise InputError(f"--size {text!r}: expected WIDTHxHEIGHT in pixels, such as 960x720")
    return int(width), int(height)


def parse_shard(text: str) -> tuple[int, int]:
    """``2/8`` -> (2, 8): the third of eight parts, counted from 0.  Raises InputError."""
    part, slash, parts = text.partition("/")
    if not (slash and part.isdigit() and parts.isdigit() and int(part) < int(parts)):
        raise InputError(f"--shard {text!r}: expected i/n with i from 0 to n - 1, such as 0/4")
    return int(part), int(parts)


def export_pictures(
    renderer: "Renderer", cameras: list["Camera"], settings: Settings, out: Path, *, aux: bool = False
) -> int:
    """Renders every camera into ``out/NAME.png``; with ``aux`` also depth, mask and stats.  Returns how many.

    Each file appears whole or not at all; a new ``out`` without any picture does not stay.
    """
    with made_folder(out, make=False):
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{out}: cannot make this folder ({error.strerror}); choose another --out") from None
        with progress(len(cameras), "rendering", "picture") as meter:
            for camera in cameras:
                frame = renderer.render(camera, settings)
                write_png(out / f"{camera.name}.png", frame.image(settings.view)[..., :3])
                if aux:
                    write_array(out / f"{camera.name}.depth.npy", frame.depth())
                    write_array(out / f"{camera.name}.mask.npy", frame.mask())
                    write_json(out / f"{camera.name}.stats.json", frame.stats)
                meter.update(1)
    return len(cameras)
