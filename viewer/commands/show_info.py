"""``pointglass info``: prints the facts about a scan, a project, or the header of a file at an address."""

import argparse
import json

from ..work.contents import contents
from ..work.project import is_project, read_project
from .info import facts, format_text, scene_of
from .remote_info import stated_facts_of, stated_text


def run(options: argparse.Namespace) -> int:
    """Prints the facts.  Raises InputError, one line, where the scan cannot be read."""
    if any(map(is_project, options.scans)):
        from .open_project import project_scene

        scene, held = project_scene(options), contents(read_project(options.scans[0]))
    else:
        if stated := stated_facts_of(options.scans):
            print(json.dumps(stated, indent=1) if options.json else stated_text(stated))
            return 0
        scene, held = scene_of(options.scans, cache=not options.no_cache, columns=options.columns), None
    if options.json:
        print(json.dumps(facts(scene) | ({} if held is None else {"project": held}), indent=1))
    else:
        print(format_text(scene))
        if held:
            print(f"{'project':<8} {', '.join(held)}")
    return 0
