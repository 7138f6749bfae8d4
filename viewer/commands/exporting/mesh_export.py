"""Meshes beside the points as GLB, OBJ or PLY, each at its place: ``pointglass export --meshes``, and the tool Meshes.

GLB keeps each mesh as a node of its own name whose matrix leads from the mesh's coordinates to the world: y up, metres where
the unit is known, coordinates those of the scan.  The vertices, which GLB holds as float32, count from the mesh's own middle,
so that no digit is lost far from zero.  OBJ and PLY have the scan's coordinates and unit, with all digits.  Meshes are written
whole.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....model.common.files.atomic_write import passes_through, write_atomic
from ...common.errors import InputError
from ...common.text import printable
from ...picture.edits import Vector
from ...picture.meshes.mesh_layer import MeshLayer, shown_meshes
from ...readers.meshes.mesh_data import MeshData
from ...readers.meshes.mesh_store import mesh_of
from ...work.comparing.compared_model import placed_vertices
from ...work.places.up_axis import upright_axes

if TYPE_CHECKING:
    import trimesh

MESH_ENDINGS = (".glb", ".obj", ".ply")
_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From a world whose z is up to glTF's: x right, y up, z back."""


def check_mesh_out(out: Path) -> None:
    """Raises InputError where meshes cannot be written there."""
    if out.suffix.lower() not in MESH_ENDINGS:
        raise InputError(f"meshes are written as {', '.join(MESH_ENDINGS)}", option="--out", value=out,
                         remedy="choose such a name")
    if out.is_dir() or passes_through(out):
        raise InputError("is not a file that can be replaced", option="--out", value=out, remedy="choose another name")
    if not out.parent.is_dir():
        raise InputError("its folder does not exist", option="--out", value=out, remedy=f"make {out.parent} first")


def export_meshes(meshes: Sequence[MeshLayer], out: Path, metres_per_unit: float | None, up: Vector) -> tuple[int, list[str]]:
    """Writes the meshes that are shown.  metres_per_unit: of the scan.  up: direction in its coordinates.

    Returns how many triangles were written, and what the file cannot hold, in words.  Raises InputError where none is shown, a
    file cannot be read, or ``out`` is a mesh that is read; then nothing is left behind.
    """
    check_mesh_out(out)
    layers = shown_meshes(tuple(meshes))
    if not layers:
        raise InputError("no mesh is beside the scan, or none is shown", option="--meshes",
                         remedy="give a mesh after the scan, or show one in the project")
    for layer in layers:
        if out.exists() and Path(layer.path).exists() and out.samefile(layer.path):
            raise InputError("is a mesh that is read", option="--out", value=out, remedy="choose another name")
    read = [(layer, mesh_of(layer.path)) for layer in layers]
    lost = []
    if out.suffix.lower() == ".glb":
        lost += [] if metres_per_unit else ["the unit of length is not known and is taken for metres"]
        data = _glb(read, metres_per_unit or 1.0, up)
    else:
        lost += [f"the pictures on {printable(layer.name)} (GLB has them)" for layer, mesh in read
                 if len(mesh.textures.levels) and layer.colour is None]
        data = _obj(read) if out.suffix.lower() == ".obj" else _ply(read)
    try:
        write_atomic(out, lambda path: path.write_bytes(data))
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=out,
                         remedy="make room, or choose another --out") from None
    return sum(len(mesh.faces) for _, mesh in read), lost


def _glb(read: list[tuple[MeshLayer, MeshData]], metres: float, up: Vector) -> bytes:
    import trimesh

    scene, world = trimesh.Scene(), np.eye(4)
    world[:3, :3] = metres * _UP @ upright_axes(up).T
    taken: set[str] = set()
    for layer, mesh in read:
        middle = np.eye(4)
        middle[:3, 3] = np.round((mesh.bounds[0] + mesh.bounds[1]) / 2)
        for part in _parts(layer, mesh, middle[:3, 3]):
            name, number = Path(layer.name).stem, 2
            while name in taken:
                name, number = f"{Path(layer.name).stem} {number}", number + 1
            taken.add(name)
            scene.add_geometry(part, node_name=name, geom_name=name, transform=world @ layer.matrix @ middle)
    made: Any = scene.export(file_type="glb")
    return bytes(made)


def _parts(layer: MeshLayer, mesh: MeshData, middle: np.ndarray) -> "list[trimesh.Trimesh]":
    """The triangles without a picture, and those of each picture.  middle: (3,) from which vertices count."""
    import trimesh
    from PIL import Image
    from trimesh.visual import ColorVisuals, TextureVisuals
    from trimesh.visual.material import PBRMaterial

    alpha, pictures, found = round(255 * layer.opacity), mesh.textures, []
    mode = "BLEND" if alpha < 255 else "OPAQUE"
    of_face = pictures.of_face if len(pictures.levels) and layer.colour is None else np.full(len(mesh.faces), -1)
    for number in np.unique(of_face).tolist():
        used, faces = np.unique(mesh.faces[of_face == number], return_inverse=True)
        if number >= 0:
            first, width, height = pictures.levels[number, 0].tolist()
            image = Image.fromarray(pictures.texels[first : first + width * height].reshape(height, width, 3))
            material = PBRMaterial(baseColorTexture=image, baseColorFactor=[255, 255, 255, alpha], alphaMode=mode,
                                   metallicFactor=0.0)
            visual: Any = TextureVisuals(uv=pictures.uv[used], material=material)
        elif layer.colour is not None:
            visual = TextureVisuals(material=PBRMaterial(baseColorFactor=[*layer.colour, alpha], alphaMode=mode,
                                                         metallicFactor=0.0))
        else:
            colours = np.column_stack([mesh.rgb[used], np.full(len(used), alpha, np.uint8)])
            visual = ColorVisuals(vertex_colors=colours)
        found.append(trimesh.Trimesh(mesh.vertices[used] - middle, faces.reshape(-1, 3), visual=visual, process=False))
    return found


def _colours(layer: MeshLayer, mesh: MeshData) -> np.ndarray:
    """(V, 3) uint8."""
    return mesh.rgb if layer.colour is None else np.broadcast_to(np.array(layer.colour, np.uint8), mesh.rgb.shape)


def _obj(read: list[tuple[MeshLayer, MeshData]]) -> bytes:
    lines, start = ["# pointglass"], 1
    for layer, mesh in read:
        lines.append(f"o {printable(layer.name)}")
        for place, colour in zip(placed_vertices(layer, mesh).tolist(), (_colours(layer, mesh) / 255).tolist(), strict=True):
            lines.append("v {:.15g} {:.15g} {:.15g} {:.4g} {:.4g} {:.4g}".format(*place, *colour))
        lines += ["f {} {} {}".format(*face) for face in (mesh.faces + start).tolist()]
        start += len(mesh.vertices)
    return ("\n".join(lines) + "\n").encode()


def _ply(read: list[tuple[MeshLayer, MeshData]]) -> bytes:
    vertices = np.concatenate([placed_vertices(*each) for each in read])
    starts = np.cumsum([0, *(len(mesh.vertices) for _, mesh in read)])
    rows = np.zeros(len(vertices), [("xyz", "<f8", 3), ("rgb", "u1", 3)])
    rows["xyz"], rows["rgb"] = vertices, np.concatenate([_colours(*each) for each in read])
    faces = np.concatenate([mesh.faces + start for (_, mesh), start in zip(read, starts, strict=False)])
    table = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    table["count"], table["corners"] = 3, faces
    head = ["ply", "format binary_little_endian 1.0", "comment pointglass", f"element vertex {len(rows)}",
            *(f"property double {axis}" for axis in "xyz"), *(f"property uchar {name}" for name in ("red", "green", "blue")),
            f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(head) + "\n").encode() + rows.tobytes() + table.tobytes()
