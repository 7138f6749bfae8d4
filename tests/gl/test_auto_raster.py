"""The rasteriser chosen by measuring, as on a GPU: which is drawn with, and what the choice costs."""

from dataclasses import replace

import numpy as np
import pytest
from paged import CHUNK_BYTES, CHUNKS, LIMIT, POINTS, SCENE, on_disk

from pointglass.viewer.common.files import write_png
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.render import renderer as module
from pointglass.viewer.render.raster.choose_raster import make_rasteriser
from pointglass.viewer.render.raster.points import PointPages
from pointglass.viewer.render.renderer import RASTERISERS, Renderer
from pointglass.viewer.work.pictures.shot_metadata import KEY, describe_shot, read_shot

pytestmark = pytest.mark.gl

SETTINGS = Settings(view="filtered")


@pytest.fixture
def looks_like_a_gpu(monkeypatch):
    """Timer queries and measured choices, as where OpenGL is not software."""
    known = module.describe_device
    monkeypatch.setattr(module, "describe_device", lambda context: replace(known(context), software=False))


def in_the_middle():
    middle = SCENE.bounds.mean(axis=0)
    return from_fov(96, 64, 70.0, look_at(middle, middle + (1.0, 0.4, -0.2)))


@pytest.mark.parametrize("slots", [40.5, CHUNKS + 1])
def test_the_choice_reads_nothing_and_changes_no_picture(context, tmp_path, monkeypatch, looks_like_a_gpu, agree, slots):
    put: list[int] = []
    load = PointPages._put

    def counted(pages, chunk, slot, points):
        put.append(chunk)
        return load(pages, chunk, slot, points)

    monkeypatch.setattr(PointPages, "_put", counted)
    pictures, read, kinds = [], [], []
    for raster in ("compute", "points", "auto"):
        renderer = Renderer(context, on_disk(tmp_path), raster=raster)
        renderer.pages.release()
        renderer.pages = PointPages(context, renderer.scene, LIMIT, budget=int(slots * CHUNK_BYTES), chunk_points=POINTS)
        put.clear()
        frame = renderer.render(in_the_middle(), SETTINGS)
        pictures.append({"filtered": frame.image("filtered").copy(), "depth": frame.depth().copy()})
        stats = frame.stats
        read.append(len(put))
        kinds.append(stats["raster"])
        assert {"cull", "raster", "filter"} == set(stats["stages"]) == set(stats["host"])
        assert list(renderer._passes.rasterisers) == [stats["raster"]]
        renderer.release()
    assert kinds[:2] == ["compute", "points"] and kinds[2] in RASTERISERS
    assert agree(pictures[1], pictures[0]) and agree(pictures[2], pictures[0]) and pictures[0]["filtered"].any()
    assert read[2] == read[0] == read[1], read


@pytest.mark.parametrize("kind", ["compute", "points"])
def test_a_choice_by_timing_is_kept_in_the_picture_and_repeated(context, tmp_path, monkeypatch, looks_like_a_gpu, kind):
    """Whichever is said to have been the fastest: another run, on which the other one is, draws with the same."""
    def fastest(kept):
        return lambda programs, size, device, *_, **__: make_rasteriser(kept, None, programs, size, device)

    def drawn(named: str, raster: str = "auto"):
        renderer = Renderer(context, on_disk(tmp_path))
        renderer.choice.repeat(named)
        frame = renderer.render(in_the_middle(), replace(SETTINGS, raster=raster))
        shot = describe_shot(renderer.scene, PictureSpec(in_the_middle(), replace(SETTINGS, raster=raster)))
        found = frame.stats["raster"], shot.drawn_with(renderer.choice.timed)
        renderer.release()
        return found

    monkeypatch.setattr(module, "fastest", fastest(kind))
    ran, shot = drawn("")
    assert (ran, shot.raster) == (kind, kind)
    write_png(tmp_path / "shot.png", np.zeros((64, 96, 3), np.uint8), {KEY: shot.text()})
    assert read_shot(tmp_path / "shot.png").raster == kind
    other = "points" if kind == "compute" else "compute"
    monkeypatch.setattr(module, "fastest", fastest(other))
    assert drawn("")[0] == other
    ran, again = drawn(read_shot(tmp_path / "shot.png").raster)
    assert ran == kind and again.text() == shot.text()
    ran, asked = drawn(kind, raster=other)
    assert (ran, asked.raster) == (other, ""), "what the settings name is not a choice by timing"


def test_in_software_nothing_is_timed_and_nothing_kept(context, tmp_path):
    renderer = Renderer(context, on_disk(tmp_path))
    renderer.choice.repeat("compute")
    assert renderer.render(in_the_middle(), SETTINGS).stats["raster"] == "cpu" and renderer.choice.timed == ""
    assert '"raster": "compute"' not in describe_shot(renderer.scene, PictureSpec(in_the_middle(), SETTINGS)).text()
    renderer.release()
