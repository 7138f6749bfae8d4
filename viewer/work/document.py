"""The document: what a person works on, as one immutable value.

Scans and how they are taken, viewpoints, the camera path, clips, measurements, annotations and the look.  Every change makes
a new Document; viewer.work.history keeps the old ones for undo, viewer.work.project reads and writes the file.
Frame: the file's own coordinates, float64, file units, for everything that has a place.  A scan that was moved (aligned, or
levelled) has a transformation from its file's coordinates to those of the document.
"""

from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from ...model.network.qualities import QUALITIES
from ..common.errors import InputError
from ..common.rigid_transform import Rows, check_rigid
from ..common.text import with_whole_characters
from ..picture.camera import Camera
from ..picture.edits import Edits
from ..picture.json_values import UNLESS_DEFAULT
from ..picture.regions import hidden_regions
from ..picture.settings import BACKGROUNDS, Settings
from ..picture.views import VIEWS
from .measuring.measurement import MeasuredPoint, Measurement
from .notes.annotation import Annotation
from .viewpoint import Viewpoint

LONGEST_STAY = 3600.0
"""Seconds at a keyframe of a camera path."""
LONGEST_TITLE, LONGEST_TEXT = 600.0, 300
"""Seconds that a text is shown in a film, and its letters."""
FILM_SIDES, FILM_SAMPLES = (16, 8192), (1, 2, 3, 4)
"""Sides of a film's pictures, least and greatest, pixels; samples of a pixel along a side."""


@dataclass(frozen=True)
class ScanFile:
    """One scan file or folder of the document.

    path: as opened; the project file stores it relative to itself.  visible: whether it is read when the project opens.
    metres_per_unit, crs: assigned by the person; None: as the file says.
    transform: rigid, from the file's own coordinates to those of the document; None: they are the same.
    unsure: uncertainty (95 %) of the place that the transformation gives it beside the others, file units; None: not known.
    """

    path: str
    visible: bool = True
    metres_per_unit: float | None = None
    crs: str | None = None
    transform: Rows | None = field(default=None, metadata=UNLESS_DEFAULT)
    unsure: float | None = field(default=None, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        if self.transform is not None:
            check_rigid(self.transform, f"{self.path}: transform")
        if self.unsure is not None and not 0 <= self.unsure < np.inf:
            raise InputError(f"unsure {self.unsure!r}: expected a length, 0 or more", file=self.path)
        if self.metres_per_unit is not None and not (np.isfinite(self.metres_per_unit) and self.metres_per_unit > 0):
            raise InputError(f"{self.metres_per_unit!r} metres per unit: expected a number above 0", file=self.path)


@dataclass(frozen=True)
class FilmTitle:
    """A text over a film.  text: its lines.  seconds: how long it is shown, with the time in which it appears and fades."""

    text: str
    seconds: float = 4.0

    def __post_init__(self) -> None:
        if not self.text.strip() or len(self.text) > LONGEST_TEXT:
            raise InputError(f"title of {len(self.text)} letters: expected 1 to {LONGEST_TEXT}")
        if not 0.1 <= self.seconds <= LONGEST_TITLE:
            raise InputError(f"title {self.text[:30]!r}: {self.seconds!r}: expected 0.1 to {LONGEST_TITLE:g} seconds")


@dataclass(frozen=True)
class Keyframe:
    """A view that the camera path passes at ``time``, seconds from its beginning.  stay: seconds that the camera stays there,
    of the film's length.  caption: shown from when the camera arrives."""

    time: float
    view: Viewpoint
    stay: float = field(default=0.0, metadata=UNLESS_DEFAULT)
    caption: FilmTitle | None = field(default=None, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.time) and self.time >= 0):
            raise InputError(f"keyframe {self.view.name!r}: time {self.time!r}: expected seconds from 0")
        if not 0 <= self.stay <= LONGEST_STAY:
            raise InputError(f"keyframe {self.view.name!r}: stay {self.stay!r}: expected 0 to {LONGEST_STAY:g} seconds")


@dataclass(frozen=True)
class FilmFormat:
    """How the pictures of a film are rendered.  size: pixels, even as H.264 asks for.  panorama: 360 degrees, of
    ``panorama_size``.  view: of VIEWS.  quality: of the neural view; "": that of the window.  supersample: n x n samples.
    """

    size: tuple[int, int] = (1920, 1080)
    panorama: bool = False
    panorama_size: tuple[int, int] = (4096, 2048)
    view: str = "neural"
    quality: str = ""
    supersample: int = 1

    def __post_init__(self) -> None:
        low, high = FILM_SIDES
        for size in (self.size, self.panorama_size):
            if not all(low <= side <= high and side % 2 == 0 for side in size):
                raise InputError(f"film of {size[0]} x {size[1]} pixels: expected even numbers from {low} to {high}")
        for name, value, known in (("view", self.view, VIEWS), ("quality", self.quality, ("", *QUALITIES)),
                                   ("supersample", self.supersample, FILM_SAMPLES)):  # fmt: skip
            if value not in known:
                raise InputError(f"film {name} {value!r}: expected one of {', '.join(str(each) for each in known if each)}")


@dataclass(frozen=True)
class CameraPath:
    """Keyframes in order of time.  fps: pictures a second.  closed: the last keyframe leads back to the first.  ease: whether
    the film begins and ends slowly.  title: shown when it begins.  format: of its pictures."""

    keyframes: tuple[Keyframe, ...] = ()
    fps: float = 30.0
    closed: bool = False
    ease: bool = field(default=False, metadata=UNLESS_DEFAULT)
    title: FilmTitle | None = field(default=None, metadata=UNLESS_DEFAULT)
    format: FilmFormat = field(default=FilmFormat(), metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        times = [key.time for key in self.keyframes]
        if any(after <= before for before, after in pairwise(times)):
            raise InputError(f"camera path: keyframe times {times!r} must increase")
        if not 0 < self.fps <= 1000:
            raise InputError(f"camera path: {self.fps!r} pictures a second: expected a number above 0, at most 1000")


@dataclass(frozen=True)
class Document(Edits):
    """Everything that a project file keeps: the edits of pictures, and the fields below.

    view: where the camera stands; None: not opened yet.
    """

    scans: tuple[ScanFile, ...] = ()
    view: Viewpoint | None = None
    viewpoints: tuple[Viewpoint, ...] = ()
    path: CameraPath = field(default_factory=CameraPath)
    measurements: tuple[Measurement, ...] = ()
    annotations: tuple[Annotation, ...] = ()
    settings: Settings = field(default_factory=Settings)
    background: str = "plain"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.background not in BACKGROUNDS:
            raise InputError(f"background {self.background!r}: expected one of {', '.join(BACKGROUNDS)}")

    @property
    def edits(self) -> Edits:
        """What changes pictures of the scans, without the rest; equal for documents whose pictures are."""
        found: dict[str, Any] = {each.name: getattr(self, each.name) for each in fields(Edits)}
        found["hidden_stations"] = tuple(sorted(self.hidden_stations))
        found["hidden_classes"] = tuple(sorted(self.hidden_classes))
        found["regions"] = tuple(replace(region, name="") for region in hidden_regions(self.regions))
        found["comparison"] = None if self.comparison is None else self.comparison.in_picture
        return Edits(**found)


def with_whole_names(document: Document) -> Document:
    """The document of a file, in which every name and text can be drawn.  Paths stay as they are."""
    def named(item: Any) -> Any:
        return replace(item, name=with_whole_characters(item.name))

    def points(measurement: Measurement) -> tuple[MeasuredPoint, ...]:
        return tuple(replace(point, scan=with_whole_characters(point.scan)) for point in measurement.points)

    def titled(title: FilmTitle | None) -> FilmTitle | None:
        return None if title is None else replace(title, text=with_whole_characters(title.text)[:LONGEST_TEXT])

    keys = tuple(replace(key, view=named(key.view), caption=titled(key.caption)) for key in document.path.keyframes)
    return replace(
        document,
        clips=tuple(map(named, document.clips)),
        viewpoints=tuple(map(named, document.viewpoints)),
        path=replace(document.path, keyframes=keys, title=titled(document.path.title)),
        measurements=tuple(replace(named(made), points=points(made)) for made in document.measurements),
        annotations=tuple(note.with_whole_texts() for note in document.annotations),
        regions=tuple(map(named, document.regions)),
        photographs=tuple(map(named, document.photographs)),
    )


Item = TypeVar("Item")


def unique_name(base: str, taken) -> str:
    """``base`` or the first of ``base 2``, ``base 3``, ... that no item of ``taken`` (strings) has."""
    taken = set(taken)
    number = 1
    name = base
    while name in taken:
        number += 1
        name = f"{base} {number}"
    return name


def replaced(items: tuple[Item, ...], index: int, item: Item) -> tuple[Item, ...]:
    """``items`` with the one at ``index`` exchanged."""
    return items[:index] + (item,) + items[index + 1 :]


def without(items: tuple[Item, ...], index: int) -> tuple[Item, ...]:
    """``items`` without the one at ``index``."""
    return items[:index] + items[index + 1 :]


def moved(document: Document, camera: Camera) -> Document:
    """The document with the camera where it is now; not a step that is undone."""
    return replace(document, view=Viewpoint.of(camera, "last view"))
