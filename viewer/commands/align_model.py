"""``pointglass align MODEL SCAN``: brings a mesh to its place beside a scan, and writes a project with both; and what
aligning a scan needs of this, too."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..common.progress import progress
from ..common.rigid_transform import combined, motion_text
from ..common.text import counted, number_text
from ..readers.meshes.mesh_formats import is_mesh
from ..readers.meshes.mesh_store import mesh_of
from ..work.comparing.compared_model import placed_vertices
from ..work.document import Document, ScanFile
from ..work.meshes.laid_meshes import assumed, new_layer
from ..work.project import write_project
from ..work.registration.align_mesh import align_mesh, mesh_words
from ..work.registration.point_pairs import PairFit, fit_pairs

if TYPE_CHECKING:
    from ..readers.source import Source


MOST = 4_000_000
"""Points of a scan whose surfaces are compared, every so many of all: 60 for each voxel of viewer.work.registration."""


def model_moves(moving: Path, fixed: Path) -> bool:
    """Whether a mesh is to be moved.  Two PLY files with faces are two scans.  Raises InputError where FIXED is the mesh."""
    models = [is_mesh(path) for path in (moving, fixed)]
    if models[1] and fixed.suffix.lower() != ".ply":
        raise InputError("is a mesh; it is moved to a scan", file=fixed, remedy="give the mesh first, then the scan")
    return models[0] and not (models[1] and moving.suffix.lower() == ".ply")


def align_model(path: Path, fixed: "Source", pairs: tuple[np.ndarray, np.ndarray] | None, out: Path | None, *,
                surfaces: bool) -> int:  # fmt: skip
    """Aligns, prints what was found, and writes a project.  pairs: places in the mesh's file, and in the scan.  surfaces:
    whether they are compared.  Returns the exit code.  Raises InputError as fit_pairs and align_mesh do."""
    layer = new_layer(path, fixed.metres_per_unit)
    mesh, unit = mesh_of(layer.path), unit_text(fixed)
    print(f"pointglass: {path}: {len(mesh.faces):,} triangles. {assumed(layer, mesh)}", file=sys.stderr)
    rows = []
    if pairs is not None:
        matrix = layer.matrix
        found = fit_pairs(pairs[0] @ matrix[:3, :3].T + matrix[:3, 3], pairs[1])
        layer = replace(layer, transform=found.transform)
        rows = [("pairs", pairs_text(found, unit))]
    if surfaces:
        made = align_mesh(placed_vertices(layer, mesh), mesh.faces, spread_points(fixed))
        layer = replace(layer, transform=combined(made.transform, layer.transform), unsure=made.surfaces.uncertainty)
        lines = mesh_words(made, unit.strip()).splitlines()
        rows += [("surfaces" if number == 0 else "", line) for number, line in enumerate(lines)]
    motion = motion_text(layer.transform, placed_vertices(layer, mesh).mean(axis=0))
    rows = [("moved", f"{path.name} to its place beside {fixed.path.name}: {motion}"), *rows]
    rows += [("matrix" if number == 0 else "", " ".join(map(number_text, row)))
             for number, row in enumerate(layer.matrix.tolist())]
    print("\n".join(f"{name:<8} {text}" for name, text in rows))
    if out is not None:
        write_project(out, Document((ScanFile(str(fixed.path)),), meshes=(layer,)))
        print(f"project  {out}")
    return 0


def spread_points(source: "Source") -> np.ndarray:
    """(n, 3) points spread over a scan, at most about MOST."""
    step = max(1, (source.count or 0) // MOST)
    parts, at = [np.zeros((0, 3))], 0
    with progress(source.count or 0, f"reading {source.path.name}", "point") as meter:
        for chunk in source.chunks():
            parts.append(chunk.xyz[-at % step :: step])
            at += len(chunk.xyz)
            meter.update(len(chunk.xyz))
    return np.concatenate(parts)


def pairs_text(pairs: PairFit, unit: str) -> str:
    """Residuals of pairs, in a line.  unit: with a space before it."""
    return (f"{counted(len(pairs.residuals), 'pair')}, rms {pairs.rms:.4g}{unit}, residuals "
            f"{', '.join(f'{value:.4g}' for value in pairs.residuals)}")


def unit_text(source: "Source") -> str:
    """The unit of a scan with a space before it; "" where it is not known."""
    return {"metre": " m", "foot": " ft", "unknown": ""}.get(source.units, f" {source.units}")
