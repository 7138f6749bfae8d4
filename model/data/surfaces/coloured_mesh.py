"""PLY files of coloured vertices, with or without triangles, as a scan of their vertices or of points sampled on the surface.

They are read by plyfile.  (The viewer has its own PLY reader, which checks and streams scans of any size; the files here belong
to known data sets.)
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import INSTALL_LAB, DataError
from ..dataset import FAR, MergedScan

_LISTS = {"face": {"vertex_indices": 3, "vertex_index": 3}}
"""List properties that are expected to be triangles; plyfile memory-maps lists of known length."""


@dataclass(frozen=True, eq=False)
class ColouredMesh:
    """xyz: (V, 3) float64.  rgb: (V, 3) uint8.  triangles: (T, 3) vertex numbers, T = 0 where the file has no faces."""

    path: Path
    xyz: np.ndarray
    rgb: np.ndarray
    triangles: np.ndarray


def check_mesh(path: Path) -> None:
    """Checks the structure of the file without reading vertices.  Raises DataError as :func:`read_mesh`."""
    _read(path)


def read_mesh(path: Path) -> ColouredMesh:
    """Reads the file.  Raises DataError where it is not a complete PLY file of coloured vertices."""
    vertices, faces = _read(path)
    with np.errstate(invalid="ignore"):  # signalling NaN of damaged files
        xyz = np.stack([np.asarray(vertices[axis], np.float64) for axis in "xyz"], 1)
    rgb = np.stack([np.asarray(vertices[name]) for name in ("red", "green", "blue")], 1)
    if rgb.dtype.kind == "f" and rgb.size and rgb.max() <= 1:
        rgb = rgb * 255
    rgb = np.clip(np.nan_to_num(np.rint(rgb)), 0, 255).astype(np.uint8)
    triangles = np.zeros((0, 3), np.int64)
    if faces is not None and len(faces):
        name = next((name for name in _LISTS["face"] if name in (faces.dtype.names or ())), None)
        if name is None or faces[name].ndim != 2:
            raise DataError("not all faces are triangles", file=path, remedy="download it again")
        triangles = np.asarray(faces[name], np.int64)
    return ColouredMesh(path, xyz, rgb, triangles)


def _read(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Rows of vertices and faces, memory-mapped where possible."""
    try:
        from plyfile import PlyData, PlyParseError
    except ImportError:
        raise DataError(f"plyfile, which reads meshes, is not installed; `{INSTALL_LAB}`", file=path) from None
    try:
        data = PlyData.read(str(path), mmap="r", known_list_len=_LISTS)
    except (PlyParseError, UnicodeDecodeError) as error:
        torn = "end-of-file" in str(error) or "early" in str(error)
        raise DataError(f"{'truncated' if torn else 'not a PLY file'} ({error})", file=path,
                        remedy="download it again") from None
    except ValueError as error:  # NumPy's, for a file shorter than its header declares
        raise DataError(f"truncated ({error})", file=path, remedy="download it again") from None
    names = [element.name for element in data.elements]
    if "vertex" not in names or not len(data["vertex"].data):
        raise DataError("has no vertices", file=path, remedy="download it again")
    vertices = data["vertex"].data
    if missing := [name for name in ("x", "y", "z", "red", "green", "blue") if name not in (vertices.dtype.names or ())]:
        raise DataError(f"its vertices have no {', '.join(missing)}", file=path)
    return vertices, data["face"].data if "face" in names else None


def points_scan(mesh: ColouredMesh, hidden: Path) -> MergedScan:
    """All vertices except invalid positions and those whose indices the file ``hidden`` lists, if it exists."""
    keep = np.asarray((np.abs(mesh.xyz) < FAR).all(axis=1))
    if hidden.is_file():
        try:
            keep[np.array(hidden.read_text().split(), np.int64)] = False
        except (ValueError, IndexError) as error:
            raise DataError(f"not a list of point indices ({error})", file=hidden, remedy="download it again") from None
    return MergedScan(mesh.xyz[keep], mesh.rgb[keep], np.zeros(int(keep.sum()), np.uint8))


def scattered_scan(mesh: ColouredMesh, count: int) -> MergedScan:
    """``count`` points sampled uniformly on the triangles, with a fixed seed and interpolated colours."""
    corners = mesh.triangles
    if not len(corners):
        raise DataError("has no triangles to sample points on", file=mesh.path)
    if corners.min() < 0 or corners.max() >= len(mesh.xyz):
        raise DataError("a face refers to a vertex that does not exist", file=mesh.path, remedy="download it again")
    a, b, c = (mesh.xyz[corners[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rng = np.random.default_rng(0)
    pick = rng.choice(len(area), count, p=area / area.sum())
    s, t = rng.random((2, count, 1))
    s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
    weights = (1 - s - t, s, t)
    xyz, rgb = (sum(values[corners[pick, k]] * weight for k, weight in enumerate(weights)) for values in (mesh.xyz, mesh.rgb))
    return MergedScan(np.asarray(xyz), np.rint(rgb).astype(np.uint8), np.zeros(count, np.uint8))
