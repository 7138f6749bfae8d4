"""Reading mesh files: glTF, OBJ, STL and PLY, by trimesh; IFC by viewer.readers.meshes.ifc_file.

Of files that a mesh names (buffers, materials, pictures) only those in its own folder are read; nothing is fetched or executed.
Everything that is wrong with a file is one line.  Frame: the file's own; the assumed up axis is viewer.readers.meshes.
mesh_formats'.
"""

import hashlib
import io
import logging
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...common.errors import InputError
from ..formats import check_file
from ..own_folder import own_path
from .ifc_file import read_ifc
from .mesh_damage import AGAIN, check_head, words_of
from .mesh_data import MeshData, Textures, mesh_data
from .mesh_formats import MESH_FORMATS
from .mesh_textures import Picture, packed_textures, picture_of

if TYPE_CHECKING:
    import trimesh

LARGEST = 2 << 30
"""Bytes of a mesh file and of each file that it names: a choice; four times 10 million triangles as STL."""
MOST_TRIANGLES = 10_000_000
"""They take 1 GB of memory, and two more while they are read."""
_log = logging.getLogger(__name__)


class _OwnFolder:
    """What trimesh asks for other files: those in the mesh's folder.  Keeps a checksum of all that was read."""

    def __init__(self, path: Path, digest: Any):
        self._folder, self._digest = path.parent, digest

    def get(self, name: str) -> bytes:
        path = own_path(self._folder, name.strip())
        if path.stat().st_size > LARGEST:
            raise InputError(f"more than {LARGEST >> 30} GB are not read", file=path)
        data = path.read_bytes()
        self._digest.update(data)
        return data

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)

    def keys(self) -> list[str]:
        return []

    def namespaced(self, namespace: str) -> "_OwnFolder":
        raise InputError("a mesh within a mesh is not read", file=self._folder / namespace)


def read_mesh(path: Path) -> MeshData:
    """The triangles of a mesh file.  Raises InputError, one line, for everything that is wrong with it."""
    check_file(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_FORMATS:
        raise InputError(f"is no mesh that is read ({', '.join(dict.fromkeys(name for name, _ in MESH_FORMATS.values()))})",
                         file=path)
    if (size := path.stat().st_size) > LARGEST:
        raise InputError(f"{size >> 20:,} MB are more than is read of a mesh ({LARGEST >> 30} GB)", file=path,
                         remedy="export it with fewer triangles")
    try:
        data = path.read_bytes()
        digest = hashlib.sha256(data)
        if suffix == ".ifc":
            return read_ifc(path, digest.hexdigest(), MOST_TRIANGLES)
        check_head(path, data)
        return _read(path, suffix, data, digest)
    except InputError:
        raise
    except RecursionError:
        raise InputError("its parts contain themselves; it is damaged", file=path) from None
    except MemoryError:
        raise InputError("there is not enough memory for its triangles", file=path) from None
    except Exception as error:  # whatever a stranger's file makes trimesh and NumPy raise
        _log.info("%s: %s: %s", path, type(error).__name__, " ".join(str(error).split())[:300])
        raise InputError(f"cannot be read as a mesh ({words_of(error)})", file=path, remedy=AGAIN) from None


def _read(path: Path, suffix: str, data: bytes, digest: Any) -> MeshData:
    import trimesh

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # what it warns of is said here
    scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], resolver=_OwnFolder(path, digest),  # type: ignore[arg-type]
                               process=False, allow_remote=False)
    del data
    nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
    shapes = [(matrix, scene.geometry[name]) for matrix, name in nodes]
    shapes = [(matrix, mesh) for matrix, mesh in shapes if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    count = sum(len(mesh.faces) for _, mesh in shapes)
    if count == 0:
        raise InputError("holds no triangle", file=path, remedy="export its surfaces as triangles")
    if count > MOST_TRIANGLES:
        raise InputError(f"{count:,} triangles are more than are drawn ({MOST_TRIANGLES:,})", file=path,
                         remedy="export it with fewer")
    try:
        return _joined(shapes, MESH_FORMATS[suffix][0], digest.hexdigest())
    except ValueError as error:
        raise InputError(f"cannot be read as a mesh ({error})", file=path, remedy="export it again") from None


def _joined(shapes: "Iterable[tuple[np.ndarray, trimesh.Trimesh]]", name: str, checksum: str) -> MeshData:
    """All parts of a file as one mesh, each at its place."""
    vertices, faces, rgb, uv, of_face, pictures = [], [], [], [], [], list[Picture]()
    start, coloured = 0, False
    for matrix, mesh in shapes:
        places, corners = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        visual: Any = mesh.visual
        kind = getattr(visual, "kind", None)
        colours, coordinates, picture = None, None, None
        if kind == "texture":
            picture, coordinates = picture_of(visual), getattr(visual, "uv", None)
            picture = None if coordinates is None or len(coordinates) != len(places) else picture
            base = visual.material.main_color if picture is None else None
            colours = None if base is None else np.broadcast_to(np.asarray(base)[:3], (len(places), 3))
        elif kind == "face":
            colours = np.repeat(np.asarray(visual.face_colors)[:, :3], 3, axis=0)
            places, corners = places[corners].reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
        elif kind == "vertex":
            colours = np.asarray(visual.vertex_colors)[:, :3]
        coloured |= colours is not None or picture is not None
        with np.errstate(invalid="ignore", over="ignore"):
            vertices.append(places @ np.asarray(matrix)[:3, :3].T + np.asarray(matrix)[:3, 3])
        faces.append(corners + start)
        start += len(places)
        rgb.append(np.full((len(places), 3), 200, np.uint8) if colours is None else np.asarray(colours, np.uint8))
        uv.append(np.zeros((len(places), 2)) if picture is None else np.asarray(coordinates, np.float64)[:, :2])
        number = -1
        if picture is not None:
            if picture not in pictures:
                pictures.append(picture)
            number = pictures.index(picture)
        of_face.append(np.full(len(corners), number, np.int16))
    textures = packed_textures(pictures, np.concatenate(of_face), np.concatenate(uv)) if pictures else Textures.none()
    return mesh_data(np.concatenate(vertices), np.concatenate(faces), np.concatenate(rgb) if coloured else None,
                     format=name, checksum=checksum, textures=textures)
