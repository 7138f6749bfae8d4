"""``pointglass align``: the rigid transformation that brings a scan, or a mesh, to its place beside another scan, and a project
with both.

From pairs of points (--pairs), from the surfaces both show (ICP), or from pairs first and surfaces then.  Frame: file
coordinates and units of each scan; the transformation leads from those of MOVING to those of FIXED.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..common.rigid_transform import IDENTITY, Rows, motion_text, moved_points
from ..common.text import number_text
from ..work.document import Document, ScanFile
from ..work.project import SUFFIX, is_project, write_project
from ..work.registration.align_surfaces import Alignment, align_surfaces
from ..work.registration.pair_file import read_pairs
from ..work.registration.point_pairs import PairFit, fit_pairs
from .align_model import align_model, model_moves, pairs_text, spread_points, unit_text

if TYPE_CHECKING:
    from ..readers.source import Source

@dataclass(frozen=True, eq=False)
class Found:
    """transform: of the moving scan.  middle: (3,) of what was compared of it, at its place.  pairs, surfaces: what was found
    by each, None where it was not asked for."""

    transform: Rows
    middle: np.ndarray
    pairs: PairFit | None
    surfaces: Alignment | None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options."""
    parser.add_argument("moving", type=Path, metavar="MOVING",
                        help="the scan that is moved, or a mesh (glTF, OBJ, STL, IFC, PLY with faces)")
    parser.add_argument("fixed", type=Path, metavar="FIXED", help="the scan that stays")
    parser.add_argument("--pairs", type=Path, metavar="F.csv",
                        help="pairs of points to begin with: six numbers a line, x y z in MOVING and x y z in FIXED; without "
                             "it the scans must lie within about half a metre and 10 degrees of their places")
    parser.add_argument("--only-pairs", action="store_true", help="leave it at the pairs; surfaces are not compared")
    parser.add_argument("--out", type=Path, metavar="F",
                        help=f"write a project ({SUFFIX}) with both scans, MOVING at its place")


def aligned(moving: "Source", fixed: "Source", pairs: tuple[np.ndarray, np.ndarray] | None, *, surfaces: bool = True) -> Found:
    """The alignment of a scan to another.  pairs: as from read_pairs.  surfaces: whether they are compared.

    Raises InputError as fit_pairs and align_surfaces do, and where both scans state different units."""
    metres = moving.metres_per_unit, fixed.metres_per_unit
    if None not in metres and abs(metres[0] / metres[1] - 1) > 1e-6:  # type: ignore[operator]
        raise InputError(f"counts in {moving.units}, {fixed.path.name} in {fixed.units}; a scan is moved, not scaled",
                         file=moving.path, remedy="export one of them in the unit of the other")
    by_pairs = None if pairs is None else fit_pairs(*pairs)
    start = IDENTITY if by_pairs is None else by_pairs.transform
    if not surfaces:
        return Found(start, np.zeros(3) if pairs is None else pairs[1].mean(axis=0), by_pairs, None)
    points = spread_points(moving)
    found = align_surfaces(points, spread_points(fixed), start)
    return Found(found.transform, moved_points(found.transform, points).mean(axis=0), by_pairs, found)


def report(found: Found, moving: "Source", fixed: "Source") -> str:
    """What was found, as lines for a terminal."""
    unit = unit_text(moving)
    motion = motion_text(found.transform, found.middle)
    rows = [("moved", f"{moving.path.name} to its place beside {fixed.path.name}: {motion}")]
    rows += [("matrix" if number == 0 else "", " ".join(map(number_text, row)))
             for number, row in enumerate(found.transform)]
    if (pairs := found.pairs) is not None:
        rows.append(("pairs", pairs_text(pairs, unit)))
    if (known := found.surfaces) is not None:
        rows += [
            ("surfaces", f"rms {known.rms:.4g}{unit} at {known.count:,} places; {100 * known.overlap:.0f} % of "
                         f"{moving.path.name} overlap"),
            ("from", f"the start was off by {known.moved:.4g}{unit} there"),
            ("unsure", f"{known.uncertainty:.2g}{unit} of a place in the overlap, {known.turn_uncertainty:.2g} degrees of the "
                       "turn (95 %, without errors of the instruments)"),
        ]
    return "\n".join(f"{name:<8} {text}" for name, text in rows)


def run(options: argparse.Namespace) -> int:
    """The command.  Returns the exit code."""
    from ..readers.formats import open_source
    if options.only_pairs and options.pairs is None:
        raise InputError("needs pairs of points", option="--only-pairs", remedy="give --pairs F.csv")
    if (out := options.out) is not None:
        if not is_project(out):
            raise InputError(f"expected a name ending in {SUFFIX}", option="--out", value=out)
        if not out.parent.is_dir():
            raise InputError("its folder does not exist", option="--out", value=out, remedy=f"make {out.parent} first")
    pairs = None if options.pairs is None else read_pairs(options.pairs)
    if model_moves(options.moving, options.fixed):
        return align_model(options.moving, open_source(options.fixed), pairs, out, surfaces=not options.only_pairs)
    moving, fixed = (open_source(path) for path in (options.moving, options.fixed))
    found = aligned(moving, fixed, pairs, surfaces=not options.only_pairs)
    print(report(found, moving, fixed))
    if out is not None:
        unsure = None if found.surfaces is None else found.surfaces.uncertainty
        scans = ScanFile(str(options.moving), transform=found.transform, unsure=unsure), ScanFile(str(options.fixed))
        write_project(out, Document(scans))
        print(f"project  {out}")
    return 0
