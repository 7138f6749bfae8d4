"""``pointglass compare``: how far the surfaces of one scan lie from those of an earlier one, with the uncertainty of each."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.files import out_folder, write_together
from ...common.replaced_files import replaced_told
from ...common.text import counted
from ...picture.meshes.mesh_layer import MeshLayer
from ...readers.formats import KNOWN_FILES, KNOWN_FOLDERS
from ...readers.moved_source import Moves
from ...work.comparing.compare import METHODS, Distances, compare
from ...work.comparing.distance_statistics import Statistics, change_words, statistics_of
from ...work.comparing.facing import TEXTS, facing_of
from ...work.measuring.measure_text import unit_name
from ...work.project import moves_of, read_project
from ..options import add_columns
from . import distances_csv, distances_laz, distances_picture
from .distance_histogram import shown_unit
from .read_cloud import Cloud, check_together, moves_in, opened, read_cloud
from .scan_and_model import compared_with_model, layer_of, model_among, read_model, registration_in

FILES = (distances_laz.NAME, distances_csv.NAME, distances_picture.NAME)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """All options."""
    parser.add_argument("before", type=Path, metavar="BEFORE", help="the scan with which the other one is compared: "
                        f"{KNOWN_FILES} file, {KNOWN_FOLDERS} folder, or a folder of scans")  # fmt: skip
    parser.add_argument("after", type=Path, metavar="AFTER",
                        help="the scan whose points get distances; both must have the same coordinates.  One of both may be a "
                             "mesh (glTF, OBJ, STL, IFC, PLY with faces): the points of the scan get signed distances from it")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR",
                        help=f"folder for {FILES[0]} (points of AFTER with distance and uncertainty), {FILES[1]} (statistics, "
                             f"histogram) and {FILES[2]}; the window and pages have the same distances of coordinates rounded "
                             "to the grid, whose last digits may differ")
    texts = "; ".join(f"{name}: {text}" for name, text in METHODS.items())
    parser.add_argument("--method", choices=list(METHODS), default="m3c2", help=f"{texts} (default m3c2)")
    parser.add_argument("--registration", type=float, metavar="E",
                        help="uncertainty (95 %%) of how both scans lie to each other, in their unit; it is added to that of "
                             "each distance (default: what `align` found, where --project has it, else 0)")
    parser.add_argument("--depth", type=float, metavar="D",
                        help="how far from each point the other scan, or the model, is looked for, in the unit of the scans "
                             "(default: by spacing and noise; of a model at least --range)")
    parser.add_argument("--project", type=Path, metavar="P",
                        help="compare the scans where this project has moved them, such as one that `pointglass align` made of "
                             "both (default: where their files have them)")
    parser.add_argument("--range", type=float, metavar="R", dest="limit",
                        help="the colours end at distances of -R and R, in the unit of the scans (default: chosen by the "
                             "changes)")
    add_columns(parser)


def run(options: argparse.Namespace) -> int:
    """The command.  Returns the exit code."""
    for name, value, least in (("--registration", options.registration, 0.0), ("--range", options.limit, None),
                               ("--depth", options.depth, None)):  # fmt: skip
        if value is not None and not (np.isfinite(value) and (value > 0 or value == least)):
            raise InputError("expected a length in the unit of the scans", option=name, value=value)
    paths = options.before, options.after
    with_model = model_among(*paths)
    moves = None if options.project is None or with_model else moves_in(options.project, list(paths))
    lines = write_comparison(*paths, options.out, method=options.method, registration=options.registration, limit=options.limit,
                             depth=options.depth, moves=moves, columns=options.columns, project=options.project,
                             assumed=lambda line: print(f"pointglass: {line}", file=sys.stderr))  # fmt: skip
    for line in lines:
        print(line)
    print(f"{', '.join(FILES)} in {options.out}")
    return 0


def write_comparison(before_path: Path, after_path: Path, out: Path, *, method: str, registration: float | None,
                     limit: float | None, moves: Moves | None, depth: float | None = None, columns: str | None = None,
                     assumed: Callable[[str], object] = lambda line: None, project: Path | None = None,
                     layer: MeshLayer | None = None) -> list[str]:  # fmt: skip
    """Compares two scans, or a scan with a mesh, and writes FILES into the folder ``out``.  Returns what it found, lines for a
    person.

    registration: 95 %; None: what the project knows of it.  limit: where the colours end; None: chosen by the changes.
    depth: how far a counterpart is looked for; None: chosen, for a mesh at least the limit.
    moves: transformations of the scans; project: where a mesh may
    have been moved.  layer: the mesh that ``before_path`` is, where it stands; None: as its file and the project say.
    assumed: is told what is taken for granted of units.  Raises InputError; Cancelled where progress is.
    """
    model = model_among(before_path, after_path) if layer is None else (after_path, before_path)
    if model is not None:
        after_path, before_path = model
        if project is not None:
            moves = moves_of(read_project(project).scans)
    (sources, meta), (other_sources, other_meta) = (opened(path, columns, moves) for path in (
        after_path if model else before_path, after_path))
    for line in check_together(before_path, meta, after_path, other_meta):
        assumed(line)
    known = registration_in(project, before_path, after_path, assumed) if registration is None else registration
    _refuse_own_files(out, [Path(name) for name in (*meta.sources, *other_meta.sources)])
    with out_folder(out):  # before minutes of work
        after = read_cloud(after_path, other_sources, other_meta)
        if model is not None:
            layer = layer or layer_of(before_path, other_meta, project, assumed)
            before = read_model(before_path, layer, other_meta)
            distances = compared_with_model(before, layer, after, known, depth, limit)
        else:
            before = read_cloud(before_path, sources, meta)
            distances = compared(before, after, method=method, registration=known, depth=depth)
        found = statistics_of(distances.distance, distances.uncertainty, limit)
        unit = unit_name(other_meta.metres_per_unit or meta.metres_per_unit)
        with replaced_told(out / name for name in FILES):
            facts = before, after, distances, found, unit
            write_together(out, {
                distances_laz.NAME: lambda path: distances_laz.write_laz(path, after, distances, found.limit),
                distances_csv.NAME: lambda path: distances_csv.write_csv(path, *facts),
                distances_picture.NAME: lambda path: distances_picture.write_picture(path, *facts),
            })
    return report_lines(distances, found, unit)


def compared(before: Cloud, after: Cloud, *, method: str, registration: float, depth: float | None) -> Distances:
    """Distances of one scan's points from the other one.  Raises InputError naming what cannot be compared; Cancelled."""
    facing = facing_of(before.xyz, before.places, after.places) if len(before.xyz) else None
    if facing is None:
        raise InputError("holds no points", file=before.path)
    return compare(before.xyz, after.xyz, facing, method=method, station=after.station, registration=registration,
                   depth=depth)


def report_lines(distances: Distances, found: Statistics, unit: str) -> list[str]:
    """What is printed: counts, the median change, and what is changed for certain."""
    factor, shown = shown_unit(found.limit, unit)
    reach = f"within {distances.sizes.depth * factor:.3g} {shown}"
    lines = [f"{counted(found.known, 'point')} compared, {found.count - found.known:,} without a counterpart {reach}"]
    if distances.registration:
        lines.append(f"registration unsure by {distances.registration * factor:.2g} {shown} (95 %), in every uncertainty")
    if found.known:
        lines.append(f"median {found.median * factor:.3g} {shown}, standard deviation {found.sd * factor:.3g} {shown}, "
                     f"uncertainty ± {found.uncertainty * factor:.3g} {shown} (median, 95 %)")
        lines.append(f"positive is {TEXTS[distances.rule]}")
    return lines + change_words(found)


def _refuse_own_files(out: Path, sources: list[Path]) -> None:
    """Raises InputError where a scan that is read would be replaced."""
    for source in sources:
        for name in FILES:
            if (out / name).exists() and source.exists() and (out / name).samefile(source):
                raise InputError("is one of the scans that are compared", file=out / name, remedy="choose another --out")
