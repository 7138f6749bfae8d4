"""``pointglass info``: prints the facts about a scan, a project, or the header of a file at an address."""

import argparse
import json
from pathlib import Path

from ...model.common.files.atomic_write import passes_through, write_atomic
from ..common.errors import InputError
from ..common.text import with_whole_characters
from ..work.contents import contents
from ..work.document import Document
from ..work.project import is_project, read_project
from .info import facts, format_text, scene_of
from .publishing.overview_page import overview_page
from .remote_info import stated_facts_of, stated_text


def run(options: argparse.Namespace) -> int:
    """Prints the facts, and writes the plan.  Raises InputError, one line, where the scan cannot be read."""
    if options.plan is not None:
        check_plan(options.plan)
    document = Document()
    if any(map(is_project, options.scans)):
        from .open_project import project_scene

        document = read_project(options.scans[0])
        scene, held = project_scene(options), contents(document)
    else:
        if options.plan is None and (stated := stated_facts_of(options.scans)):
            print(json.dumps(stated, indent=1) if options.json else stated_text(stated))
            return 0
        scene, held = scene_of(options.scans, cache=not options.no_cache, columns=options.columns), None
    if options.plan is not None:
        title = with_whole_characters(options.scans[0].resolve().stem)
        page = overview_page(scene, title, edits=document.edits, up=document.up)
        write_atomic(options.plan, lambda part: part.write_text(page, "utf-8"))
    if options.json:
        print(json.dumps(facts(scene) | ({} if held is None else {"project": held}), indent=1))
    else:
        print(format_text(scene))
        if held:
            print(f"{'project':<8} {', '.join(held)}")
    return 0


def check_plan(plan: Path) -> None:
    """Raises InputError where no page can be written at that place."""
    if plan.suffix.lower() not in (".html", ".htm"):
        raise InputError("expected a name that ends in .html", option="--plan", value=plan)
    if plan.is_dir() or passes_through(plan):
        raise InputError("is not a file that can be replaced", option="--plan", value=plan, remedy="choose another name")
    if not plan.parent.is_dir():
        raise InputError("its folder does not exist", option="--plan", value=plan, remedy=f"make {plan.parent} first")
