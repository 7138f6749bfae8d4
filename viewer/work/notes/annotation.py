"""A note: a text at a place, with what a person needs to follow it up.

Frame: file coordinates, file units.
"""

import re
import uuid
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

from ...common.errors import InputError
from ...common.text import with_whole_characters
from ...picture.clip import Vector
from ...picture.json_values import UNLESS_DEFAULT
from ..viewpoint import Viewpoint


@dataclass(frozen=True)
class Status:
    """name: as a person reads it.  bcf: as BCF's TopicStatus has it.  rgb: of the marker, sRGB.  done: nothing is left to
    do."""

    name: str
    bcf: str
    rgb: tuple[int, int, int]
    done: bool = False


STATUSES = {
    "open": Status("Open", "Open", (240, 185, 91)),
    "in progress": Status("In progress", "In Progress", (125, 180, 255)),
    "done": Status("Done", "Closed", (127, 216, 139), done=True),
}
"""What becomes of a note, the first one at first."""
PICTURE_ENDINGS = (".jpg", ".jpeg", ".png")
"""Of the names of attached pictures; another file is neither read nor opened."""
_ADDRESS = re.compile(r"https?://[^\s/?#]+\S*", re.IGNORECASE)
_TITLE = 48
"""Letters of a title, which is drawn beside the marker."""
_BEGINNING = 400
"""Letters of a text that a tooltip shows."""
_IDENTITY = uuid.UUID("5d4f3f2e-6a3c-4c0e-9a56-1f6c0b7a9d11")
"""Namespace of the identifiers of notes; drawn at random, once."""


@dataclass(frozen=True)
class Annotation:
    """A note.  text: of several lines; the first one is its title.  position: a measured point, as in the file.

    status: a key of STATUSES.  link: an http or https address, or "".  picture: path of a JPEG or PNG file, or "".
    view: from where it was written.  made: when, in UTC (ISO 8601); "" in projects from before notes had a time.
    scan: the scan that it is on, which it follows where that is moved; "" where that is not known.
    Raises InputError where the status is unknown.
    """

    text: str
    position: Vector
    status: str = field(default="open", metadata=UNLESS_DEFAULT)
    link: str = field(default="", metadata=UNLESS_DEFAULT)
    picture: str = field(default="", metadata=UNLESS_DEFAULT)
    view: Viewpoint | None = field(default=None, metadata=UNLESS_DEFAULT)
    made: str = field(default="", metadata=UNLESS_DEFAULT)
    scan: str = field(default="", metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise InputError(f"note {self.text[:_TITLE]!r}: status {self.status!r}: expected one of {', '.join(STATUSES)}")

    def title(self, number: int) -> str:
        """The first line that is not empty, shortened, or "Note 3".  number: of the note, from 0."""
        first = next((line.strip() for line in self.text.splitlines() if line.strip()), "")
        if not first:
            return f"Note {number + 1}"
        return first if len(first) <= _TITLE else first[: _TITLE - 1].rstrip() + "…"

    @property
    def beginning(self) -> str:
        """As much of the text as a tooltip shows."""
        return self.text if len(self.text) <= _BEGINNING else self.text[: _BEGINNING - 1] + "…"

    @property
    def identity(self) -> str:
        """A UUID that stays while the note is edited: of the time and place where it was made."""
        place = ",".join(value.hex() for value in self.position)
        return str(uuid.uuid5(_IDENTITY, f"{self.made}|{place}"))

    def with_whole_texts(self) -> "Annotation":
        """The note with texts that can be drawn.  The path of its picture stays as it is."""
        view = self.view and replace(self.view, name=with_whole_characters(self.view.name))
        return replace(self, text=with_whole_characters(self.text), link=with_whole_characters(self.link), view=view,
                       made=with_whole_characters(self.made), scan=with_whole_characters(self.scan))


def time_of(note: Annotation) -> datetime | None:
    """When a note was made, in UTC; None where it does not say."""
    try:
        made = datetime.fromisoformat(note.made)
    except ValueError:
        return None
    return made.replace(tzinfo=UTC) if made.tzinfo is None else made.astimezone(UTC)


def is_address(text: str) -> bool:
    """Whether a link may be opened: an http or https address without spaces and control characters."""
    return bool(_ADDRESS.fullmatch(text)) and text.isprintable()


def is_picture_name(path: str) -> bool:
    """Whether a file is called as attached pictures are."""
    return path.lower().endswith(PICTURE_ENDINGS)
