"""Whole records of LAS: every dimension by its name, and the record as its bytes.

Frame: file coordinates.  ``Records.native`` is a structured array of the point format's own layout, so that a copy of it is a
copy of every bit.
"""

import numpy as np

from ..source import Chunk, Records

PLACED = ("X", "Y", "Z", "red", "green", "blue")
"""Dimensions that are in ``Records.xyz`` and ``Records.rgb``."""


def records_of(points, chunk: Chunk, only: str | None = None) -> Records:
    """The records of a chunk.  points: of laspy (ScaleAwarePointRecord).  Scaled extra dimensions are given as float64.
    only: the one dimension that is wanted; the records as they are stored are then left out."""
    with np.errstate(over="ignore", invalid="ignore"):  # laspy scales extra dimensions, by what a damaged file states
        columns = {name: np.array(points[name]) for name in points.point_format.dimension_names
                   if name and name not in PLACED and only in (None, name)}  # fmt: skip
    return Records(chunk.xyz, chunk.rgb, chunk.scan, columns, points.array if only is None else None)
