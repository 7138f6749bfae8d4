"""``pointglass export``: measured points only; never a filled pixel or a colour that the network made.

A project is exported as it is seen: without hidden scans and stations, and only what its clips leave.
"""

import argparse
import shutil
from pathlib import Path

from ....model.common.atomic_write import passes_through, write_atomic
from ...errors import InputError
from ...text import bytes_text, counted
from ..altered_pictures import edits_of
from ..open_project import opened
from .point_writers import WRITERS, bytes_needed, writer_for
from .selection import Selection, clips_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options besides scans and exposures."""
    parser.add_argument("--out", type=Path, required=True, metavar="F",
                        help=f"the file to write; its ending decides the format: {', '.join(WRITERS)}")
    parser.add_argument("--clip", action="append", default=[], metavar="BOX",
                        help="keep only points inside xmin,ymin,zmin,xmax,ymax,zmax (file coordinates); several boxes add up")


def export(selection: Selection, out: Path) -> int:
    """Writes the points of a selection; returns how many.  Raises InputError; then nothing is left behind."""
    writer = writer_for(out)
    if out.is_dir() or passes_through(out):
        raise InputError(f"--out {out}: is not a file that can be replaced; choose another name")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: its folder does not exist; make {out.parent} first")
    sources = {Path(source).resolve() for source in selection.scene.meta.get("sources") or []}
    if out.resolve() in sources:
        raise InputError(f"--out {out}: is the scan itself; choose another name")
    counts = selection.count()
    total = int(counts.sum())
    free, needed = shutil.disk_usage(out.parent).free, bytes_needed(out, total)
    if free < needed:
        raise InputError(f"--out {out}: needs about {bytes_text(needed)} and {out.parent} has {bytes_text(free)}; make room")
    try:
        write_atomic(out, lambda beside: writer(beside, selection, counts), sources=sources)
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error}); make room, or choose another --out") from None
    return total


def run(options: argparse.Namespace) -> int:
    """The command.  Returns the exit code."""
    writer_for(options.out)
    boxes = clips_of(options.clip)
    scene, document = opened(options)
    count = export(Selection(scene, document.clips, boxes, edits_of(document.alterations).hidden_in(scene)), options.out)
    print(f"{counted(count, 'point')} in {options.out}")
    return 0
