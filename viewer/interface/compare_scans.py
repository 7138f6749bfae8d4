"""What changed between two scans, from Python."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError
from ..preprocess.scan_description import NO_DESCRIPTION, ScanDescription
from .arguments import path_of, python_names

if TYPE_CHECKING:
    from ..picture.meshes.mesh_layer import MeshLayer
    from ..work.comparing.compare import Distances
    from .open_scan import Scan

_log = logging.getLogger(__name__)


def compare(
    before: Scan | npt.ArrayLike | str | PathLike[str],
    after: Scan | npt.ArrayLike,
    *,
    method: Literal["m3c2", "c2c"] | None = None,
    registration: float | None = None,
    depth: float | None = None,
    project: str | PathLike[str] | None = None,
) -> Distances:
    """How far the points of ``after`` lie from the surfaces of ``before``, and how uncertain each distance is.

    before, after: open scans, or (N, 3) and (M, 3) coordinates; both in one frame and unit.  before may be the path of a mesh
        (glTF, OBJ, STL, IFC, PLY with faces), as ``pointglass compare`` takes it: each point's distance from its nearest
        triangle, positive outside.  It stands where ``project`` has it, or it was added to ``after`` (``Scan.add_mesh``), else
        as its file says.
    method: "m3c2" (the usual), the difference between the means of both scans in a cylinder along the local normal (Lague,
        Brodu and Leroux 2013): neighbouring points share a distance, whose uncertainty is a fraction of the noise; or "c2c",
        each point to the local plane of ``before``: every point has its own distance, with its noise.  None with a mesh.
    registration: uncertainty (95 %) of how both lie to each other, in their unit; it is added to that of each distance.
        None: what Align found, where ``project`` has it, else 0, as of two scans that lie to each other exactly.
    depth: how far from each point ``before`` is looked for; None: by spacing and noise.  ``math.inf`` gives every point its
        distance from a mesh.

    project: a project file (.pointglass) that the window has saved or ``pointglass align`` has written: open scans, and a
        mesh, are compared where it has moved them, as ``pointglass compare --project`` does.  None: where their files have
        them.  Where it does not say how certain a place is, ``logging`` gets a warning.

    Returns ``distance`` and ``uncertainty`` (half the 95 % interval), (M,) float64 in the unit of the coordinates, one for each
    point of ``after``: of a scan in the order of ``after.points``.  Both are NaN where ``before`` has no surface, and for
    points that are not finite.  Positive is towards the scanner where positions are known, else up, and at walls away from the
    middle of ``before``.

    Raises InputError where units or reference systems differ, or there are too few points.

    >>> import numpy as np, pointglass
    >>> rng = np.random.default_rng(1)
    >>> floor, later = (np.c_[rng.uniform(0, 1, (40_000, 2)), rng.normal(0, 0.002, 40_000)] for _ in range(2))
    >>> later[later[:, 0] > 0.5, 2] += 0.002
    >>> found = pointglass.compare(floor, later)
    >>> float(np.median(found.distance[later[:, 0] > 0.55]).round(3)), float(np.median(found.uncertainty).round(3))
    (0.002, 0.001)
    """
    from ..commands.comparing.read_cloud import check_together
    from ..readers.meshes.mesh_formats import is_mesh
    from ..work.comparing.compare import METHODS
    from ..work.comparing.compare import compare as distances_of
    from ..work.comparing.facing import facing_of

    with python_names():
        if isinstance(before, (str, PathLike)) and is_mesh(path_of(before)):
            return _from_mesh(path_of(before), after, method, registration, depth, project)
        method = method or "m3c2"
        if method not in METHODS:
            raise InputError(f"expected one of {', '.join(METHODS)}", option="method", value=method)
        _check_lengths(registration, depth)
        one, places, _, meta = cloud_of("before", before)
        other, own_places, station, other_meta = cloud_of("after", after)
        if project is not None:
            one, places = moved_by_project(project, "before", before, one, places)
            other, own_places = moved_by_project(project, "after", after, other, own_places)
            registration = _unsure(project, registration, meta.sources, other_meta.sources)
        check_together(Path("before"), meta, Path("after"), other_meta)
        if not len(one):
            raise InputError("holds no points", option="before")
        finite = np.isfinite(other).all(axis=1)
        found = distances_of(one, other[finite], facing_of(one, places, own_places), method=method,
                             station=None if station is None else station[finite], registration=registration or 0.0,
                             depth=depth)
        whole = np.full((2, len(other)), np.nan)
        whole[:, finite] = found.distance, found.uncertainty
        return replace(found, distance=whole[0], uncertainty=whole[1])


def _unsure(project: str | PathLike[str], registration: float | None, *sources: Sequence[str]) -> float:
    """How unsure the places of two scans, or of a scan and a mesh, are to each other: as given, else as the project says."""
    from ..commands.comparing.scan_and_model import unsure_in

    return unsure_in(path_of(project), sources, _log.warning) if registration is None else registration


def _check_lengths(registration: float | None, depth: float | None) -> None:
    if registration is not None and not (np.isfinite(registration) and registration >= 0):
        raise InputError("expected a length, 0 or more", option="registration", value=registration)
    if depth is not None and not depth > 0:
        raise InputError("expected a length above 0", option="depth", value=depth)


def _from_mesh(path: Path, after: Scan | npt.ArrayLike, method: str | None, registration: float | None,
               depth: float | None, project: str | PathLike[str] | None) -> Distances:  # fmt: skip
    """Distances of the points of ``after`` from a mesh."""
    from ..readers.meshes.mesh_store import mesh_of
    from ..work.comparing.compared_model import distances_of
    from ..work.comparing.model_distances import within
    from ..work.meshes.laid_meshes import new_layer
    from ..work.project import read_project
    from .open_scan import Scan

    if method is not None:
        raise InputError("a mesh has no points to average: leave it out", option="method", value=method)
    _check_lengths(registration, depth)
    xyz, places, _, meta = cloud_of("after", after)
    known: Sequence[MeshLayer] = ()
    if project is not None:
        xyz, known = moved_by_project(project, "after", after, xyz, places)[0], read_project(path_of(project)).meshes
        registration = _unsure(project, registration, [str(path)], meta.sources)
    own = after._meshes if isinstance(after, Scan) else ()
    laid = [layer for layer in (*own, *known) if Path(layer.path).resolve() == path.resolve()]
    layer = laid[-1] if laid else new_layer(path, meta.metres_per_unit)
    finite = np.isfinite(xyz).all(axis=1)
    found = within(distances_of(layer, mesh_of(layer.path), xyz[finite], registration or 0.0), depth)
    whole = np.full((2, len(xyz)), np.nan)
    whole[:, finite] = found.distance, found.uncertainty
    return replace(found, distance=whole[0], uncertainty=whole[1])


def moved_by_project(project: str | PathLike[str], name: str, given: Scan | npt.ArrayLike | PathLike[str], xyz: np.ndarray,
                     places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Points (n, 3) and places of stations (s, 3) of an open scan where a project has moved its files.  Raises InputError."""
    from ..common.rigid_transform import moved_points
    from ..work.project import read_project
    from ..work.registration.moved_files import transforms_of
    from .open_scan import Scan

    if not isinstance(given, Scan):
        raise InputError(f"{name}: an array has no file that a project could have moved", option="project", value=str(project),
                         remedy="open the scan with pointglass.open, or leave it out")
    scene = given._open
    transforms = set(transforms_of(read_project(path_of(project)).scans, scene.meta.sources))
    if len(transforms) > 1:
        raise InputError(f"{name}: the project has moved its files differently", option="project", value=str(project),
                         remedy="open and compare them one by one")
    (transform,) = transforms or {None}
    return (xyz, places) if transform is None else (moved_points(transform, xyz), moved_points(transform, places))


def cloud_of(name: str, given: Scan | npt.ArrayLike | PathLike[str]
             ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, ScanDescription]:
    """Points, of ``before`` the finite ones; places of stations; the station of each point; what is known of the scan."""
    from .open_scan import Scan

    if isinstance(given, Scan):
        points = given.points
        return points.xyz, given.stations, points.station if len(given.stations) else None, given._open.meta
    try:
        xyz = np.asarray(given, np.float64)  # type: ignore[reportArgumentType]
    except (TypeError, ValueError):
        xyz = np.empty(0)
    if xyz.shape[1:] != (3,):
        raise InputError(f"{name}: expected an open scan or (N, 3) coordinates",
                         remedy="open a file first, with pointglass.open")
    if name == "before":
        xyz = xyz[np.isfinite(xyz).all(axis=1)]
    return xyz, np.zeros((0, 3)), None, NO_DESCRIPTION
