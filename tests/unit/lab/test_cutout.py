"""Cut-outs of a room: coverage against brute force, and a scan that ends at the box."""

import json

import numpy as np
import pytest
from rooms import make_room

from pointglass.model.data.images.photo_place import PhotoPlace
from pointglass.model.data.pairs import build
from pointglass.model.data.stations import load_scene
from pointglass.model.data.surfaces.cutout import CutOut, cut_outs, with_cut_outs


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    return load_scene(make_room(tmp_path_factory.mktemp("room") / "box"))


@pytest.mark.parametrize("seed", range(4))
def test_coverage_is_where_the_true_surface_is_in_the_box(room, seed):
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-1, 1, 3) * (2.0, 1.5, 2.5)
    cut = CutOut(room, middle - 1.0, middle + 1.0)
    for view in room.views:
        made = cut.cut(view)
        assert made is not None and made.covered is not None and made.usable is not None
        depth = view.depth().astype(float)
        for _ in range(60):
            j, i = int(rng.integers(view.height)), int(rng.integers(view.width))
            ray = np.array([(i + 0.5 - view.cx) / view.fl, -(j + 0.5 - view.cy) / view.fl, -1.0])
            ray = view.camera_to_world[:3, :3] @ ray
            along = view.camera_to_world[:3, 3] + ray * np.linspace(0, 12, 4001)[:, None]
            within = (np.abs(along - middle) <= 1.0).all(1)
            hit = view.camera_to_world[:3, 3] + ray * depth[j, i]
            if np.abs(np.abs(hit - middle) - 1.0).min() < 0.01:
                continue  # on the border, within the resolution of this check
            surface_in = bool((np.abs(hit - middle) <= 1.0).all())
            assert made.covered[j, i] == float(surface_in)
            behind = bool(within[np.linspace(0, 12, 4001) > depth[j, i] + 0.01].any())
            if not surface_in:
                assert made.usable[j, i] == (not behind) or not within.any() or abs(within.sum()) < 8


def test_the_scan_ends_at_the_box_and_pairs_contain_background(room, tmp_path):
    cut = CutOut(room, np.array([-2.1, -1.6, -2.6]), np.array([2.1, 0.0, 2.6]))  # the lower half
    scan = cut.scan(1)
    assert 0 < len(scan.xyz) < len(room.scan(1).xyz) and scan.xyz[:, 1].max() <= 0
    count = build([cut], tmp_path / "out", scans=1, variants=1)
    truth = np.load(tmp_path / "out" / "truth.npy")
    assert count == len(cut.views) > 0
    assert (truth[:, 3] == 0).any() and (truth[:, 3] == 255).any() and (truth[:, 4] == 255).mean() > 0.9


def test_training_uses_a_cut_out_of_registered_rooms_only(room, tmp_path):
    photographed = PhotoPlace("photographs", room.scan(1), room.views)
    places = with_cut_outs([room, photographed], 3)
    assert places[:2] == [room, photographed] and [place.name for place in places[2:]] == ["box cut out"]
    assert len(places[2].views) == 1, "fewer views than the room has"
    count = build(places, tmp_path / "out", scans=2, variants=1)
    scenes = [pair["scene"] for pair in json.loads((tmp_path / "out" / "pairs.json").read_text())["pairs"]]
    assert count == len(scenes) == 18 and scenes.count("box cut out") == 2


def test_a_cut_out_may_have_no_points(room, tmp_path, monkeypatch):
    """As under a tripod; its pictures remain."""
    cut = CutOut(room, np.array([-2.1, -1.6, -2.6]), np.array([2.1, 0.0, 2.6]), most=2)
    empty = CutOut(room, np.full(3, 90.0), np.full(3, 91.0)).scan(1)
    assert not len(empty.xyz)
    monkeypatch.setattr(CutOut, "scan", lambda *_: empty)
    build([cut], tmp_path / "out", scans=2, variants=1)
    assert not np.load(tmp_path / "out" / "measured.npy").any()


def test_boxes_are_seeded(room):
    a, b, c = cut_outs(room, 3, 1), cut_outs(room, 3, 1), cut_outs(room, 3, 2)
    assert all(np.array_equal(p.low, q.low) for p, q in zip(a, b, strict=True))
    assert any(not np.array_equal(p.low, q.low) for p, q in zip(a, c, strict=True))
