"""Meshes laid beside the scans of a document: new ones with what is assumed about them, and those of a picture found again.

glTF states that y is up and the unit is the metre; it is scaled to the scan's unit where this is known.  OBJ, STL and PLY state
nothing: z is taken for up, and their unit for the scan's.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...picture.meshes.mesh_layer import MeshLayer
from ...readers.meshes.mesh_data import MeshData
from ...readers.meshes.mesh_formats import IN_METRES, MESH_FORMATS
from ...readers.meshes.mesh_store import mesh_of


def new_layer(path: Path, metres_per_unit: float | None) -> MeshLayer:
    """A mesh beside a scan, as its format says or as is assumed.  metres_per_unit: of the scan, None where it is not known.
    Reads the file.  Raises InputError, one line."""
    mesh = mesh_of(str(path))
    name, up = MESH_FORMATS[path.suffix.lower()]
    scale = 1.0 / metres_per_unit if name in IN_METRES and metres_per_unit else 1.0
    return MeshLayer(os.path.abspath(path), mesh.checksum, up=up, scale=scale)


def assumed(layer: MeshLayer, mesh: MeshData) -> str:
    """What a mesh's file states about its axes and unit, or what was assumed, in a sentence."""
    if mesh.format in IN_METRES:
        unit = "metres" if layer.scale == 1.0 else f"metres, {layer.scale:g} units of the scan each"
        up = MESH_FORMATS[Path(layer.path).suffix.lower()][1]
        return f"{mesh.format}: {up} is up, {unit}, as the format states"
    return f"{mesh.format} states neither axes nor unit: z is taken for up, and the scan's unit"


def found_mesh(layer: MeshLayer, folder: Path) -> MeshLayer:
    """The mesh of a project, with the path of the file of its name in the project's folder where it is not at its own."""
    beside = folder / layer.name
    return replace(layer, path=str(beside)) if not os.path.isfile(layer.path) and beside.is_file() else layer


def bounds_of(layer: MeshLayer, mesh: MeshData) -> np.ndarray:
    """(2, 3) float64, the document's coordinates: lowest and highest corner of the box around the mesh's own box."""
    low, high = mesh.bounds
    corners = np.array([[(low, high)[at >> axis & 1][axis] for axis in range(3)] for at in range(8)])
    placed = corners @ layer.matrix[:3, :3].T + layer.matrix[:3, 3]
    return np.stack([placed.min(axis=0), placed.max(axis=0)])


def apart(bounds: np.ndarray, others: np.ndarray) -> float:
    """The distance between two boxes, (2, 3) each; 0 where they meet."""
    gap = np.maximum(bounds[0] - others[1], others[0] - bounds[1])
    return float(np.linalg.norm(np.maximum(gap, 0.0)))


def located(layers: Iterable[MeshLayer], given: Sequence[Path], folders: Iterable[Path], picture: Path
            ) -> tuple[tuple[MeshLayer, ...], list[str]]:
    """The meshes of a picture that has only their names, with their paths, and why it may differ, in words.

    given: mesh files of the command line, which go first.  folders: where they are looked for besides.  Raises InputError where
    one is not found.
    """
    found, told, left, places = [], [], list(given), list(dict.fromkeys(folders))
    for layer in layers:
        files = [path for path in left if path.name == layer.name]
        files = files[:1] or [path for folder in places if (path := folder / layer.name).is_file()]
        if not files:
            raise InputError(f"shows the mesh {layer.name}, which does not lie beside the scan or the picture", file=picture,
                             remedy="give it as well, after the scan")
        if files[0] in left:
            left.remove(files[0])
        checksum = mesh_of(str(files[0])).checksum
        if layer.checksum and checksum != layer.checksum:
            told.append(f"the mesh {layer.name} has changed since")
        found.append(replace(layer, path=os.path.abspath(files[0]), checksum=checksum))
    return tuple(found), told
