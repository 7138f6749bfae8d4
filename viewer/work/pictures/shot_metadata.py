"""How a picture was made, written into its PNG: camera, settings, weights, scans and version, enough to draw it again.

A PNG text chunk named ``pointglass`` holds one JSON object.  The same picture has the same metadata, so that
``render --like SHOT.png`` writes the same bytes.  A camera is also one line of text, to be copied and pasted.
"""

import json
import unicodedata
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, cast

from ... import __version__
from ...common.errors import InputError, Option
from ...common.file_names import leads_elsewhere
from ...common.rigid_transform import Rows, check_rigid
from ...common.text import printable
from ...picture.camera import Camera
from ...picture.json_values import from_json
from ...picture.settings import BACKGROUNDS, Settings
from ...picture.spec import PictureSpec, camera_from_json, camera_to_json
from .png_text import png_text

if TYPE_CHECKING:
    from ...grid.scene import Scene

KEY = "pointglass"
"""Keyword of the PNG's text chunk."""
TIMED = ("compute", "points")
"""The rasterisers that a GPU may choose by timing."""
EXPOSURES = ("matched", "as-scanned")


@dataclass(frozen=True)
class Shot:
    """A picture's description and what it was made from.

    exposures: of EXPOSURES.  scans: names of the scan files; points: of the scene.  weights: first digits of the weights file's
    SHA-256, "" where no network ran.  version: of pointglass.  raster: the rasteriser that a GPU chose by timing, "" where none
    was chosen so.  moves: of each file the rigid transformation that a project gave it, None where it stays; (): all stay.
    """

    spec: PictureSpec
    exposures: str
    scans: tuple[str, ...]
    points: int
    weights: str = ""
    version: str = __version__
    raster: str = ""
    moves: tuple[Rows | None, ...] = ()

    def drawn_with(self, timed: str) -> "Shot":
        """The same picture, drawn by a renderer that chose its rasteriser by timing (RasterChoice.timed; "": it did not)."""
        return replace(self, raster=timed if self.spec.settings.raster == "auto" else "")

    def text(self) -> str:
        """The JSON that the PNG keeps."""
        spec = self.spec.to_json() | ({"raster": self.raster} if self.raster else {}) | (
            {"moves": self.moves} if self.moves else {})  # fmt: skip
        return json.dumps({
            "version": self.version, "scans": list(self.scans), "points": self.points, "exposures": self.exposures,
            "background": spec.pop("background"), "weights": self.weights, **spec,
        })


def describe_shot(scene: "Scene", spec: PictureSpec, *, exposures: str | None = None) -> Shot:
    """The description of a picture of ``scene``.  exposures: as in :class:`Shot`; None: those that the scene has."""
    scans = tuple(printable(Path(source).name) for source in scene.meta.sources)
    if not spec.camera.name.isprintable():
        spec = replace(spec, camera=replace(spec.camera, name=printable(spec.camera.name)))
    weights = _weights_digest(spec.settings) if "neural" in spec.views else ""
    return Shot(spec, exposures or ("matched" if scene.matched else "as-scanned"), scans, scene.count, weights,
                moves=scene.meta.records.moves if scene.meta.records is not None else ())


def _weights_digest(settings: Settings) -> str:
    from ....model.network.weights_folder import weights_file

    path = Path(settings.weights) if settings.weights else weights_file(settings.quality, filtered=settings.filter != "off")
    return _digest(path, path.stat().st_mtime_ns)


@cache
def _digest(path: Path, _changed: int) -> str:
    """Of megabytes, hence once a file.  _changed: its time of change."""
    from ....model.network.weights import digest

    return digest(path)


def camera_line(camera: Camera) -> str:
    """One line of text that :func:`parse_camera_line` turns into the same camera."""
    return json.dumps({"pointglass camera": camera_to_json(camera)}, separators=(",", ":"))


def parse_camera_line(text: str) -> Camera:
    """The camera of a line that :func:`camera_line` made.  Raises InputError."""
    try:
        found = json.loads(text)["pointglass camera"]
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
        raise InputError("this text is no camera", remedy="copy one from pointglass first") from None
    return camera_from_json(found, "the copied camera")


def cannot_repeat(shows: str) -> dict[str, str]:
    """The text inside a PNG that ``render --like`` cannot draw again.  shows: what it is, such as "a panorama"."""
    return {KEY: json.dumps({"version": __version__, "shows": shows})}


def read_shot(path: Path) -> Shot:
    """The description inside a PNG.  Raises InputError where there is none, or it is damaged."""
    text = png_text(path, KEY)
    if text is None:
        raise InputError("does not say how it was made", file=path,
                         remedy=("give a PNG that render, F12, `video --out DIR` or Python's save wrote, or ",
                                 Option("--cameras")))
    damaged = InputError("its description is damaged", file=path, remedy=("give ", Option("--cameras"), " instead"))
    try:
        found = json.loads(text, parse_constant=_no_number)
        if isinstance(shows := found.get("shows"), str):
            raise InputError((f"shows {shows:.80}, and ", Option("--like"),
                              " draws pictures of one camera, as render makes them"), file=path,
                             remedy=("give another PNG, or ", Option("--cameras")))
        texts = [found[key] for key in ("background", "exposures", "weights", "version")]
        if not all(isinstance(text, str) for text in [*texts, *found["scans"]]):
            raise damaged
        background, exposures, weights, version = texts
        if background not in BACKGROUNDS or exposures not in EXPOSURES:
            raise InputError(f"its background {background!r:.40} or exposures {exposures!r:.40} are unknown; it was made by "
                             f"pointglass {version!r:.40}, this is {__version__}", file=path)
        raster = found.get("raster", "")  # pictures of before it was kept have none
        if raster not in ("", *TIMED):
            raise damaged
        moves = cast(tuple[Rows | None, ...], from_json(tuple[Rows | None, ...], found.get("moves", []), "moves"))
        for rows in filter(None, moves):
            check_rigid(rows, "moves")
        shot = Shot(PictureSpec.from_json(found, str(path)), exposures, tuple(found["scans"]),
                    cast(int, from_json(int, found["points"], "points")), weights, version, raster, moves)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError):
        raise damaged from None
    except InputError as error:
        raise (error if str(error.file) == str(path) else
               InputError(f"its description is damaged ({error})", file=path)) from None  # fmt: skip
    if any(unicodedata.category(c) == "Cc" for text in (*texts, *shot.scans, shot.spec.camera.name) for c in text):
        raise damaged  # what describe_shot writes prints
    if leads_elsewhere(shot.spec.camera.name):
        raise InputError(f"its camera is called {shot.spec.camera.name!r:.60}, which leads out of a folder; pointglass did "
                         "not make this picture", file=path)
    if not 0 <= shot.points < 1 << 63:
        raise damaged
    return shot


def _no_number(name: str) -> float:
    raise ValueError(name)  # Infinity and NaN


def differences(then: Shot, now: Shot) -> list[str]:
    """Why a picture drawn again may differ from the first one, in words; empty where nothing speaks for it."""
    found = []
    if then.points != now.points:
        found.append(f"the scan has {now.points:,} points, and had {then.points:,}")
    if then.scans != now.scans:
        found.append(f"it was made from {', '.join(then.scans) or 'arrays'}")
    if then.moves != now.moves:
        found.append("its scans were at other places, where a project had moved them")
    if then.weights != now.weights:
        found.append(f"the network's weights are {now.weights or 'not used'}, and were {then.weights or 'not used'}")
    if then.version != now.version:
        found.append(f"it was made by pointglass {then.version}, this is {now.version}")
    return found
