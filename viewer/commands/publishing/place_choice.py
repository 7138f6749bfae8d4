"""What ``--at`` of ``pointglass publish`` says: where places are made.  Quick to load, for the help."""

from pathlib import Path

from ...common.errors import InputError
from ...common.text import whole_number
from ...picture.camera import Camera
from ...work.cameras.camera_files import read_cameras

CHOICES = ("auto", "stations", "viewpoints")
PLANNED = 12
"""Places that are planned where no number is given, at most."""
MOST = 500
"""Places of a publication: its plan and lists are read by people."""

PlaceChoice = str | int | tuple[Camera, ...]
"""A key of CHOICES, a number of places to plan, or cameras in file coordinates."""


def parse_places(text: str) -> PlaceChoice:
    """A key of CHOICES, a number of places, or the cameras of the file of this name.  Raises InputError."""
    if text in CHOICES:
        return text
    number = whole_number(text)
    if number is None and Path(text).exists():
        return tuple(read_cameras(Path(text)))
    if not number or number > MOST:
        raise InputError(f"expected {', '.join(CHOICES)}, a camera file that exists, or a number of places from 1 to {MOST}",
                         option="--at", value=text)
    return number
