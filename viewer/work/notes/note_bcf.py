"""Notes as a BCF file, version 2.1 (buildingSMART), which planning programs read: a topic each, with place, view and picture.

Frame: as the file, in metres.  BCF has no field for a place: a line whose ends are one point is a point (BCF 2.1, Lines), and
the description says it in words.  The field of view is the vertical one, as version 3.0 says and programs take it; the schema
of 2.1 allows 45 to 60 degrees, its documentation asks readers to expect any.
"""

import io
import math
import uuid
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import PurePath
from xml.etree.ElementTree import Element, SubElement, tostring

from ...common.file_names import safe_name
from ...common.text import coordinate
from ..viewpoint import Viewpoint
from .annotation import STATUSES, Annotation, is_address, time_of

VERSION = "2.1"
_TOPIC_TYPE = "Note"
_DATE = (1980, 1, 1, 0, 0, 0)
"""Of the parts of the archive: the first that ZIP can hold, so that the same notes make the same bytes."""
_SPACE = uuid.UUID("0f3ad1b0-7f5e-4d0b-8a51-2f0f6f0b3c55")
"""Namespace of the identifiers of views and documents; drawn at random, once."""


@dataclass(frozen=True)
class Topic:
    """A note with what goes with it.  number: from 0.  view: from where it is seen, None: nowhere known.  snapshot: PNG, the
    picture of that view.  picture: the bytes of the attached file."""

    note: Annotation
    number: int
    view: Viewpoint | None = None
    snapshot: bytes | None = None
    picture: bytes | None = None


def bcf_bytes(topics: Sequence[Topic], *, metres_per_unit: float | None, unit: str, author: str, now: datetime) -> bytes:
    """The file.  metres_per_unit: None: taken as metres.  unit: as a person reads it.  now: for notes that have no time."""
    metres = metres_per_unit or 1.0
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        version = Element("Version", VersionId=VERSION)
        SubElement(version, "DetailedVersion").text = VERSION
        _add(archive, "bcf.version", _xml(version))
        taken: set[str] = set()
        for topic in topics:
            folder = topic.note.identity
            while folder in taken:  # a copy of a note
                folder = _identity(folder, "copy")
            taken.add(folder)
            _add(archive, f"{folder}/markup.bcf", _xml(_markup(topic, folder, unit, author, now)))
            if topic.view is not None:
                _add(archive, f"{folder}/viewpoint.bcfv", _xml(_view(topic, folder, topic.view, metres)))
            if topic.snapshot is not None:
                _add(archive, f"{folder}/snapshot.png", topic.snapshot)
            if topic.picture is not None:
                _add(archive, f"{folder}/{_file_name(topic.note)}", topic.picture)
    return data.getvalue()


def _markup(topic: Topic, guid: str, unit: str, author: str, now: datetime) -> Element:
    """The topic; its elements in the order of the schema."""
    note = topic.note
    root = Element("Markup")
    item = SubElement(root, "Topic", Guid=guid, TopicType=_TOPIC_TYPE, TopicStatus=STATUSES[note.status].bcf)
    if is_address(note.link):
        SubElement(item, "ReferenceLink").text = _text(note.link)
    SubElement(item, "Title").text = _text(note.title(topic.number))
    SubElement(item, "Index").text = str(topic.number)
    SubElement(item, "CreationDate").text = (time_of(note) or now).isoformat().replace("+00:00", "Z")
    SubElement(item, "CreationAuthor").text = _text(author)
    x, y, z = map(coordinate, note.position)
    SubElement(item, "Description").text = _text(f"{note.text}\n\nPlace: x {x}, y {y}, z {z} {unit}".strip())
    if topic.picture is not None:
        document = SubElement(item, "DocumentReference", Guid=_identity(guid, "picture"), isExternal="false")
        SubElement(document, "ReferencedDocument").text = _file_name(note)
        SubElement(document, "Description").text = "Attached picture"
    if topic.view is not None:
        views = SubElement(root, "Viewpoints", Guid=_identity(guid, "view"))
        SubElement(views, "Viewpoint").text = "viewpoint.bcfv"
        if topic.snapshot is not None:
            SubElement(views, "Snapshot").text = "snapshot.png"
    return root


def _view(topic: Topic, guid: str, view: Viewpoint, metres: float) -> Element:
    root = Element("VisualizationInfo", Guid=_identity(guid, "view"))
    camera = SubElement(root, "PerspectiveCamera" if view.orthographic is None else "OrthogonalCamera")
    columns = list(zip(*view.camera_to_world))  # right, up, backward, position
    _vector(camera, "CameraViewPoint", [value * metres for value in columns[3][:3]])
    _vector(camera, "CameraDirection", [-value for value in columns[2][:3]])
    _vector(camera, "CameraUpVector", columns[1][:3])
    if view.orthographic is None:
        SubElement(camera, "FieldOfView").text = repr(float(view.vertical_fov))
    else:  # metres from the top edge to the bottom edge
        half = math.tan(math.radians(view.vertical_fov) / 2) * view.orthographic * metres
        SubElement(camera, "ViewToWorldScale").text = repr(2 * half)
    line = SubElement(SubElement(root, "Lines"), "Line")
    place = [value * metres for value in topic.note.position]
    _vector(line, "StartPoint", place)
    _vector(line, "EndPoint", place)
    return root


def _identity(guid: str, part: str) -> str:
    return str(uuid.uuid5(_SPACE, f"{guid} {part}"))


def _file_name(note: Annotation) -> str:
    """Of the attached picture inside the topic's folder, beside the parts that have fixed names."""
    path = PurePath(note.picture)
    return f"picture {safe_name(path.stem, 'attached')}{path.suffix.lower()}"


def _vector(parent: Element, name: str, values: Sequence[float]) -> None:
    item = SubElement(parent, name)
    for axis, value in zip("XYZ", values, strict=True):
        SubElement(item, axis).text = repr(float(value))


def _text(text: str) -> str:
    """A text with what XML 1.0 cannot hold replaced: control characters, and halves of characters."""
    def holds(letter: str) -> bool:
        return letter in "\t\n\r" or " " <= letter < "\ud800" or "\ue000" <= letter < "\ufffe" or letter >= "\U00010000"

    return "".join(letter if holds(letter) else "\ufffd" for letter in text)


def _xml(root: Element) -> bytes:
    return tostring(root, encoding="UTF-8", xml_declaration=True)


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    part = zipfile.ZipInfo(name, _DATE)
    part.compress_type = zipfile.ZIP_STORED if name.endswith((".png", ".jpg", ".jpeg")) else zipfile.ZIP_DEFLATED
    archive.writestr(part, data)
