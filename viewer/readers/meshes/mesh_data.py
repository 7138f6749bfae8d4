"""A mesh in memory: triangles with normals, colours and textures, in the coordinates of its file."""

from dataclasses import dataclass, field

import numpy as np

from ....model.common.process.processors import in_rows
from .normal_loops import corner_normals

_MANY = 1 << 14
"""Faces of a thread at least."""
PLAIN = (200, 200, 205)
"""sRGB of a mesh whose file has no colours."""


@dataclass(frozen=True, eq=False)
class Textures:
    """Pictures on a mesh, each in levels of half the size (mip levels), one after the other.

    of_face: (F,) int16 number of the picture, -1 none.  uv: (V, 2) float32, v upwards.  texels: (N, 3) uint8 sRGB.
    levels: (T, L, 3) int64: first texel, width and height of each level; smaller pictures repeat their last.
    """

    of_face: np.ndarray
    uv: np.ndarray
    texels: np.ndarray
    levels: np.ndarray

    @staticmethod
    def none() -> "Textures":
        """Of a mesh without pictures."""
        return Textures(np.empty(0, np.int16), np.empty((0, 2), np.float32), np.empty((0, 3), np.uint8),
                        np.empty((0, 1, 3), np.int64))


@dataclass(frozen=True, eq=False)
class MeshData:
    """vertices: (V, 3) float64, the file's coordinates.  faces: (F, 3) int32.  normals: (F, 3, 3) float32 at the corners
    of faces.  rgb: (V, 3) uint8 sRGB.  format: of its file.  checksum: as of MeshLayer.
    notes: what was assumed or left out, in words.  elements: names of the parts of a building, and of_element (F,) int32 which
    of them each face is of; empty where the file has none."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    rgb: np.ndarray
    format: str = ""
    checksum: str = ""
    coloured: bool = False
    textures: Textures = field(default_factory=Textures.none)
    notes: tuple[str, ...] = ()
    elements: tuple[str, ...] = ()
    of_element: np.ndarray = field(default_factory=lambda: np.empty(0, np.int32))

    def element(self, face: int) -> str:
        """The name of the part that a face is of; "" where the file has none."""
        return self.elements[int(self.of_element[face])] if len(self.of_element) else ""

    @property
    def nbytes(self) -> int:
        """Bytes of its arrays."""
        return sum(array.nbytes for array in (self.vertices, self.faces, self.normals, self.rgb, self.textures.texels))

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) float64: lowest and highest corner, in the file's coordinates."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])


def mesh_data(vertices: np.ndarray, faces: np.ndarray, rgb: np.ndarray | None = None, **more) -> MeshData:
    """A mesh of (V, 3) vertices and (F, 3) indices with its normals; faces without an area, or with coordinates that are not
    finite, are left out.  rgb: (V, 3) uint8; None: PLAIN.  more: fields of MeshData; textures without of_face being cut.
    Raises ValueError where no face is left, or an index is none of a vertex."""
    vertices = np.ascontiguousarray(vertices, np.float64)
    faces = np.asarray(faces)
    if faces.size and not (int(faces.min()) >= 0 and int(faces.max()) < len(vertices)):
        raise ValueError("a face names a vertex that does not exist")
    faces = np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
    with np.errstate(invalid="ignore", over="ignore"):
        corners = vertices[faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(across, axis=1)
    good: np.ndarray = np.isfinite(length) & (length > 0.0) & np.isfinite(corners).all(axis=(1, 2))
    if not good.any():
        raise ValueError("it holds no triangle")
    textures = more.pop("textures", None) or Textures.none()
    if not good.all():
        faces, across = np.ascontiguousarray(faces[good]), across[good]
        if len(textures.of_face):
            textures = Textures(textures.of_face[good], textures.uv, textures.texels, textures.levels)
        if "of_element" in more:
            more["of_element"] = more["of_element"][good]
        more["notes"] = (*more.get("notes", ()), f"{int((~good).sum()):,} faces without an area are left out")
    finite = np.isfinite(vertices).all(axis=1, keepdims=True)
    if not finite.all():
        vertices = np.where(finite, vertices, vertices[faces[0, 0]])
    colours = np.broadcast_to(np.array(PLAIN, np.uint8), vertices.shape) if rgb is None else rgb
    return MeshData(vertices, faces, smooth_normals(vertices, faces, across), np.ascontiguousarray(colours, np.uint8),
                    coloured=rgb is not None, textures=textures, **more)


def smooth_normals(vertices: np.ndarray, faces: np.ndarray, across: np.ndarray) -> np.ndarray:
    """(F, 3, 3) float32 unit normals at the corners of faces, as viewer.readers.meshes.normal_loops; vertices at one place
    count as one.  across: (F, 3) along each face's normal."""
    order = np.lexsort(vertices.T)
    ordered = vertices[order]
    first = np.ones(len(order), bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    of_vertex = np.empty(len(order), np.int64)
    of_vertex[order] = np.cumsum(first) - 1
    place = of_vertex[faces.ravel()]
    starts = np.concatenate([[0], np.cumsum(np.bincount(place, minlength=int(first.sum())))])
    angle = np.empty(faces.shape)
    for corner in range(3):
        here = vertices[faces[:, corner]]
        one, other = (vertices[faces[:, (corner + step) % 3]] - here for step in (1, 2))
        angle[:, corner] = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
    normals = np.empty((len(faces), 3, 3), np.float32)
    in_rows(len(faces), _MANY, corner_normals, across / np.linalg.norm(across, axis=1, keepdims=True), angle, starts,
            np.argsort(place, kind="stable"), place, normals)
    return normals
