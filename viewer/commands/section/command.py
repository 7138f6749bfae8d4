"""``pointglass section``: a plan, an elevation or a section of measured points, to scale, as PNG, PDF or DXF."""

import argparse
import logging
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError, Option
from ...common.fonts import boxes_line
from ...common.text import counted
from ...work.measuring.measure_text import unit_name
from ...work.sheets.paper_layout import DPI as PAPER_DPI
from ...work.sheets.paper_layout import ORIENTATIONS, SIZES
from .cut import Cut, along_line, elevation, plan
from .model_lines import model_text
from .sheet import check_out, drawn_texts, write_figures
from .sheet_request import DPI, SCALE, THICKNESS, SheetRequest

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...work.document import Document

_log = logging.getLogger(__name__)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options besides scans and exposures."""
    several = "; several times for several sheets"
    parser.add_argument("--plan", dest="cuts", action=_AddCut, type=float, metavar="HEIGHT",
                        help=f"from above, at this height (coordinate along the up axis){several}")
    parser.add_argument("--elevation", dest="cuts", action=_AddCut, type=float, metavar="AZIMUTH",
                        help="from outside, looking in this direction: degrees clockwise from the file's y axis (grid north)")
    parser.add_argument("--line", dest="cuts", action=_AddCut, metavar="X1,Y1,X2,Y2",
                        help="an upright section between two places; the first is left on the sheet")
    parser.add_argument("--from", dest="begin", metavar="D|X,Y",
                        help="cut plane of elevations: what lies in front of it is left out. D: so far behind the front of the "
                             "scan, in its units; X,Y: through this place")
    parser.add_argument("--thickness", type=float, metavar="T",
                        help=f"of the slab, in the scan's units, centred on the plane (default {THICKNESS:g} m); of an "
                             "elevation the part nearest to the eye (default: everything)")
    parser.add_argument("--scale", metavar="1:N",
                        help=f"scale on paper (default 1:{SCALE:g}; with --paper the largest standard scale that fits)")
    parser.add_argument("--dpi", type=int, metavar="N",
                        help=f"pixels an inch of paper (default {DPI}; of A1 {PAPER_DPI['A1']}, of A0 {PAPER_DPI['A0']})")
    parser.add_argument("--paper", choices=list(SIZES),
                        help="a sheet of this size, with frame and title block (default: as large as the drawing)")
    way = parser.add_mutually_exclusive_group()
    for name in ORIENTATIONS:
        way.add_argument(f"--{name}", dest="orientation", action="store_const", const=name,
                         help=f"the paper is {'wider than high' if name == 'landscape' else 'higher than wide'} (default: what "
                              "fits better)")  # fmt: skip
    parser.add_argument("--title", default="", metavar="TEXT", help="of the sheet (default: the scan's name)")
    parser.add_argument("--author", default="", metavar="TEXT", help="in the title block (default: none)")
    parser.add_argument("--date", default="", metavar="TEXT", help="in the title block (default: today)")
    parser.add_argument("--trace", action="store_true",
                        help="draw lines along what is cut; DXF has these alone, and those of meshes, which are always drawn")
    parser.add_argument("--no-picture", dest="picture", action="store_false",
                        help="leave the points out, with --trace (default: they are drawn)")
    parser.add_argument("--no-dimensions", dest="dimensions", action="store_false",
                        help="leave out the measured lengths of a project that lie in the cut (default: they are drawn)")
    parser.add_argument("--out", type=Path, required=True, metavar="F.png|F.pdf|F.dxf",
                        help="the sheet to write; a PDF has a page for each cut")


class _AddCut(argparse.Action):
    """Adds (kind, value) to the cuts, in the order in which they are given."""

    def __call__(self, parser, namespace, values, option_string=None) -> None:
        assert option_string is not None
        setattr(namespace, self.dest, [*(getattr(namespace, self.dest) or []), (self.option_strings[0][2:], values)])


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


def parse_begin(text: str | None) -> float | tuple[float, float] | None:
    """``--from``: a distance, or a place.  Raises InputError."""
    if text is None:
        return None
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in (1, 2) or not np.isfinite(values).all():
        raise InputError("expected a distance, or a place X,Y in the scan's coordinates", option="--from", value=text)
    return values[0] if len(values) == 1 else (values[0], values[1])


def cut_of(kind: str, value: float | str, options: argparse.Namespace, scene: "Scene", document: "Document") -> Cut:
    """A cut that the options ask for.  Raises InputError."""
    thickness = options.thickness
    usual = THICKNESS / (scene.meta.metres_per_unit or 1.0) if thickness is None else thickness
    if kind == "plan":
        return plan(float(value), usual, document.up)
    if kind == "elevation":
        return elevation(float(value), thickness, scene.bounds, document.up, begin=parse_begin(options.begin))
    return along_line(*parse_line(str(value)), usual, document.up)


def request_of(options: argparse.Namespace) -> SheetRequest:
    """What the options ask of every sheet.  Raises InputError before a scan is opened."""
    kinds = [kind for kind, _ in options.cuts or ()]
    if not kinds:
        raise InputError("what is drawn is missing", remedy=("give ", Option("--plan"), ", ", Option("--elevation"), " or ",
                                                             Option("--line")))  # fmt: skip
    suffix = options.out.suffix.lower()
    check_out(options.out)
    if len(kinds) > 1 and suffix != ".pdf":
        raise InputError(f"{len(kinds)} sheets in one {suffix[1:].upper()} file", option="--out", value=options.out,
                         remedy="write a PDF, which has pages, or one cut at a time")
    if options.dpi is not None and not 10 <= options.dpi <= 2400:
        raise InputError("expected 10 to 2400", option="--dpi", value=options.dpi)
    for _, text in (cut for cut in options.cuts if cut[0] == "line"):
        parse_line(text)
    for name, value in (("--orientation", options.orientation), ("--author", options.author), ("--date", options.date)):
        if value and not options.paper and suffix != ".dxf":
            name = f"--{value}" if name == "--orientation" else name
            raise InputError("is for standard paper", option=name, remedy=("add ", Option("--paper", "A4")))
    if options.begin is not None and "elevation" not in kinds:
        raise InputError("is the cut plane of an elevation", option="--from", remedy=("add ", Option("--elevation")))
    parse_begin(options.begin)
    if not options.picture and not options.trace:
        raise InputError("leaves nothing on the sheet", option="--no-picture", remedy=("add ", Option("--trace")))
    return SheetRequest(parse_scale(options.scale) if options.scale else None, options.dpi, options.paper, options.orientation,
                        options.title, options.author, options.date, options.trace, options.picture)


def run(options: argparse.Namespace) -> int:
    """The command.  Returns the exit code."""
    from ...grid.open_scene import say_degrees
    from ...work.selection import Selection
    from ..open_project import opened
    from .sheet_request import make_sheet, trace_text, write_lines

    request = request_of(options)
    scene, document = opened(options, meshes=True)
    say_degrees(scene)
    cuts = [cut_of(kind, value, options, scene, document) for kind, value in options.cuts]
    selection = Selection.in_sight(scene, document)
    unit = unit_name(scene.meta.metres_per_unit or 1.0)  # as the sheet says
    measured = document.measurements if options.dimensions else ()
    if options.out.suffix.lower() == ".dxf":
        print(*write_lines(options.out, selection, cuts[0], request, document.meshes, measured), sep="\n")
        return 0
    png = options.out.suffix.lower() == ".png"
    sheets = [make_sheet(selection, cut, request, meshes=document.meshes, measurements=measured,
                         number=f"{number} of {len(cuts)}", png=png)
              for number, cut in enumerate(cuts, 1)]  # fmt: skip
    write_figures(options.out, [(sheet.figure, sheet.dpi) for sheet in sheets])
    if boxes := boxes_line(drawn_texts(sheet.figure for sheet in sheets)):
        _log.warning("%s", boxes)
    for number, sheet in enumerate(sheets, 1):
        width, height = sheet.sides
        page = f", page {number}" if len(sheets) > 1 else ""
        print(f"{counted(sheet.count, 'point')} at 1:{sheet.scale:g} in {options.out}{page}, {width:.0f} x {height:.0f} mm")
        if sheet.trace is not None:
            print(trace_text(sheet.trace, unit))
        for line in (*model_text(sheet.models, unit), *sheet.remarks):
            print(line)
    return 0
