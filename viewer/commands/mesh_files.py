"""Meshes named on the command line, beside the scans."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..picture.meshes.mesh_layer import MeshLayer
from ..readers.meshes.mesh_store import mesh_of
from ..work.meshes.laid_meshes import assumed, located, new_layer

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..picture.spec import PictureSpec
    from ..work.pictures.shot_metadata import Shot


def layers_of(meshes: Sequence[Path], scene: "Scene") -> tuple[MeshLayer, ...]:
    """The meshes beside a scene; says on standard error how many triangles each has and what was assumed.  Raises InputError
    where one cannot be read."""
    layers = []
    for path in meshes:
        layer = new_layer(path, scene.meta.metres_per_unit)
        mesh = mesh_of(layer.path)
        print(f"pointglass: {path}: {len(mesh.faces):,} triangles. {assumed(layer, mesh)}", file=sys.stderr)
        layers.append(replace(layer, checksum=mesh.checksum))
    return tuple(layers)


def beside(specs: "Sequence[PictureSpec]", meshes: Sequence[Path], scene: "Scene") -> "list[PictureSpec]":
    """The descriptions with meshes beside the points.  Raises as :func:`layers_of`."""
    layers = layers_of(meshes, scene)
    return [replace(spec, edits=replace(spec.edits, meshes=layers)) for spec in specs]


def with_meshes(shot: "Shot", meshes: Sequence[Path], scans: Sequence[Path], picture: Path) -> "Shot":
    """The picture with the paths of its meshes, for ``render --like``.  Raises InputError where one is not found."""
    folders = (*(scan.absolute().parent for scan in scans), picture.absolute().parent)
    spec = shot.spec
    layers, told = located(spec.edits.meshes, meshes, folders, picture)
    for line in told:
        print(f"pointglass: {picture}: {line}; the picture may differ", file=sys.stderr)
    others = spec.other_edits
    if others is not None:
        others = replace(others, meshes=located(others.meshes, meshes, folders, picture)[0])
    return replace(shot, spec=replace(spec, edits=replace(spec.edits, meshes=layers), other_edits=others))
