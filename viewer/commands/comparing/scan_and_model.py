"""``pointglass compare SCAN MODEL``: distances of a scan's points from a mesh."""

import math
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.rigid_transform import IDENTITY
from ...picture.meshes.mesh_layer import MeshLayer
from ...preprocess.scan_description import ScanDescription
from ...readers.meshes.mesh_formats import is_mesh
from ...readers.meshes.mesh_store import mesh_of
from ...work.comparing.compare import Distances
from ...work.comparing.compared_model import placed_vertices
from ...work.comparing.model_distances import distances_from_model, within
from ...work.meshes.laid_meshes import assumed, new_layer
from ...work.project import read_project
from ...work.registration.moved_files import unsure_of
from .read_cloud import Cloud


def model_among(before: Path, after: Path) -> tuple[Path, Path] | None:
    """The scan and the model, in either order; None where both are scans.  Raises InputError where both are models."""
    models = [is_mesh(path) for path in (before, after)]
    if all(models) and any(path.suffix.lower() != ".ply" for path in (before, after)):
        raise InputError("is a mesh, as is the other file: a scan is compared with a model", file=after)
    if sum(models) != 1:
        return None
    return (after, before) if models[0] else (before, after)


def layer_of(path: Path, meta: ScanDescription, project: Path | None, told: Callable[[str], object]) -> MeshLayer:
    """The model beside a scan.  meta: of the scan.  project: where it may have been moved.  told: is told what is assumed.
    Raises InputError."""
    layer = new_layer(path, meta.metres_per_unit)
    known = () if project is None else read_project(project).meshes
    if laid := [one for one in known if Path(one.path).resolve() == path.resolve()]:
        return laid[0]
    told(f"{path.name}: {assumed(layer, mesh_of(layer.path))}")
    return layer


def registration_in(project: Path | None, before: Path, after: Path, told: Callable[[str], object]) -> float:
    """Uncertainty (95 %) of how two scans, or a scan and a model, lie to each other, as Align left it in a project; told: is
    told where the project moved one and has no uncertainty of that.  Raises InputError."""
    return 0.0 if project is None else unsure_in(project, [[str(before)], [str(after)]], told)


def unsure_in(project: Path, pair: Iterable[Sequence[str]], told: Callable[[str], object]) -> float:
    """As registration_in, of two scans or meshes of one or several files each, or folders."""
    document = read_project(project)
    laid = {os.path.realpath(layer.path): layer.unsure for layer in document.meshes if layer.transform != IDENTITY}
    known = [[laid[at] if (at := os.path.realpath(path)) in laid else unsure_of(document.scans, Path(path)) for path in paths]
             for paths in pair]
    if any(None in each for each in known):
        told(f"{project.name} does not say how certain the places of its scans are; --registration adds it to each uncertainty")
    return math.hypot(*(max((unsure or 0.0 for unsure in each), default=0.0) for each in known))


def read_model(path: Path, layer: MeshLayer, meta: ScanDescription) -> Cloud:
    """The model as a cloud of its corners, in the scan's coordinates.  path: as it was named.  meta: of the scan.  Raises
    InputError."""
    vertices = placed_vertices(layer, mesh_of(layer.path))
    return Cloud(path, [], vertices, np.zeros(len(vertices), np.uint16), np.zeros((0, 3)), 0, meta)


def compared_with_model(model: Cloud, layer: MeshLayer, scan: Cloud, registration: float, depth: float | None,
                        limit: float | None) -> Distances:  # fmt: skip
    """Distances of the scan's points.  depth, limit: as for viewer.work.comparing.model_distances.within.  Raises InputError;
    Cancelled."""
    if len(scan.xyz) < 100:
        raise InputError(f"has {len(scan.xyz):,} points, at least 100 are compared", file=scan.path)
    found = distances_from_model(model.xyz, mesh_of(layer.path).faces, scan.xyz, registration=registration)
    return within(found, depth, limit)
