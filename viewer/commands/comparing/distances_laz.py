"""``distances.laz``: the points of the scan after, with the distance and the uncertainty of each as extra dimensions.

LAS 1.4, point format 7: colours show the distances; intensity and class are the file's.  The station is an extra dimension, not
the point source id, by which pointglass would tell stations apart and give them the same brightness.  Frame and units: the
file's.
"""

from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.progress import progress
from ...readers.moved_source import unmoved
from ...work.comparing.compare import Distances
from ...work.comparing.distance_statistics import colours_of
from ..exporting.crs_records import reference_of
from ..exporting.formats.las_layout import PROJECTION
from ..exporting.losses import Losses
from ..exporting.output_file import output_file
from .read_cloud import Cloud, finite_chunks

NAME = "distances.laz"
_STEPS_PER_SPACING = 100.0
"""Coordinates are rounded to a power of ten below this part of the point spacing."""
_REACH = 2.0**31 - 8
"""Largest whole number of a LAS coordinate, with room for rounding."""


def write_laz(path: Path, cloud: Cloud, distances: Distances, limit: float) -> None:
    """limit: at which the colours end, file units.  Raises InputError where a file has changed since it was read."""
    import laspy

    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = coordinate_steps(cloud.xyz, distances.after.spacing)
    header.generating_software = "pointglass"
    for number, data in reference_of(cloud.meta, [unmoved(source)[0] for source in cloud.sources], Losses()).las_records:
        header.vlrs.append(laspy.VLR(PROJECTION, number, record_data=data))
        header.global_encoding.wkt |= number == 2112
    header.add_extra_dim(laspy.ExtraBytesParams("distance", "f4", description="along the normal, file units"))
    header.add_extra_dim(laspy.ExtraBytesParams("uncertainty", "f4", description="of the distance, 95 %"))
    header.add_extra_dim(laspy.ExtraBytesParams("station", "u2", description="of the scan after, from 0"))
    done = 0
    with output_file(path) as file, laspy.open(file, mode="w", header=header, closefd=False, do_compress=True) as writer, \
            progress(len(cloud.xyz), f"writing {NAME}", "point") as meter:  # fmt: skip
        for chunk, finite, _ in finite_chunks(cloud.sources):
            rows = slice(done, done + int(finite.sum()))
            if rows.stop > len(cloud.xyz) or not np.array_equal(chunk.xyz[finite], cloud.xyz[rows]):
                raise InputError("has changed while it was compared", file=cloud.path, remedy="compare again")
            points = laspy.ScaleAwarePointRecord.zeros(rows.stop - rows.start, header=header)
            steps = np.rint((cloud.xyz[rows] - header.offsets) / header.scales).astype(np.int32)
            points["X"], points["Y"], points["Z"] = steps.T
            colours = colours_of(distances.distance[rows], distances.uncertainty[rows], limit).astype(np.uint16) * 257
            points["red"], points["green"], points["blue"] = colours.T
            if chunk.intensity is not None:
                points["intensity"] = chunk.intensity[finite]
            if chunk.classification is not None:
                points["classification"] = chunk.classification[finite]
            points["station"] = cloud.station[rows]
            points["return_number"] = points["number_of_returns"] = np.ones(len(points), np.uint8)
            points["distance"] = distances.distance[rows].astype(np.float32)
            points["uncertainty"] = distances.uncertainty[rows].astype(np.float32)
            writer.write_points(points)
            done = rows.stop
            meter.update(len(points))
    if done != len(cloud.xyz):
        raise InputError("has changed while it was compared", file=cloud.path, remedy="compare again")


def coordinate_steps(xyz: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """(scales, offsets), (3,) each, of points (n, 3): steps of a hundredth of the spacing or less, where 32 bits reach."""
    offsets = np.floor(xyz.min(axis=0))
    reach = np.maximum((xyz.max(axis=0) - offsets) / _REACH, 1e-12)
    wanted = np.floor(np.log10(max(spacing / _STEPS_PER_SPACING, 1e-9)))
    digits = np.maximum(np.ceil(np.log10(reach)), wanted)
    return np.array([float(f"1e{int(digit)}") for digit in digits]), offsets
