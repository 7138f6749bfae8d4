"""What a camera_path.json says about its film: frames a second, length, and what only pointglass writes: pace, titles."""

import json
from dataclasses import dataclass
from pathlib import Path

from ...common.errors import InputError
from ...picture.json_values import from_json
from ...work.document import LONGEST_STAY, FilmTitle

_LARGEST_TIMING = 1e300
"""Frames a second or seconds that a file may state; JSON allows whole numbers that no float holds."""


@dataclass(frozen=True)
class PathTiming:
    """Frames a second and seconds that a camera_path.json states, None where it does not; its pace and its titles: a caption,
    or None, for each camera."""

    fps: float | None = None
    seconds: float | None = None
    stays: tuple[float, ...] = ()
    ease: bool = False
    title: FilmTitle | None = None
    captions: tuple[FilmTitle | None, ...] = ()


def timing_of(path: Path, count: int) -> PathTiming:
    """Durations, stays and captions in a camera file that ``read_cameras`` has accepted.  count: of its cameras.  Raises
    InputError."""
    if path.suffix.lower() != ".json":
        return PathTiming()
    data = json.loads(path.read_text(encoding="utf-8-sig"))  # read_cameras has read it
    if not isinstance(data, dict) or "camera_path" not in data:
        return PathTiming()
    found = []
    for key in ("fps", "seconds"):
        value = data.get(key)
        good = isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < _LARGEST_TIMING
        if value is not None and not good:
            raise InputError(f"{key} {value!r:.60}: expected a number above 0", file=path)
        found.append(None if value is None else float(value))
    stays = []
    for number, frame in enumerate(data["camera_path"][:count]):
        value = frame.get("stay", 0.0)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= LONGEST_STAY:
            raise InputError(f"stay {value!r:.60} of camera {number}: expected 0 to {LONGEST_STAY:g} seconds", file=path)
        stays.append(float(value))
    captions = [_title(path, frame.get("caption"), f"caption of camera {number}")
                for number, frame in enumerate(data["camera_path"][:count])]
    return PathTiming(found[0], found[1], tuple(stays), data.get("ease") is True, _title(path, data.get("title"), "title"),
                      tuple(captions))


def _title(path: Path, data: object, where: str) -> FilmTitle | None:
    return None if data is None else from_json(FilmTitle, data, f"{path}: {where}")
