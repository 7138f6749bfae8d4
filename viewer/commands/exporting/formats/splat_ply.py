"""Splats as binary PLY, in the columns that gaussian-splat viewers read (Kerbl et al. 2023), and
how many measured points each stands for as an element ``provenance`` after them: readers that expect just the usual columns
still read the file.

Frame of the file: x right, y down, z forward, as the usual viewers expect of PLY, metres where the unit is known.  Comments say
how to come back to the scan's coordinates: ``comment pointglass splats``, ``comment frame`` with twelve numbers, the rows of a
matrix (3, 4) from the file's coordinates to the scan's.
"""

from pathlib import Path

import numpy as np

from ....work.splats.splat_cloud import Splats

MARK = "pointglass splats"
FRAME = "frame "
"""Begins the comment with the matrix."""
UNIT = "metres_per_unit"
"""Begins the comment with the metres in a unit of the scan's coordinates; ``wkt`` that with its reference system."""
_FIRST = ("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2")
_REST = tuple(f"f_rest_{number}" for number in range(9))
"""Of degree 1, where splats have it: the three coefficients of red, of green, of blue."""
_LAST = ("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3")
_BLOCK = 1 << 18
"""Splats written at a time: 19 MB."""


def write_splat_ply(path: Path, splats: Splats, to_scan: np.ndarray, about: list[str], advance) -> None:
    """Writes a file.  splats: in the file's frame.  to_scan: (3, 4) from the file's coordinates to the scan's.  about: further
    comments.  advance: called with the number of splats that were written."""
    numbers = " ".join(repr(float(value)) for value in np.asarray(to_scan).ravel())
    texts = [MARK, FRAME + numbers, *(text.encode("ascii", "replace").decode().replace("\n", " ") for text in about)]
    head = "".join(f"comment {text}\n" for text in texts)
    names = (*_FIRST, *(_REST if splats.degree else ()), *_LAST)
    fields = "".join(f"property float {name}\n" for name in names)
    kinds = np.dtype([(name, "<f4") for name in names])
    with path.open("wb") as file:
        file.write(f"ply\nformat binary_little_endian 1.0\n{head}element vertex {len(splats)}\n{fields}"
                   f"element provenance {len(splats)}\nproperty uint points\nend_header\n".encode())
        for start in range(0, len(splats), _BLOCK):
            some = slice(start, start + _BLOCK)
            rows = np.zeros(len(splats.xyz[some]), kinds)
            opacity = splats.opacity[some].astype(np.float64)
            given = np.concatenate([
                splats.xyz[some], splats.normals(some), splats.sh0[some],
                *([splats.sh1(some).transpose(0, 2, 1).reshape(-1, 9)] if splats.degree else []),
                np.log(opacity / (1 - opacity))[:, None], np.log(splats.scale[some]), splats.rotation[some],
            ], axis=1)  # fmt: skip
            for column, name in enumerate(names):
                rows[name] = given[:, column]
            rows.tofile(file)
            advance(len(rows))
        splats.points.astype("<u4").tofile(file)
