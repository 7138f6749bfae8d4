"""Shared by the readers of E57 points and photographs: opening a file with one-line errors, numbers and poses of its tree."""

import os
import struct
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import InputError
from ...common.text import whole_number
from .e57_length import readable
from .e57_packets import PAGE, PAGE_DATA, bits_of, most_points


def library() -> Any:
    """The compiled module libe57 of pye57, which has no type declarations."""
    import pye57

    return getattr(pye57, "libe57")  # noqa: B009  (not declared by the package)


def first_line(error: Exception) -> str:
    """The first line of an error of the library, cut for a message.

    An error whose text quotes damaged bytes may come without any text: with other bindings loaded (seen once in a whole run of
    the tests), else as UnicodeDecodeError.
    """
    return (str(error).strip().splitlines() or ["damaged: its content is not readable"])[0][:160]


@contextmanager
def open_e57(path: Path) -> Iterator[Any]:
    """Opens a file with libe57 and closes it at the end.  Raises InputError where the library refuses it, now or during
    reading."""
    libe57 = library()
    file = None
    try:
        file = libe57.ImageFile(os.fsencode(readable(path)), "r")  # a file name may not be valid text
        yield file
    except libe57.E57Exception as error:
        text = first_line(error)
        if "ErrorBadFileLength" in text:
            text = f"truncated or damaged: its header states another length than its {path.stat().st_size:,} bytes"
        raise InputError(text, file=path, remedy="copy or export it again") from None
    except UnicodeDecodeError:  # from the binding, for an error text that quotes damaged bytes
        raise InputError("damaged: the packing of its points is not readable", file=path,
                         remedy="copy or export it again") from None
    except RuntimeError as error:
        raise InputError(f"cannot be read as E57: {first_line(error)}", file=path, remedy="copy or export it again") from None
    finally:
        if file is not None and file.isOpen():
            file.close()


def xml_of(path: Path) -> ElementTree.Element:
    """The root of the XML that describes the file.  Raises InputError where Python's parser refuses what libe57 could read:
    what the XML states (fields, numbers of points) could not be checked before the library relies on it.

    path: a file that open_e57 opened, so that the place of its XML has been checked.
    """
    with path.open("rb") as file:
        place, length = struct.unpack("<2Q", file.read(40)[24:])
        file.seek(place // PAGE * PAGE)
        pages = [file.read(PAGE)[:PAGE_DATA] for _ in range((place % PAGE + length) // PAGE_DATA + 1)]
    try:
        return ElementTree.fromstring(b"".join(pages)[place % PAGE :][:length])
    except ElementTree.ParseError as error:
        raise InputError(f"damaged: its description is not well-formed XML ({error})", file=path,
                         remedy="copy or export it again") from None


def point_vectors(root: ElementTree.Element, counts: list[int]) -> list[ElementTree.Element | None] | None:
    """The ``points`` elements of the scans, None for one without points; None where the XML has other scans than libe57.

    root: of the file's XML.  counts: points of each scan.
    """
    nodes = root.findall("{*}data3D/*")
    if len(nodes) != len(counts):
        return None
    found = [node.find("{*}points") if count else None for node, count in zip(nodes, counts, strict=True)]
    return None if any(vector is None and count for vector, count in zip(found, counts, strict=True)) else found


def check_prototypes(path: Path, root: ElementTree.Element) -> None:
    """Raises InputError where points have no prototype, which declares their fields: libe57 would end the process over that;
    and where more points are stated than the file can hold.

    root: of the file's XML.
    """
    size = path.stat().st_size
    for node in root.iter():
        if node.get("type") != "CompressedVector":
            continue
        prototype = node.find("{*}prototype")
        if prototype is None:
            raise InputError("damaged: points without a prototype, so without fields", file=path,
                             remedy="copy or export it again")
        stated = node.get("recordCount", "0").strip()
        if stated.startswith("-"):
            raise InputError(f"damaged: {stated[:20]} points", file=path, remedy="copy or export it again")
        count = whole_number(stated)
        if count is not None and count > most_points(size, sum(map(bits_of, prototype))):
            raise InputError(f"truncated or damaged: {count:,} points do not fit into its {size:,} bytes", file=path,
                             remedy="copy or export it again")


def child(node, name: str, kind: str) -> Any:
    """The child of ``node`` under a name; None where there is none of this ``kind`` (String, Structure, ...)."""
    found = node[name] if node.isDefined(name) else None
    return found if isinstance(found, getattr(library(), f"{kind}Node")) else None


def text_of(node, name: str) -> str:
    """The text of a child String under a name, "" where there is none."""
    found = child(node, name, "String")
    return found.value() if found is not None else ""


def is_number(node) -> bool:
    """Whether a node is an integer, float or scaled integer."""
    libe57 = library()
    return isinstance(node, (libe57.IntegerNode, libe57.FloatNode, libe57.ScaledIntegerNode))


def value_of(node) -> float | None:
    """The value of an integer, float or scaled-integer node; None for other nodes."""
    if not is_number(node):
        return None
    return float(node.scaledValue() if hasattr(node, "scaledValue") else node.value())


def pose_of(node) -> tuple[np.ndarray, np.ndarray] | None:
    """Rotation (3, 3) and translation (3,) from a scan or an image to the file's frame; None where it has no usable pose."""
    pose = child(node, "pose", "Structure")
    if pose is None:
        return None
    quaternion = _vector(pose, "rotation", "wxyz", (1.0, 0.0, 0.0, 0.0))
    translation = _vector(pose, "translation", "xyz", (0.0, 0.0, 0.0))
    largest = np.abs(quaternion).max()  # not the norm, whose squares may overflow
    if not (np.isfinite(translation).all() and np.isfinite(largest) and largest > 1e-6):
        return None
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(quaternion / largest, -1)).as_matrix(), translation  # x, y, z, w


def _vector(parent, name: str, parts: str, otherwise) -> np.ndarray:
    if not parent.isDefined(name):
        return np.array(otherwise)
    node = child(parent, name, "Structure")
    if node is None:
        return np.full(len(parts), np.nan)
    return np.array([value_of(node[part]) if node.isDefined(part) else 0.0 for part in parts], np.float64)
