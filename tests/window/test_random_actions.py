"""Random actions in a window: no exception, no growth of memory, no growth in the number of OpenGL objects.

The short version takes 100 actions, make test-all 400; POINTGLASS_RANDOM_ACTIONS=2000 is the long one.  POINTGLASS_SEED repeats
a run.
"""

import json
import os

import numpy as np
import pytest
from random_actions import INTERVALS, OBJECTS, WARM
from x_server import run_with_display

pytestmark = [pytest.mark.window, pytest.mark.timeout(4000)]  # 40 s of a processor for 100 actions; minutes beside other work
MOST_RESIDENT, MOST_IN_USE = 24.0, 8.0
"""MB by which resident memory, and memory in use, grow in the median interval after the warm-up: a leak grows in most of them,
while what is imported or cached once (matplotlib with the first plot, scratch memory of torch) is a single jump.
That closed scans are freed is claimed by itself (checks_outputs.check_a_closed_scan_is_freed)."""
MOST_OBJECTS = 3.0
"""Blocks of Python's memory an action: undo steps, names of files, statistics of frames.  Judged is the second smallest growth
of the intervals that imported nothing: a library is tens of thousands of blocks, and any interval may be the first to use one,
or a table.  A leak is in all."""
CACHED = 300.0
"""Blocks of an interval that are caches' own, however many actions it has: intervals of ten actions had 40 to 250."""
MOST_JUMPS = 150.0
"""MB in use that all single jumps together may add."""
LAZY = 4
"""Objects of a kind that may be made after the warm-up, in all: what a picture or a shader first needed, or has alive at a
count.  One more in each interval is a leak, and more than this."""


def test_random_actions_leave_no_exception_no_memory_and_no_opengl_objects(thin_demo, tmp_path, seed):
    actions = int(os.environ.get("POINTGLASS_RANDOM_ACTIONS") or 100)
    done = run_with_display("random_actions.py", tmp_path, str(actions), str(seed), str(thin_demo), seconds=1000 + actions)
    path = tmp_path / "random.json"
    assert done.returncode == 0 and path.exists(), f"the window ended with {done.returncode}\n{done.stderr}"
    report = json.loads(path.read_text())
    assert report["problem"] is None, report["problem"]
    assert "Traceback" not in done.stderr, done.stderr
    counted = report["counted"]
    print(json.dumps(counted))
    assert report["actions"] == actions // INTERVALS * INTERVALS and len(counted) == INTERVALS
    assert {one["error"] for one in counted} == {"GL_NO_ERROR"}
    for kind in OBJECTS:
        assert counted[-1][kind] <= max(one[kind] for one in counted[:WARM]) + LAZY, kind
    assert counted[-1]["Texture"] > 0, "the counting sees the window's context"
    grown = {key: np.diff([one[key] for one in counted[WARM - 1 :]]) for key in ("resident", "in_use", "objects")
             if counted[-1][key] is not None}
    imported = np.diff([one["modules"] for one in counted[WARM - 1 :]])
    for key, most, unit in (("resident", MOST_RESIDENT, "MB"), ("in_use", MOST_IN_USE, "MB"),
                            ("objects", MOST_OBJECTS * actions / INTERVALS + CACHED, "blocks")):
        if key in grown:
            growth = grown[key] if key != "objects" else np.sort(grown[key][imported == 0])
            if not len(growth):
                continue
            least = np.median(growth) if key != "objects" else growth[:2][-1]
            assert least < most, f"{key}: {least:.1f} {unit} more in most intervals, of {grown[key]}"
    if "in_use" in grown:
        assert counted[-1]["in_use"] - counted[0]["in_use"] < MOST_JUMPS
