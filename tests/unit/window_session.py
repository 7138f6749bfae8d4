"""A session of the window without a window: an empty room, and a clock moved by hand."""

from dataclasses import replace
from time import monotonic, sleep

import numpy as np

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.render.culling.occlusion import HiddenCount
from pointglass.viewer.render.frame import FrameCost, FrameFacts
from pointglass.viewer.window.flight.start_viewpoint import survey
from pointglass.viewer.window.session.loading import Loaded
from pointglass.viewer.window.session.session import Session

FEW = 4_000
"""Points of a session's room: the search for a place to stand in it takes longer with more."""


def room(*, metre: float = 1.0, offset=(0.0, 0.0, 0.0), scans=(), points=40_000):
    """A furnished-with-nothing room of 8 x 6 x 3 m; ``metre`` in file units."""
    rng = np.random.default_rng(1)
    size = np.array([8.0, 6.0, 3.0])
    xyz = rng.random((points, 3)) * size
    wall = rng.integers(0, 6, points)
    xyz[np.arange(points), wall % 3] = np.where(wall < 3, 0.0, size[wall % 3])
    meta = ScanDescription(metres_per_unit=1.0 / metre, scans=tuple(scans))
    return scene_from_arrays(xyz * metre + np.array(offset), rng.integers(0, 255, (points, 3), np.uint8), meta=meta)


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def session(*, loader=lambda settings: None, settings=None):
    clock = Clock()
    made = Session(settings or Settings(view="filled"), (640, 400), load_network=loader, clock=clock)
    scene = room(points=FEW)
    made.accept(Loaded(scene, survey(scene)))
    return made, clock


def frame_cost(*, total_ms=1.0, host=None, points_drawn=1, points_missing=0, hidden=None, facts=None, **stages):
    """What a frame cost.  hidden: points found hidden.  facts: others of its facts.  stages: milliseconds."""
    made = FrameFacts(raster="compute", points_drawn=points_drawn + (hidden or 0), points_missing=points_missing,
                      points_total=1, cells_drawn=1, cells_total=1, points_gpu_bytes=0, points_gpu_budget=0,
                      points_gpu_budget_source="", opengl="software", stations="equal", approximations=())  # fmt: skip
    return FrameCost(total_ms=total_ms, stages=stages, host=host or {}, facts=replace(made, **(facts or {})),
                     hidden=None if hidden is None else HiddenCount(0, hidden))


def finish(made):
    while made.view_settings.network_load is not None:
        made.view_settings.network_load.join(60.0)
        made.poll()


def until_idle(session, follow, works, *, loads=True):
    """Turns the loop until ``works()`` is false and nothing is loaded; loads=False: what is loaded is not waited for.  follow:
    what a tool does in each turn."""
    end = monotonic() + 120
    while monotonic() < end:
        follow()
        if (loaded := session.poll()) is not None:
            session.accept(loaded)
            continue
        if (session.loads.current is None or not loads) and not works():
            return
        sleep(0.01)
    raise AssertionError("work does not end")
