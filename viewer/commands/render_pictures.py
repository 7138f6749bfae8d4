"""Pictures of a list of cameras, as PNG files that carry the cameras' names, without a window."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ...model.common.files.json_file import write_json
from ..common.errors import InputError
from ..common.file_names import safe_name
from ..common.files import out_folder, write_array, write_png, write_together
from ..common.progress import progress
from ..common.text import whole_number
from ..picture.background import as_saved
from ..picture.provenance import views_with_mask
from ..work.pictures.finished_pictures import is_finished
from ..work.pictures.shot_metadata import KEY, Shot, cannot_repeat, describe_shot

if TYPE_CHECKING:
    import numpy as np

    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from ..picture.spec import PictureSpec
    from ..render.renderer import Renderer

Files = dict[str, Callable[[Path], object]]
"""Of one camera: file name -> what writes it at a path."""
_AUX = (".depth.npy", ".mask.npy", ".provenance.png", ".stats.json")
_PROVENANCE_TEXT = cannot_repeat("the provenance of pixels")


def parse_size(text: str) -> tuple[int, int]:
    """``960x720`` -> (960, 720).  Raises InputError."""
    width, cross, height = text.lower().partition("x")
    size = whole_number(width), whole_number(height)
    if not (cross and size[0] and size[1]):
        raise InputError("expected WIDTHxHEIGHT in pixels, such as 960x720", option="--size", value=text)
    return size[0], size[1]


def parse_shard(text: str) -> tuple[int, int]:
    """``2/8`` -> (2, 8): the third of eight parts, counted from 0.  Raises InputError."""
    first, slash, second = text.partition("/")
    part, parts = whole_number(first), whole_number(second)
    if not slash or part is None or parts is None or part >= parts:
        raise InputError("expected i/n with i from 0 to n - 1, such as 0/4", option="--shard", value=text)
    return part, parts


def picture_files(out: Path, cameras: Iterable["Camera"], *, aux: bool) -> list[Path]:
    """What :func:`export_pictures` writes."""
    return [out / f"{safe_name(camera.name, 'picture')}{ending}" for camera in cameras
            for ending in (".png", *(_AUX if aux else ()))]


def export_pictures(renderer: "Renderer", specs: Sequence["PictureSpec"], out: Path, *, aux: bool = False,
                    exposures: str = "matched", resume: bool = False) -> int:
    """Renders every description into ``out/NAME.png``, NAME of its camera; with ``aux`` also depth, mask, provenance and stats.
    Returns how many were rendered: with ``resume`` without those whose files are complete and have the same description.

    exposures: how the scene was opened.  Each picture says inside its PNG how it was made (viewer.work.pictures.shot_metadata).
    Raises InputError for ``aux`` of a picture with edits or two views.

    The files of one camera appear whole and together, or not at all; a new ``out`` without any does not stay.  A mask needs
    the filter, whatever the view.
    """
    check_aux(specs, aux=aux)
    rendered = 0
    with out_folder(out), progress(len(specs), "rendering", "picture") as meter:
        for spec in specs:
            rendered += export_picture(renderer, spec, out, aux=aux, exposures=exposures, resume=resume)
            meter.update(1)
    return rendered


def check_aux(specs: "Iterable[PictureSpec]", *, aux: bool) -> None:
    """Raises InputError for ``aux`` of a picture with edits or two views."""
    if aux and not all(spec.plain for spec in specs):
        raise InputError("the picture shows clips, colours or a comparison of a project", option="--aux",
                         remedy="leave --aux out")


def export_picture(renderer: "Renderer", spec: "PictureSpec", out: Path, *, aux: bool, exposures: str, resume: bool) -> bool:
    """One picture of :func:`export_pictures`; ``out`` is there.  Returns whether it was rendered."""
    from ..render.described_picture import picture_of
    from ..work.comparing.scene_changes import spec_with_changes

    spec = spec_with_changes(renderer.scene, spec)
    shot = describe_shot(renderer.scene, spec, exposures=exposures)
    if resume and is_finished(out, shot, newer_than=_newest(renderer.scene), aux=aux):
        return False
    write_together(out, _with_aux(renderer, shot) if aux else _picture(picture_of(renderer, spec), renderer, shot))
    return True


def _newest(scene: "Scene") -> float:
    """Time of change of the scan file that was changed last: a picture from before it shows another scan."""
    files = [Path(source) for source in scene.meta.sources]
    return max((file.stat().st_mtime for file in files if file.exists()), default=0.0)


def _picture(image: "np.ndarray", renderer: "Renderer", shot: Shot) -> Files:
    """The file of a picture as it is saved."""
    shot = shot.drawn_with(renderer.choice.timed)
    return {f"{_stem(shot)}.png": lambda path: write_png(path, image, {KEY: shot.text()})}


def _with_aux(renderer: "Renderer", shot: Shot) -> Files:
    """The files of a picture that shows one view as it is rendered."""
    from ..render.described_picture import Composer, render

    name, spec = _stem(shot), shot.spec
    frame, composer = render(renderer, spec, more=views_with_mask(spec.views[0])), Composer(renderer.context)
    try:
        image, origin, mask = composer.images(frame, spec)[0], composer.provenance(frame, spec), frame.mask()
    finally:
        composer.release()
    return _picture(as_saved(image, spec.background), renderer, shot) | {
        f"{name}.depth.npy": lambda path: write_array(path, frame.depth()),
        f"{name}.mask.npy": lambda path: write_array(path, mask),
        f"{name}.provenance.png": lambda path: write_png(path, origin, _PROVENANCE_TEXT),
        f"{name}.stats.json": lambda path: write_json(path, frame.stats),
    }


def _stem(shot: Shot) -> str:
    return safe_name(shot.spec.camera.name, "picture")
