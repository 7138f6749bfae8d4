"""The window's viewport on an asynchronous GPU: the cost of a moving picture is reported with the next picture."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pointglass.viewer.bench.procedural_scan import EYE, ProceduralScan, procedural_scene
from pointglass.viewer.picture.background import COLOURS, composite
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Memory, Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.render import renderer as module
from pointglass.viewer.render.culling.occlusion import LAG, OcclusionPasses
from pointglass.viewer.window.planning.picture_plan import Plan
from pointglass.viewer.window.planning.window_area import WindowArea
from pointglass.viewer.window.session.work import DocumentState
from pointglass.viewer.window.viewport.viewport import Viewport

pytestmark = pytest.mark.gl

SIZES = [(128, 96)] * 4 + [(96, 64)] * 3 + [(128, 96)] * 3


@pytest.fixture(scope="module")
def floor():
    scan = ProceduralScan(1_000_000, 9, seed=1)
    return scan, procedural_scene(scan)


class Told:
    """A session's part in it.  heard: ("shown" or "cost", what)."""

    def __init__(self, scan):
        self.view_settings = SimpleNamespace(
            give_photographs=lambda renderer: None,
            settings=Settings(view="filled", raster="compute"), split_at=0.5, sides=("filled",), background="plain",
        )  # fmt: skip
        self.notices = SimpleNamespace(say=lambda *text: pytest.fail(str(text)))
        self.flight, self.work = SimpleNamespace(moving=True), DocumentState()
        self.picture = SimpleNamespace(contended=False, dirty=False, spec=None, adaptive_lod=SimpleNamespace(target_ms=None))
        self.eye, self.number, self.heard = scan.room_middle(4) + (-0.8, 0.3, EYE), -1, []
        self.area = WindowArea(SIZES[0], time.monotonic)
        self.screen = SimpleNamespace(exact=False, full_plan=Plan(("filled",), None), plan=None)

    @property
    def spec(self):
        chosen = self.view_settings
        return PictureSpec(self.camera, chosen.settings, chosen.sides, self.work.document.edits,
                           background=chosen.background, split_at=chosen.split_at)

    def accept(self, _):
        pass

    def failed(self, text):
        pytest.fail(text)

    def go_on(self, *, moving: bool = True) -> None:
        self.number += 1
        angle = 0.3 + 0.1 * self.number
        ahead = self.eye + (np.cos(angle), np.sin(angle), -0.1)
        self.camera = from_fov(*SIZES[self.number % len(SIZES)], 60.0, look_at(self.eye, ahead))
        self.screen.camera = self.camera
        self.screen.plan = Plan(("filled",), 64.0 + self.number, hides=moving, moving=moving)

    def shown(self, plan, *, hides, approximations):
        self.picture.spec = self.spec
        self.heard.append(("shown", plan.level, hides))

    def learn(self, plan, cost):
        self.heard.append(("cost", plan.level, cost.points_drawn, cost.hidden, cost.facts.cells_drawn))

    def drew(self, plan, cost):
        self.shown(plan, hides=cost.hidden is not None, approximations=())
        self.learn(plan, cost)


def flown(context, floor, monkeypatch, *, software: bool) -> list[tuple]:
    known = module.describe_device
    with monkeypatch.context() as patch:
        patch.setattr(module, "describe_device", lambda c: replace(known(c), software=software))
        patch.setitem(LAG, False, LAG[True])  # so that both skip the same cells
        told = Told(floor[0])
        viewport = Viewport(context, told, memory=Memory(), wake=lambda: None)  # type: ignore[arg-type]
        try:
            assert viewport.upload(SimpleNamespace(scene=floor[1]))  # type: ignore[arg-type]
            viewport.renderer.pages.load_all()  # type: ignore[union-attr]
            for _ in SIZES:
                told.go_on()
                viewport.paint()
            told.go_on(moving=False)
            viewport.paint()
            assert viewport.full_picture() is not None
        finally:
            viewport.release()
    return told.heard


def test_costs_are_those_of_their_own_picture_and_come_with_the_next(context, floor, monkeypatch):
    at_once, later = (flown(context, floor, monkeypatch, software=software) for software in (True, False))
    costs = [[entry for entry in heard if entry[0] == "cost"] for heard in (at_once, later)]
    assert costs[0] == costs[1] and sum(entry[3] is not None for entry in costs[0]) > len(SIZES) // 2
    assert [entry for entry in at_once if entry[0] == "shown"] == [entry for entry in later if entry[0] == "shown"]
    kinds = [entry[0] for entry in later]
    assert kinds[:5] == ["shown", "cost", "shown", "cost", "shown"], "one picture behind"
    assert kinds.count("shown") == kinds.count("cost") == len(SIZES) + 2, "at rest nothing is left untold"


def test_while_something_moves_no_picture_waits_for_its_own_times(context, floor, monkeypatch):
    """Of the frame under way neither a query nor the count of hidden cells is read."""
    known, under_way = module.describe_device, []
    monkeypatch.setattr(module, "describe_device", lambda c: replace(known(c), software=False))
    count = OcclusionPasses.hidden_count
    monkeypatch.setattr(OcclusionPasses, "hidden_count", lambda self, n: under_way.append(n == self.serial) or count(self, n))
    told = Told(floor[0])
    viewport = Viewport(context, told, memory=Memory(), wake=lambda: None)  # type: ignore[arg-type]
    try:
        viewport.upload(SimpleNamespace(scene=floor[1]))  # type: ignore[arg-type]
        viewport.renderer.pages.load_all()  # type: ignore[union-attr]
        for _ in range(4):
            told.go_on()
            viewport.paint()
            assert viewport.frame.times._milliseconds is None  # type: ignore[union-attr]
        assert len(under_way) == 3 and not any(under_way)
    finally:
        viewport.release()


def test_the_last_picture_of_a_movement_is_told_at_rest_and_once(context, floor, monkeypatch):
    known = module.describe_device
    monkeypatch.setattr(module, "describe_device", lambda c: replace(known(c), software=False))
    told = Told(floor[0])
    viewport = Viewport(context, told, memory=Memory(), wake=lambda: None)  # type: ignore[arg-type]
    try:
        viewport.upload(SimpleNamespace(scene=floor[1]))  # type: ignore[arg-type]
        for _ in range(3):
            told.go_on()
            viewport.paint()
        for _ in range(2):
            viewport.settle()
        assert [entry[0] for entry in told.heard].count("cost") == 3
        assert [entry[1] for entry in told.heard if entry[0] == "cost"] == [64.0, 65.0, 66.0]
    finally:
        viewport.release()


def test_the_background_chosen_is_behind_what_is_shown_and_what_is_saved(context, floor):
    """At once: no picture is made again for it."""
    told = Told(floor[0])
    told.view_settings.settings, told.view_settings.sides = Settings(view="raw", raster="compute", lod=1.0), ("raw",)
    told.go_on(moving=False)
    told.screen.plan = told.screen.full_plan = Plan(("raw",), 1.0)
    viewport = Viewport(context, told, memory=Memory(), wake=lambda: None)  # type: ignore[arg-type]
    try:
        assert viewport.upload(SimpleNamespace(scene=floor[1]))  # type: ignore[arg-type]
        saved = viewport.full_picture()
        assert saved is not None and viewport.frame is not None
        image = viewport.frame.image("raw")
        assert (image[..., 3] == 0).any() and np.array_equal(saved, composite(image, "plain"))
        for background in COLOURS:
            told.view_settings.background = background
            assert np.array_equal(viewport.show().read(), composite(image, background))
            assert np.array_equal(viewport.full_picture(), composite(image, background))  # type: ignore[arg-type]
    finally:
        context.detect_framebuffer(0).use()  # the canvas must not stay bound
        viewport.release()


def test_a_moving_picture_is_drawn_with_the_smaller_network_of_its_plan(context, floor):
    told = Told(floor[0])
    told.view_settings.settings = Settings(view="neural", quality="balanced", device="cpu", raster="compute", lod=1.0)
    viewport = Viewport(context, told, memory=Memory(), wake=lambda: None)  # type: ignore[arg-type]
    try:
        assert viewport.upload(SimpleNamespace(scene=floor[1]))  # type: ignore[arg-type]
        pictures = {}
        for quality in ("fast", "balanced"):
            told.number = -1
            told.go_on()
            told.screen.plan = Plan(("neural",), 1.0, moving=True, network=quality)
            viewport.paint()
            assert viewport.renderer is not None and viewport.frame is not None
            pictures[quality] = viewport.frame.image("neural")
            exact = viewport.renderer.render(told.camera, replace(told.view_settings.settings, quality=quality), ("neural",))
            assert np.array_equal(pictures[quality], exact.image("neural")), quality
        assert not np.array_equal(*pictures.values())
    finally:
        viewport.release()
