"""``pointglass export``: measured points, or splats of them; never a filled pixel or a colour that the network made.

The files are read again and whole records are copied; splats are made from the grid.  A project is exported as it is seen:
without hidden scans and stations, and only what its clips leave.
"""

import argparse
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ....model.common.files.atomic_write import passes_through, write_atomic
from ...common.errors import InputError
from ...common.text import bytes_text, counted
from ...grid.records.point_marks import check_sets, unknown_sets
from ...picture.edits import UP_AXES, Vector
from ...preprocess.scan_description import OF_SEVERAL
from ...readers.grid_folder import is_grid
from ...work.selection import Selection, classes_of, clips_of, region_named
from ..open_project import opened
from .losses import Losses
from .mesh_export import MESH_ENDINGS, check_mesh_out, export_meshes
from .reproject import target_of
from .splat_export import BUDGET, NAME, SPLATS, SplatTarget, budget_of, splat_bytes, splat_target, write_splats
from .targets import TARGETS, bytes_needed, check_ending, write

_FOLDER_FILES = ("cloud.js", "ept.json", "metadata.json")
"""Files that describe a scan of many files in their folder."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options besides scans and exposures."""
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="F",
        help=f"the file to write; its ending decides the format: {', '.join(TARGETS)}; as Gaussian splats: {', '.join(SPLATS)}",
    )
    parser.add_argument(
        "--clip",
        action="append",
        default=[],
        metavar="BOX",
        help="keep only points inside xmin,ymin,zmin,xmax,ymax,zmax (file coordinates); several boxes add up",
    )
    parser.add_argument(
        "--class",
        dest="classes",
        metavar="CODES",
        help="keep only points of these classes, such as 2,6; in a project, as they are classified there",
    )
    parser.add_argument("--region", metavar="NAME", help="keep only points of this region of the project, shown or hidden")
    parser.add_argument(
        "--reproject",
        metavar="EPSG",
        help="transform the coordinates into this reference system, such as EPSG:32632; auto: the UTM zone of the scan",
    )
    parser.add_argument(
        "--all-columns",
        action="store_true",
        help="PLY: also write columns besides coordinates, colour, intensity, scan and class, and 16-bit colours",
    )
    parser.add_argument("--meshes", action="store_true",
                        help=f"write the meshes beside the points, each at its place, no points: {', '.join(MESH_ENDINGS)}")
    parser.add_argument("--splats", action="store_true", help=f"PLY: Gaussian splats, whether the name ends in {NAME} or not")
    parser.add_argument(
        "--budget",
        metavar="N",
        help="splats at most, such as 0.5M, 2M or 8M (default 2M): more where colours change and near scanners",
    )


def export(
    selection: Selection, out: Path, *, columns: str | None = None, matched: bool = False, all_columns: bool = False,
    reproject: str | None = None, splats: bool = False, budget: int | None = None, up: Vector = UP_AXES["z"],
    note: Callable[[str], None] | None = None,
) -> int:  # fmt: skip
    """Writes the records of a selection, or splats of its points; returns how many.

    columns: what the columns of text files are, as for viewer.grid.open_scene.  matched: colours with compensated exposures, as
    the scene shows them, instead of the files'.  all_columns: PLY only, see ply_writer.  reproject: an EPSG code
    or "auto", the UTM zone (see reproject); None: coordinates as they are.  splats: PLY only, see splat_export.  budget: splats
    at most; None: BUDGET.  up: direction that is up, in file coordinates, for splats.  note: called with one line about what
    the file cannot hold, where there is such.
    Raises InputError; then nothing is left behind.
    """
    drawn = _splat_target(out, splats, budget is not None, all_columns or reproject is not None)
    target = None if reproject is None else target_of(reproject)
    if out.is_dir() or passes_through(out):
        raise InputError("is not a file that can be replaced", option="--out", value=out, remedy="choose another name")
    if not out.parent.is_dir():
        raise InputError("its folder does not exist", option="--out", value=out, remedy=f"make {out.parent} first")
    _check_not_source(selection, out)
    free, needed = shutil.disk_usage(out.parent).free, (
        bytes_needed(out, selection) if drawn is None else splat_bytes(drawn, selection, budget or BUDGET))
    if free < needed:
        raise InputError(f"needs about {bytes_text(needed)} and {out.parent} has {bytes_text(free)}", option="--out", value=out,
                         remedy="make room")
    losses, written = Losses(), [0]
    for warning in selection.scene.meta.warnings_about(*OF_SEVERAL):
        losses.add(str(warning))

    def fill(path: Path) -> None:
        if drawn is not None:
            written[0] = write_splats(path, drawn, selection, budget or BUDGET, up, losses)
            return
        written[0] = write(path, selection, losses, columns=columns, matched=matched, all_columns=all_columns, reproject=target)

    sources = [path for path in map(Path, selection.scene.meta.sources) if path.exists()]
    try:
        write_atomic(out, fill, sources=sources)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=out,
                         remedy="make room, or choose another --out") from None
    if losses and note is not None:
        note(losses.text)
    return written[0]


def _splat_target(out: Path, splats: bool, budgeted: bool, of_points: bool) -> SplatTarget | None:
    """The format of splats, None for points.  Raises InputError where the name or an option does not suit it."""
    if (found := splat_target(out, splats)) is None:
        check_ending(out, tuple(SPLATS))
        if splats or budgeted:
            as_ply = "add --splats, or leave out --budget"
            either = as_ply if out.suffix.lower() == ".ply" else "leave out --splats and --budget"
            raise InputError(f"splats are written as {', '.join(SPLATS)}", option="--out", value=out,
                             remedy=f"choose such a name, or {either}")
    elif of_points:
        raise InputError("splats are neither reprojected nor have they further columns", option="--out", value=out,
                         remedy="export points with these options, and splats from that file")
    return found


def _check_not_source(selection: Selection, out: Path) -> None:
    """Raises InputError where the file to write is a scan that is read, by whatever name, or belongs to a grid."""
    if (grid := next((folder for folder in out.resolve().parents if is_grid(folder)), None)) is not None:
        raise InputError(f"is inside {grid}, a folder made by convert", option="--out", value=out, remedy="choose another name")
    for source in selection.scene.meta.sources:
        path = Path(source)
        same = out.exists() and path.exists() and os.path.samefile(path, out)
        inside = path.name.lower() in _FOLDER_FILES and path.parent.resolve() in out.resolve().parents
        if same or inside or out.resolve() == path.resolve():
            raise InputError("is the scan itself, or inside its folder", option="--out", value=out,
                             remedy="choose another name")


def run(options: argparse.Namespace) -> int:
    """The command.  Returns the exit code."""
    if options.meshes:
        return _write_meshes(options)
    budget = None if options.budget is None else budget_of(options.budget)
    drawn = _splat_target(options.out, options.splats, budget is not None, options.all_columns or options.reproject is not None)
    if options.reproject is not None:
        target_of(options.reproject)
    boxes, classes = clips_of(options.clip), classes_of(options.classes)
    matched = options.exposures == "matched"
    # colours are read from the files; the grid that the window keeps in the cache serves as well as any
    scene, document = opened(options, match=matched or drawn is not None or not options.no_cache, writes=True, meshes=True)
    region = None if options.region is None else region_named(document.regions, options.region)
    if region is not None:
        document = replace(document, regions=tuple(each for each in document.regions if each is not region))
    check_sets(scene, document)
    selection = Selection.in_sight(scene, document, boxes, classes=classes, only=None if region is None else region.points)

    def note(text: str) -> None:
        print(f"pointglass: {options.out}: {text}", file=sys.stderr)

    for line in unknown_sets(scene, document):
        note(line)
    if document.meshes:
        note(f"{counted(len(document.meshes), 'mesh file')} beside the points: not in this file, --meshes writes them")
    count = export(
        selection,
        options.out,
        columns=options.columns,
        matched=matched,
        all_columns=options.all_columns,
        reproject=options.reproject,
        splats=options.splats,
        budget=budget,
        up=document.up,
        note=note,
    )
    print(f"{counted(count, 'point' if drawn is None else 'splat')} in {options.out}")
    return 0


def _write_meshes(options: argparse.Namespace) -> int:
    """``--meshes``.  Raises InputError where another option is for points."""
    given = {"--clip": options.clip, "--class": options.classes, "--region": options.region, "--reproject": options.reproject,
             "--splats": options.splats, "--budget": options.budget, "--all-columns": options.all_columns}
    if unsuited := next((name for name, value in given.items() if value), None):
        raise InputError("is for points; meshes are written whole", option=unsuited, remedy="leave out one of both options")
    check_mesh_out(options.out)
    scene, document = opened(options, match=not options.no_cache, meshes=True)
    count, lost = export_meshes(document.meshes, options.out, scene.meta.metres_per_unit, document.up)
    for line in lost:
        print(f"pointglass: {options.out}: {line}", file=sys.stderr)
    print(f"{counted(count, 'triangle')} in {options.out}")
    return 0
