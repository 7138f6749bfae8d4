"""``pointglass section``: a plan, an elevation or a section of measured points, to scale, as PNG or PDF."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError
from ...common.text import counted
from .cut import Cut, along_line, elevation, plan
from .sheet import Paper, check_out, write_sheet

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...work.document import Document

THICKNESS = 0.2
"""Metres of a plan or section, unless given."""
SCALE, DPI = 50.0, 300


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options besides scans and exposures."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--plan", type=float, metavar="HEIGHT", help="from above, at this height (coordinate along the up axis)")
    where.add_argument("--elevation", type=float, metavar="AZIMUTH",
                       help="from outside, looking in this direction: degrees clockwise from the file's y axis (grid north)")
    where.add_argument("--line", metavar="X1,Y1,X2,Y2",
                       help="an upright section between two places; the first is left on the sheet")
    parser.add_argument("--thickness", type=float, metavar="T",
                        help=f"of the slab, in the scan's units, centred on the plane (default {THICKNESS:g} m); of an "
                             "elevation the part nearest to the eye (default: everything)")
    parser.add_argument("--scale", default=f"1:{SCALE:g}", metavar="1:N", help=f"scale on paper (default 1:{SCALE:g})")
    parser.add_argument("--dpi", type=int, default=DPI, metavar="N", help=f"pixels an inch of paper (default {DPI})")
    parser.add_argument("--out", type=Path, required=True, metavar="F.png|F.pdf", help="the sheet to write")


def parse_scale(text: str) -> float:
    """``1:50`` or ``50`` -> 50.0.  Raises InputError."""
    before, colon, after = text.partition(":")
    try:
        value = float(after) / float(before) if colon else float(before)
    except (ValueError, ZeroDivisionError):
        value = 0.0
    if not (np.isfinite(value) and value > 0):
        raise InputError("expected a scale such as 1:50", option="--scale", value=text)
    return value


def parse_line(text: str) -> tuple[np.ndarray, np.ndarray]:
    """``X1,Y1,X2,Y2`` -> both ends, (2,) each.  Raises InputError."""
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.empty(0)
    if values.shape != (4,) or not np.isfinite(values).all():
        raise InputError("expected X1,Y1,X2,Y2 in the scan's coordinates", option="--line", value=text)
    return values[:2], values[2:]


def paper_of(scene: "Scene", scale: float, dpi: int = DPI) -> Paper:
    """A sheet for a scene; where its unit is unknown it is taken as the metre, and the sheet says so."""
    metres = scene.meta.metres_per_unit
    return Paper(scale, dpi, float(metres or 1.0), assumed=not metres)


def cut_of(options: argparse.Namespace, scene: "Scene", document: "Document") -> Cut:
    """The cut that the options ask for.  Raises InputError."""
    thickness = options.thickness
    usual = THICKNESS / (scene.meta.metres_per_unit or 1.0) if thickness is None else thickness
    if options.plan is not None:
        return plan(options.plan, usual, document.up)
    if options.elevation is not None:
        return elevation(options.elevation, thickness, scene.bounds, document.up)
    return along_line(*parse_line(options.line), usual, document.up)


def run(options: argparse.Namespace) -> int:
    """The command.  Returns the exit code."""
    from ...grid.open_scene import say_degrees
    from ...work.selection import Selection
    from ..open_project import opened
    from .orthographic import draw

    check_out(options.out)
    scale = parse_scale(options.scale)
    if not 10 <= options.dpi <= 2400:
        raise InputError("expected 10 to 2400", option="--dpi", value=options.dpi)
    if options.line is not None:
        parse_line(options.line)
    scene, document = opened(options)
    say_degrees(scene)
    cut, paper = cut_of(options, scene, document), paper_of(scene, scale, options.dpi)
    selection = Selection(scene, document.clips, hidden=scene.hidden_stations(document))
    drawing = draw(selection, cut, paper.pixel)
    width, height = write_sheet(options.out, drawing, paper, scene, scene.meta.title)
    print(f"{counted(drawing.count, 'point')} at 1:{scale:g} in {options.out}, {width:.0f} x {height:.0f} mm")
    return 0
