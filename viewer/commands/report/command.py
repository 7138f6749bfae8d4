"""``pointglass report``: viewpoints, notes and measurements of a project as a PDF, its notes as BCF or CSV."""

import argparse
import logging
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from ...common.errors import InputError
from ...work.project import SUFFIX, is_project, read_project
from .report_job import ReportJob, check_ending
from .report_pdf import Wording

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...work.viewpoint import Viewpoint

_log = logging.getLogger(__name__)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options besides exposures."""
    parser.add_argument("scans", nargs=1, type=Path, metavar=f"PROJECT{SUFFIX}", help="a project, as the window saves it")
    parser.add_argument("--no-cache", action="store_true", help="build the grid in memory and do not keep it in the cache")
    parser.set_defaults(columns=None)
    parser.add_argument("--viewpoint", action="append", metavar="NAME", dest="viewpoints",
                        help="of those that the PDF shows; several times for several (default: all of the project)")
    parser.add_argument("--title", default="", metavar="TEXT", help="of the report (default: the project's name)")
    parser.add_argument("--author", default="", metavar="TEXT", help="of the report and of the issues (default: none)")
    parser.add_argument("--date", default=None, metavar="TEXT", help="on the report (default: today)")
    parser.add_argument("--out", type=Path, required=True, metavar="F.pdf|F.bcf|F.csv",
                        help="the file to write: a report with pictures, or the notes as issues or as a table")


def run(options: argparse.Namespace) -> int:
    """The command.  Returns the exit code."""
    from ..open_project import opened
    from ..section.sheet import check_place

    check_ending(options.out)
    check_place(options.out)
    (project,) = options.scans
    if not is_project(project):
        raise InputError("a report is made of a project", file=project, remedy=f"save one in the window, as *{SUFFIX}")
    views = chosen(read_project(project).viewpoints, options.viewpoints)
    scene, document = opened(options)
    wording = Wording(options.title or project.stem, options.author,
                      date.today().isoformat() if options.date is None else options.date)
    job = ReportJob(scene, document, project, options.out, views, wording,
                    lambda line: _log.warning("%s", line))
    print(f"{job.write()} in {options.out}")
    return 0


def chosen(views: "Sequence[Viewpoint]", names: "list[str] | None") -> "list[Viewpoint]":
    """The viewpoints of these names, in the project's order; None: all.  Raises InputError naming one that is not there."""
    known = [view.name for view in views]
    for name in names or ():
        if name not in known:
            raise InputError("the project has no such viewpoint", option="--viewpoint", value=name,
                             remedy=f"it has {', '.join(known)}" if known else "it has none")
    return [view for view in views if names is None or view.name in names]
