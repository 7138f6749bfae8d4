"""Which files are meshes.  Imports nothing heavy: help, messages and the command line read it too."""

from collections.abc import Sequence
from pathlib import Path

from ...common.errors import InputError
from ..splats.glb_head import holds_splats

MESH_FORMATS: dict[str, tuple[str, str]] = {
    ".glb": ("glTF", "y"), ".gltf": ("glTF", "y"), ".obj": ("OBJ", "z"), ".stl": ("STL", "z"), ".ply": ("PLY", "z"),
    ".ifc": ("IFC", "z"),
}  # fmt: skip
"""Suffix -> name of the format, and the axis taken for up: glTF states y, and metres; IFC states z, and its unit, from
which it is brought to metres (viewer.readers.meshes.ifc_child); the others state nothing."""
IN_METRES = ("glTF", "IFC")
"""Formats whose unit is the metre."""


def has_faces(path: Path) -> bool:
    """Whether a PLY file holds faces; False where its header cannot be read."""
    from ..ply.ply_header import read_header

    try:
        with path.open("rb") as file:
            return any(element.name == "face" and element.count > 0 for element in read_header(path, file).elements)
    except (InputError, OSError, ValueError):
        return False


def is_mesh(path: Path) -> bool:
    """Whether a path is called as a mesh is; a PLY counts where it holds faces, a GLB where it holds no Gaussian splats."""
    suffix = path.suffix.lower()
    if suffix == ".glb" and holds_splats(path):
        return False
    return suffix in MESH_FORMATS and (suffix != ".ply" or has_faces(path))


def scans_and_meshes(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The paths that are opened as scans, and those that are laid beside them as meshes.

    A PLY with faces is a mesh beside another scan; where only such files are given, their vertices are the scan.
    Raises InputError where there is no scan.
    """
    meshes = [path for path in paths if is_mesh(path)]
    scans = [path for path in paths if path not in meshes]
    if not scans:
        scans = [path for path in meshes if path.suffix.lower() == ".ply"]
        meshes = [path for path in meshes if path not in scans]
    if meshes and not scans:
        raise InputError("is a mesh, which is laid beside a scan", file=meshes[0], remedy="give the scan as well")
    return scans, meshes
