"""``pointglass video``: a camera path, as a video or a sequence of pictures."""

import argparse
import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ...common.errors import InputError
from ...common.failures import tell
from ...common.replaced_files import replaced_told
from ...common.text import counted, whole_number
from ...picture.edits import NO_EDITS, Edits
from ...readers.meshes.mesh_formats import scans_and_meshes
from ...work.cameras.pace import Pace
from ...work.cameras.path import frame_name, interpolate, passing_shares
from ...work.document import LONGEST_STAY, FilmTitle
from ...work.pictures.film_titles import NO_TITLES, FilmTitles, timed_titles
from ..workers_option import add_workers, workers_of
from .film_record import MP4, describe, folder_line, ingredients
from .opened_renderer import opened_renderer
from .path_timing import PathTiming, timing_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...picture.settings import Settings
    from ...render.renderer import Renderer
    from .frames import FrameMaker

FRAMES_A_SECOND = 24.0
MOST_FRAMES = 1_000_000
MOST_FRAMES_A_SECOND = 1000
PANORAMA_SIZE = (4096, 2048)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options besides scans, settings and memory."""
    parser.add_argument("--path", type=Path, required=True, metavar="F",
                        help="camera_path.json, or any other camera file that `render --cameras` takes")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.mp4|DIR",
                        help="an H.264 video, or a folder for one PNG a frame")
    parser.add_argument("--size", metavar="WxH", help="picture size in pixels (default: that of the path; a panorama: "
                        f"{PANORAMA_SIZE[0]}x{PANORAMA_SIZE[1]})")
    parser.add_argument("--fps", type=float, metavar="N",
                        help=f"frames a second (default: the path's, else {FRAMES_A_SECOND:g})")
    parser.add_argument("--seconds", type=float, metavar="S",
                        help="take the cameras as keyframes of a smooth path of this length, at constant speed (default: the "
                             "path's own length; where its cameras are as many, one frame each)")
    parser.add_argument("--ease", action="store_true", help="begin and end slowly (with --seconds, or as the path says)")
    parser.add_argument("--stay", type=float, metavar="S",
                        help="stay S seconds at each camera of the path, of its length (default: as the path says, else 0)")
    parser.add_argument("--title", metavar="TEXT",
                        help="write TEXT over the beginning; lines after a line break are smaller (default: as the path says)")
    parser.add_argument("--caption", action="append", default=[], metavar="N=TEXT",
                        help="write TEXT at the lower left when camera N of the path (from 1) is reached; may be given again")
    parser.add_argument("--title-seconds", type=float, default=FilmTitle.seconds, metavar="S",
                        help=f"how long --title and --caption are shown (default {FilmTitle.seconds:g})")
    parser.add_argument("--panorama", action="store_true", help="360-degree equirectangular pictures around each camera")
    parser.add_argument("--supersample", type=int, default=1, metavar="N",
                        help="render each picture N times wider and higher and average it, 1 to 4 (default 1)")
    parser.add_argument("--background", choices=["black", "plain", "gradient", "sky"], default="black",
                        help="what is shown where there is no surface (default black)")
    parser.add_argument("--resume", action="store_true",
                        help="keep the frames that are there; those of a video lie in FILE.mp4.frames until it is encoded, so "
                             "that an interrupted one goes on with the same line")
    add_workers(parser, "frames")


@dataclass(frozen=True)
class FilmPath:
    """cameras: one a frame.  rate: frames a second.  timing: of the file.  arrivals: seconds at which each of the file's
    cameras is reached."""

    cameras: list["Camera"]
    rate: float
    timing: PathTiming
    arrivals: tuple[float, ...]


def read_path(path: Path, *, size: tuple[int, int] | None = None, fps: float | None = None, seconds: float | None = None,
              stay: float | None = None, ease: bool = False) -> FilmPath:
    """The film of a camera file.

    A file's cameras are frames where they are as many as its own ``fps`` and ``seconds`` say, or where it does not say; else
    keyframes, as with ``seconds``.  stay, ease: as of Pace; None, False: as the file says.  Raises InputError.
    """
    from ...work.cameras.camera_files import read_cameras

    if stay is not None and not 0 <= stay <= LONGEST_STAY:
        raise InputError(f"expected 0 to {LONGEST_STAY:g} seconds", option="--stay", value=f"{stay:g}")
    for name, value in (("--fps", fps), ("--seconds", seconds)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} {value:g}: expected a number above 0")
    if fps is not None and fps > MOST_FRAMES_A_SECOND:
        raise InputError(f"--fps {fps:g}: expected a number above 0, at most {MOST_FRAMES_A_SECOND}")
    cameras = read_cameras(path, size=size)
    own = timing_of(path, len(cameras))
    own_fps, own_seconds = own.fps, own.seconds
    if fps is None and own_fps is not None and own_fps > MOST_FRAMES_A_SECOND:
        raise InputError(f"fps {own_fps:g}: expected at most {MOST_FRAMES_A_SECOND}", file=path, remedy="give --fps")
    rate = fps or own_fps or FRAMES_A_SECOND
    length = seconds or own_seconds
    count = len(cameras) if length is None else max(1, round(length * rate))
    if count > MOST_FRAMES:
        raise InputError(f"{count:,} frames ({length:g} s at {rate:g} a second); at most {MOST_FRAMES:,} can be made",
                         file=path)
    if count == len(cameras) and seconds is None:
        if stay or ease:
            raise InputError("its cameras are frames, each shown once", file=path,
                             remedy="give --seconds, which takes them as keyframes")
        frames = [replace(camera, name=frame_name(number)) for number, camera in enumerate(cameras)]
        return FilmPath(frames, rate, own, tuple(number / rate for number in range(count)))
    stays = own.stays if stay is None else (stay,) * len(cameras)
    pace = Pace(float(length or 0.0), stays, ease or own.ease)
    if pace.shortened:
        tell(pace.shortened)
    arrivals = tuple(pace.arrivals(passing_shares(cameras)).tolist())
    return FilmPath(interpolate(cameras, count, pace), rate, own, arrivals)


def titles_of(options: argparse.Namespace, path: FilmPath) -> FilmTitles:
    """The titles that the options ask for, else those of the path.  Raises InputError, also where no font has a letter."""
    captions = list(path.timing.captions) or [None] * len(path.arrivals)
    for given in options.caption:
        number, equals, text = given.partition("=")
        if not equals or not (count := whole_number(number)) or count > len(captions):
            raise InputError(f"expected N=TEXT, N from 1 to {len(captions)}", option="--caption", value=given)
        captions[count - 1] = _title(text, options.title_seconds, "--caption")
    title = path.timing.title if options.title is None else _title(options.title, options.title_seconds, "--title")
    shown = timed_titles(title, captions, path.arrivals, len(path.cameras) / path.rate)
    titles = FilmTitles(shown, path.rate, options.panorama)
    titles.check()
    return titles


def _title(text: str, seconds: float, option: str) -> FilmTitle:
    """A title of the command line."""
    try:
        return FilmTitle(text, seconds)
    except InputError as error:
        raise InputError((error,), option=option) from None


def film(scene: "Scene", renderer: "Renderer", cameras: "Sequence[Camera]", rate: float, settings: "Settings", out: Path, *,
         panorama: bool = False, supersample: int = 1, background: str = "black", resume: bool = False,
         edits: Edits = NO_EDITS, titles: FilmTitles = NO_TITLES) -> str:
    """Makes the film; returns the line that tells a person what was made.  edits: of a project.  Raises InputError."""
    from ...work.comparing.scene_changes import with_changes
    from .frames import FrameMaker

    edits = with_changes(scene, edits)
    size = cameras[0].width, cameras[0].height
    maker = FrameMaker(renderer, settings, size, supersample, panorama, background, edits, titles)
    try:
        return _write(scene, maker, cameras, rate, out, resume=resume)
    finally:
        maker.release()


def _write(scene: "Scene", maker: "FrameMaker", cameras: "Sequence[Camera]", rate: float, out: Path, *, resume: bool) -> str:
    from .encode import write_folder, write_mp4
    from .resumed_video import write_resumed_mp4

    size, fps = maker.size, Fraction(rate).limit_denominator(1001)
    if out.suffix.lower() in MP4 and not resume:
        write_mp4(out, cameras, maker.picture, size=size, fps=fps)
        return f"{counted(len(cameras), 'frame')} at {rate:g} a second in {out}"
    made_of = ingredients(scene, cameras, maker.settings, panorama=maker.panorama, supersample=maker.supersample,
                          background=maker.background, edits=maker.edits, titles=maker.titles)
    if out.suffix.lower() in MP4:
        made = write_resumed_mp4(out, cameras, maker.picture, size=size, fps=fps, made_of=made_of)
        kept = f", {len(cameras) - made:,} kept" if made < len(cameras) else ""
        return f"{counted(len(cameras), 'frame')} at {rate:g} a second in {out}{kept}"
    made = write_folder(out, cameras, maker.picture, made_of=made_of, resume=resume,
                        describe=partial(describe, scene, maker))
    return folder_line(out, len(cameras), made)


def film_edits(meshes: "Sequence[Path]", scene: "Scene") -> Edits:
    """What lies beside the scan in a film of the command line.  Raises InputError."""
    from ..mesh_files import layers_of

    return Edits(meshes=layers_of(meshes, scene)) if meshes else NO_EDITS


def check(options: argparse.Namespace) -> None:
    """Raises InputError for options that do not fit together, before the scan is read."""
    if options.out.suffix.lower() not in MP4 and options.out.suffix and not options.out.is_dir():
        raise InputError(f"{options.out.suffix} is not written", option="--out", value=options.out,
                         remedy="give a name ending in .mp4, or a folder")
    if not 1 <= options.supersample <= 4:
        raise InputError("expected 1 to 4", option="--supersample", value=options.supersample)


def run(options: argparse.Namespace, settings: "Settings") -> int:
    """The command.  Returns the exit code."""
    from ..render_pictures import parse_size
    from .encode import frame_files
    from .frames import check_form, rendered_cameras

    check(options)
    workers = workers_of(options)
    size = parse_size(options.size) if options.size else PANORAMA_SIZE if options.panorama else None
    path = read_path(options.path, size=size, fps=options.fps, seconds=options.seconds, stay=options.stay, ease=options.ease)
    cameras, rate, titles = path.cameras, path.rate, titles_of(options, path)

    options.scans, meshes = scans_and_meshes(options.scans)

    if workers is not None:
        if options.resume and options.out.suffix.lower() in MP4:
            raise InputError(f"{options.out}: frames that workers make are kept in a folder only", option="--resume",
                             remedy="give a folder to --out")
        from .distributed_film import film_by_workers

        print(film_by_workers(options, settings, cameras, rate, workers, meshes, titles))
        return 0
    check_form((cameras[0].width, cameras[0].height), options.supersample, panorama=options.panorama)
    rendered = rendered_cameras(cameras, options.supersample, panorama=options.panorama)
    with opened_renderer(options, settings, rendered) as (scene, renderer):
        edits = film_edits(meshes, scene)
        with replaced_told(options.out / name for name in frame_files(cameras)):  # of a video the command line says it
            made = film(scene, renderer, cameras, rate, settings, options.out, panorama=options.panorama,
                        supersample=options.supersample, background=options.background, resume=options.resume,
                        edits=edits, titles=titles)
        print(made)
    return 0
