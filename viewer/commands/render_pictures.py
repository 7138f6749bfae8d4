"""Pictures of a list of cameras, as PNG files that carry the cameras' names, without a window."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..common.errors import InputError
from ..common.file_names import safe_name
from ..common.files import out_folder, write_array, write_json, write_png, write_together
from ..common.progress import progress
from ..common.text import whole_number
from ..picture.background import as_saved
from ..picture.provenance import provenance, views_with_mask
from ..picture.settings import Settings
from ..work.pictures.finished_pictures import is_finished
from ..work.pictures.shot_metadata import KEY, Shot, cannot_repeat, describe_shot

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from ..render.frame import Frame
    from ..render.renderer import Renderer

_AUX = (".depth.npy", ".mask.npy", ".provenance.png", ".stats.json")
_PROVENANCE_TEXT = cannot_repeat("the provenance of pixels")


def parse_size(text: str) -> tuple[int, int]:
    """``960x720`` -> (960, 720).  Raises InputError."""
    width, cross, height = text.lower().partition("x")
    size = whole_number(width), whole_number(height)
    if not (cross and size[0] and size[1]):
        raise InputError(f"--size {text!r}: expected WIDTHxHEIGHT in pixels, such as 960x720")
    return size[0], size[1]


def parse_shard(text: str) -> tuple[int, int]:
    """``2/8`` -> (2, 8): the third of eight parts, counted from 0.  Raises InputError."""
    first, slash, second = text.partition("/")
    part, parts = whole_number(first), whole_number(second)
    if not slash or part is None or parts is None or part >= parts:
        raise InputError(f"--shard {text!r}: expected i/n with i from 0 to n - 1, such as 0/4")
    return part, parts


def picture_files(out: Path, cameras: list["Camera"], *, aux: bool) -> list[Path]:
    """What :func:`export_pictures` writes."""
    return [out / f"{safe_name(camera.name, 'picture')}{ending}" for camera in cameras
            for ending in (".png", *(_AUX if aux else ()))]


def export_pictures(
    renderer: "Renderer", cameras: list["Camera"], settings: Settings, out: Path, *, aux: bool = False,
    background: str = "black", exposures: str = "matched", like: Shot | None = None, resume: bool = False,
) -> int:  # fmt: skip
    """Renders every camera into ``out/NAME.png``; with ``aux`` also depth, mask, provenance and stats.  Returns how many were
    rendered: with ``resume`` without those whose files are complete and have the same description.

    background: behind the pictures, a key of viewer.picture.settings.BACKGROUNDS.  exposures: how the scene was opened.
    like: a saved picture, whose alterations and comparison are applied to each camera (not with ``aux``).  Each picture says
    inside its PNG how it was made (viewer.work.pictures.shot_metadata).

    The files of one camera appear whole and together, or not at all; a new ``out`` without any does not stay.  A mask needs
    the filter, whatever the view.
    """
    if aux and like and like.shows_project:
        raise InputError("--aux: the picture shows clips, colours or a comparison of a project; leave --aux out")
    views = views_with_mask(settings.view) if aux else (settings.view,)
    rendered = 0
    with out_folder(out), progress(len(cameras), "rendering", "picture") as meter:
        for camera in cameras:
            shot = describe_shot(renderer.scene, camera, settings, background=background, exposures=exposures,
                                 **(like.project_fields if like else {}))
            if resume and is_finished(out, shot, newer_than=_newest(renderer.scene), aux=aux):
                meter.update(1)
                continue
            rendered += 1
            if shot.shows_project:
                write_together(out, _altered_file(renderer, shot))
            else:
                write_together(out, _files(renderer.render(camera, settings, views), shot, aux=aux))
            meter.update(1)
    return rendered


def _newest(scene: "Scene") -> float:
    """Time of change of the scan file that was changed last: a picture from before it shows another scan."""
    files = [Path(source) for source in scene.meta.get("sources") or []]
    return max((file.stat().st_mtime for file in files if file.exists()), default=0.0)


def _altered_file(renderer: "Renderer", shot: Shot) -> dict[str, Callable[[Path], object]]:
    """The picture of a shot with alterations or two views, as :func:`_files`."""
    from ..work.pictures.altered_pictures import shot_picture

    image = shot_picture(renderer, shot)
    return {f"{safe_name(shot.camera.name, 'picture')}.png": lambda path: write_png(path, image, {KEY: shot.text()})}


def _files(frame: "Frame", shot: Shot, *, aux: bool) -> dict[str, Callable[[Path], object]]:
    """What is written of one camera: file name -> what writes it at a path."""
    name, view = safe_name(shot.camera.name, "picture"), shot.settings.view
    image = frame.image(view)
    files: dict[str, Callable[[Path], object]] = {
        f"{name}.png": lambda path: write_png(path, as_saved(image, shot.background), {KEY: shot.text()}),
    }
    if aux:
        mask = frame.mask()
        files |= {
            f"{name}.depth.npy": lambda path: write_array(path, frame.depth()),
            f"{name}.mask.npy": lambda path: write_array(path, mask),
            f"{name}.provenance.png": lambda path: write_png(path, provenance(view, image, mask), _PROVENANCE_TEXT),
            f"{name}.stats.json": lambda path: write_json(path, frame.stats),
        }
    return files
