"""Random actions in a window: no exception, no growth of memory, no growth in the number of OpenGL objects.

The short version takes 200 actions; POINTGLASS_RANDOM_ACTIONS=2000 is the long one.  POINTGLASS_SEED repeats a run.
"""

import json
import os

import numpy as np
import pytest
from random_actions import INTERVALS, OBJECTS
from x_server import run_with_display

pytestmark = pytest.mark.window
WARM = INTERVALS // 2
"""Counts taken before this one are warm-up: compiled loops, glyphs, shaders and passes made when they are first needed."""
MOST_GROWTH = 48.0
"""MB of resident memory after the warm-up, within which the fragmentation of the heap stays."""
MOST_LEFT = 30.0
"""MB in use after the warm-up: what varies is what the last pictures left for the next ones."""
MOST_OBJECTS = 3.0
"""Blocks of Python's memory an action: undo steps, names of files, statistics of frames."""
CACHED = 1000
"""Blocks of Python's memory that caches took, however many actions there are."""
LAZY = 2
"""Objects of a kind that a pass or shader first needed after the warm-up may have made."""


def test_random_actions_leave_no_exception_no_memory_and_no_opengl_objects(tmp_path, seed):
    actions = int(os.environ.get("POINTGLASS_RANDOM_ACTIONS") or 200)
    done = run_with_display("random_actions.py", tmp_path, str(actions), str(seed), seconds=120 + 0.6 * actions)
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
    assert counted[-1]["Texture"] > 10, "the counting sees the window's context"
    kept = counted[WARM:]
    if counted[-1]["in_use"] is not None:
        left = np.median([one["in_use"] for one in kept]) - np.median([one["in_use"] for one in counted[:WARM]])
        assert left < MOST_LEFT, f"{left:.0f} MB more in use than before"
    objects = (kept[-1]["objects"] - kept[0]["objects"] - CACHED) / (actions * (len(kept) - 1) / INTERVALS)
    assert objects < MOST_OBJECTS, f"{objects:.1f} more blocks of Python's memory with each action"
    growth = counted[-1]["resident"] - max(one["resident"] for one in counted[:WARM])
    assert growth < MOST_GROWTH, f"{growth:.0f} MB more than after the warm-up"
