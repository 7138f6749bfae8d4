"""How a picture was made, written into its PNG: camera, settings, weights, scans and version, enough to draw it again.

A PNG text chunk named ``pointglass`` holds one JSON object.  The same picture has the same metadata, so that
``render --like SHOT.png`` writes the same bytes.  A camera is also one line of text, to be copied and pasted.
"""

import json
import unicodedata
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from ... import __version__
from ...common.errors import InputError
from ...common.file_names import leads_elsewhere
from ...common.text import printable
from ...picture.camera import Camera
from ...picture.settings import BACKGROUNDS, Settings
from ...picture.views import VIEWS
from ..document import Alterations
from ..project import from_json, to_json
from .png_text import png_text

if TYPE_CHECKING:
    from ...grid.scene import Scene

KEY = "pointglass"
"""Keyword of the PNG's text chunk."""
EXPOSURES = ("matched", "as-scanned")


@dataclass(frozen=True)
class Shot:
    """A picture's description.

    background: a key of viewer.picture.settings.BACKGROUNDS.  exposures: of EXPOSURES.  scans: names of the scan files;
    points: of the scene.  weights: first digits of the weights file's SHA-256, "" where no network ran.  version: of
    pointglass.  alterations: of the project, none for `render`.  other_view: of a comparison, the view at the right of
    ``split_at``, a share of the width; "" for a single picture.
    """

    camera: Camera
    settings: Settings
    background: str
    exposures: str
    scans: tuple[str, ...]
    points: int
    weights: str = ""
    version: str = __version__
    alterations: Alterations = field(default_factory=Alterations)
    other_view: str = ""
    split_at: float = 0.5

    @property
    def project_fields(self) -> dict:
        """Arguments of :func:`describe_shot` that a project adds."""
        return {"alterations": self.alterations, "other_view": self.other_view, "split_at": self.split_at}

    @property
    def shows_project(self) -> bool:
        """Whether the picture shows more than a camera and settings say: alterations, or two views."""
        return bool(self.other_view) or not self.alterations.none

    def text(self) -> str:
        """The JSON that the PNG keeps."""
        more: dict = {} if self.alterations.none else {"alterations": to_json(self.alterations)}
        if self.other_view:
            more["comparison"] = {"view": self.other_view, "split_at": self.split_at}
        return json.dumps({
            "version": self.version, "scans": list(self.scans), "points": self.points, "exposures": self.exposures,
            "background": self.background, "weights": self.weights, "settings": asdict(self.settings),
            "camera": camera_fields(self.camera), **more,
        })


def describe_shot(scene: "Scene", camera: Camera, settings: Settings, *, background: str, exposures: str = "matched",
                  alterations: Alterations | None = None, other_view: str = "", split_at: float = 0.5) -> Shot:
    """The description of a picture of ``scene``; arguments as the fields of :class:`Shot`."""
    scans = tuple(printable(Path(source).name) for source in scene.meta.get("sources") or [])
    camera = camera if camera.name.isprintable() else replace(camera, name=printable(camera.name))
    weights = _weights_digest(settings) if "neural" in (settings.view, other_view) else ""
    return Shot(camera, settings, background, exposures, scans, scene.count, weights,
                alterations=alterations or Alterations(), other_view=other_view, split_at=split_at)


def _weights_digest(settings: Settings) -> str:
    from ....model.network.weights_folder import weights_file

    path = Path(settings.weights) if settings.weights else weights_file(settings.quality, filtered=settings.filter != "off")
    return _digest(path, path.stat().st_mtime_ns)


@cache
def _digest(path: Path, _changed: int) -> str:
    """Of megabytes, hence once a file.  _changed: its time of change."""
    from ....model.network.weights import digest

    return digest(path)


def camera_fields(camera: Camera) -> dict:
    """A camera as JSON: numbers that come back to the bit."""
    return {
        "name": camera.name, "width": camera.width, "height": camera.height, "fx": camera.fx, "fy": camera.fy, "cx": camera.cx,
        "cy": camera.cy, "camera_to_world": camera.camera_to_world.tolist(),
    }


def camera_line(camera: Camera) -> str:
    """One line of text that :func:`parse_camera_line` turns into the same camera."""
    return json.dumps({"pointglass camera": camera_fields(camera)}, separators=(",", ":"))


def parse_camera_line(text: str) -> Camera:
    """The camera of a line that :func:`camera_line` made.  Raises InputError."""
    try:
        found = json.loads(text)["pointglass camera"]
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
        raise InputError("this text is no camera; copy one from pointglass first") from None
    return _camera(found, "the copied camera")


def cannot_repeat(shows: str) -> dict[str, str]:
    """The text inside a PNG that ``render --like`` cannot draw again.  shows: what it is, such as "a panorama"."""
    return {KEY: json.dumps({"version": __version__, "shows": shows})}


def read_shot(path: Path) -> Shot:
    """The description inside a PNG.  Raises InputError where there is none, or it is damaged."""
    text = png_text(path, KEY)
    if text is None:
        raise InputError(f"{path}: does not say how it was made; give a PNG that render, F12, `video --out DIR` or Python's "
                         "save wrote, or --cameras")
    damaged = InputError(f"{path}: its description is damaged; give --cameras instead")
    try:
        found = json.loads(text, parse_constant=_no_number)
        if isinstance(shows := found.get("shows"), str):
            raise InputError(f"{path}: shows {shows:.80}, and --like draws pictures of one camera, as render makes them; give "
                             "another PNG, or --cameras")
        known = {field.name for field in fields(Settings)}
        settings = {key: value for key, value in found["settings"].items() if key in known}
        altered = found.get("alterations")
        comparison = found.get("comparison") or {}
        texts = [found[key] for key in ("background", "exposures", "weights", "version")] + [comparison.get("view", "")]
        if not all(isinstance(text, str) for text in [*texts, *found["scans"]]):
            raise damaged
        shot = Shot(_camera(found["camera"], str(path)), cast(Settings, from_json(Settings, settings, "settings")),
                    texts[0], texts[1], tuple(found["scans"]), cast(int, from_json(int, found["points"], "points")),
                    texts[2], texts[3],
                    Alterations() if altered is None else cast(Alterations, from_json(Alterations, altered, "alterations")),
                    other_view=texts[4], split_at=cast(float, from_json(float, comparison.get("split_at", 0.5), "split_at")))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError):
        raise damaged from None
    except InputError as error:
        raise (error if str(path) in str(error) else InputError(f"{path}: its description is damaged ({error})")) from None
    if any(unicodedata.category(c) == "Cc" for text in (*texts, *shot.scans, shot.camera.name) for c in text):
        raise damaged  # what describe_shot writes prints
    if leads_elsewhere(shot.camera.name):
        raise InputError(f"{path}: its camera is called {shot.camera.name!r:.60}, which leads out of a folder; pointglass did "
                         "not make this picture")
    if not 0 <= shot.points < 1 << 63 or (shot.other_view and shot.other_view not in VIEWS) or not 0 <= shot.split_at <= 1:
        raise damaged
    if shot.background not in BACKGROUNDS or shot.exposures not in EXPOSURES:
        raise InputError(f"{path}: its background {shot.background!r:.40} or exposures {shot.exposures!r:.40} are unknown; it "
                         f"was made by pointglass {shot.version:.40}, this is {__version__}")
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
    if then.weights != now.weights:
        found.append(f"the network's weights are {now.weights or 'not used'}, and were {then.weights or 'not used'}")
    if then.version != now.version:
        found.append(f"it was made by pointglass {then.version}, this is {now.version}")
    return found


def _camera(found: dict, where: str) -> Camera:
    try:
        lens = [found[key] for key in ("width", "height", "fx", "fy", "cx", "cy")]
        if any(isinstance(value, bool) or not isinstance(value, (int, float)) for value in lens):
            raise TypeError
        width, height, fx, fy, cx, cy = lens
        if not isinstance(found["name"], str):
            raise TypeError
        return Camera(width, height, fx, fy, cx, cy, np.array(found["camera_to_world"], np.float64), found["name"])
    except (TypeError, KeyError, ValueError, OverflowError):
        raise InputError(f"{where}: its camera is damaged") from None
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
