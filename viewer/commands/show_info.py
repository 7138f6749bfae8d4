"""``pointglass info``: prints the facts about a scan, a project, or the header of a file at an address."""

import argparse
import json

from ..work.project import is_project
from .info import facts, format_text, scene_of
from .remote_info import stated_facts_of, stated_text


def run(options: argparse.Namespace) -> int:
    """Prints the facts.  Raises InputError, one line, where the scan cannot be read."""
    if any(map(is_project, options.scans)):
        from .open_project import project_scene

        scene = project_scene(options)
    else:
        if stated := stated_facts_of(options.scans):
            print(json.dumps(stated, indent=1) if options.json else stated_text(stated))
            return 0
        scene = scene_of(options.scans, cache=not options.no_cache, columns=options.columns)
    print(json.dumps(facts(scene), indent=1) if options.json else format_text(scene))
    return 0
