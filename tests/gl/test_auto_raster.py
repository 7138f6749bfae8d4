"""The rasteriser chosen by measuring, as on a GPU: which is drawn with, and what the choice costs."""

from dataclasses import replace

import pytest
from paged import CHUNK_BYTES, CHUNKS, LIMIT, POINTS, SCENE, on_disk

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render import renderer as module
from pointglass.viewer.render.raster.points import PointPages
from pointglass.viewer.render.renderer import RASTERISERS, Renderer

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
