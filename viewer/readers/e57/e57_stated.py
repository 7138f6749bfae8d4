"""What the header and the XML of an E57 file say without its points: where they lie in the file, and the bounds they state."""

import struct
from pathlib import Path

import numpy as np

from .e57_nodes import child, open_e57, pose_of, value_of
from .e57_packets import PAGE, PAGE_DATA

HEADER = struct.Struct("<8sII4Q")
"""Signature, version (two numbers), length of the file, place and length of the XML, bytes of a page."""
_SIDES = ("xMinimum", "yMinimum", "zMinimum", "xMaximum", "yMaximum", "zMaximum")


def description_at(head: bytes) -> tuple[int, int] | None:
    """First byte of the XML in the file, and the byte behind it, with the checksums of its pages; None where ``head`` is not
    the header of an E57 file."""
    if len(head) < HEADER.size or head[:8] != b"ASTM-E57":
        return None
    *_, place, length, page = HEADER.unpack_from(head)
    if page != PAGE:
        return None
    within = place % PAGE + length
    return place // PAGE * PAGE, (place // PAGE + -(-within // PAGE_DATA)) * PAGE


def stated_bounds(path: Path) -> np.ndarray | None:
    """(2, 3) corners of a box around all points, from the bounds of each scan; None where a scan with points states none, or is
    moved by a pose: the standard has bounds in the scan's own frame, pye57 writes those of the moved points.

    Reads no points.  Raises InputError where the file is damaged."""
    corners = [np.empty((0, 3))]
    with open_e57(path) as file:
        for scan in child(file.root(), "data3D", "Vector") or ():
            points, stated = child(scan, "points", "CompressedVector"), child(scan, "cartesianBounds", "Structure")
            if points is None or points.childCount() == 0:
                continue
            values = [value_of(stated[name]) if stated.isDefined(name) else None for name in _SIDES] if stated else [None]
            if None in values or not np.isfinite(sides := np.array(values, np.float64)).all() or (sides[:3] > sides[3:]).any():
                return None
            placed = pose_of(scan) if scan.isDefined("pose") else None
            if placed is not None and not (np.array_equal(placed[0], np.eye(3)) and not placed[1].any()):
                return None
            corners.append(sides.reshape(2, 3))
    found = np.concatenate(corners)
    return np.stack([found.min(axis=0), found.max(axis=0)]) if len(found) else None
