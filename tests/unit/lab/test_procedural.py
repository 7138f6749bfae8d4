"""Procedural places: seeds, background, and scans that agree with the true pictures."""

import numpy as np
import pytest
from untyped import any_typed

from pointglass.model.data import procedural
from pointglass.model.data.pairs import build, by_size
from pointglass.model.data.procedural import ProceduralPlace, procedural_places
from pointglass.model.data.surfaces.projected import project_scan
from pointglass.model.synth.place import Place


@pytest.fixture(scope="module", autouse=True)
def coarse_light():
    """The indirect light of a room takes longer than its pictures, and a sixth of the rays is as reproducible."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(procedural, "Place", lambda seed, probe_rays: Place(seed, probe_rays=probe_rays // 6))
        yield


def _small(kind, seed=1):
    return ProceduralPlace(kind, seed, count=2, size=(64, 48), pulses=6_000, samples=1)


@pytest.fixture(scope="module", params=["street", "thing", "room"])
def place(request):
    return _small(request.param)


@pytest.mark.slow
def test_a_place_is_determined_by_its_seed(place):
    again, other = _small(place.kind), _small(place.kind, 2)
    assert all(np.array_equal(a.rgb(), b.rgb()) for a, b in zip(place.views, again.views, strict=True))
    assert np.array_equal(place.scan(5).xyz, again.scan(5).xyz)
    assert len(place.scan(6).xyz) != len(place.scan(5).xyz)
    assert not np.array_equal(place.views[0].rgb(), other.views[0].rgb())


def test_pixels_without_a_surface_are_not_covered(place):
    for view in place.views:
        coverage, depth = view.coverage(), view.depth()
        if place.kind == "room":
            assert coverage is None or (coverage == 1).all()
            continue
        # both are traced through the centres of pixels, so they must agree exactly
        assert np.array_equal(coverage > 0, np.isfinite(depth))
    if place.kind == "thing":
        assert all(0.005 < view.coverage().mean() < 0.7 for view in place.views)


def test_the_scan_agrees_with_the_pictures(place):
    """No point is nearer than the picture's surface; hidden points are behind it."""
    scan = place.scan(3)
    floating = total = 0
    for view in place.views:
        seen = project_scan(scan, view)
        depth = view.depth()
        around = np.pad(depth, 1, mode="edge")
        nearest = np.min([around[j : j + view.height, i : i + view.width] for j in range(3) for i in range(3)], axis=0)
        front = nearest.ravel()[seen.index.numpy()]
        z = seen.z.numpy()
        floating += int((z < front * 0.97 - 0.03).sum())
        total += len(z)
    assert total > 200 and floating < 0.06 * total


def test_exposures_have_a_mean_of_one():
    from pointglass.model.synth.demo import exposures

    for seed in range(20):
        assert exposures(seed, 2 + seed % 3).mean() == 1.0


def test_people_appear_in_one_stations_scan_only(monkeypatch):
    import pointglass.model.data.procedural as module

    place = _small("street", 4)
    pictures = [view.rgb().copy() for view in place.views]
    counts = []
    for share in (0.0, 1.0):
        monkeypatch.setattr(module, "PASSER_SHARE", share)
        counts.append(place.traced(9))
    plain, peopled = counts
    assert not (len(plain.xyz) == len(peopled.xyz) and np.array_equal(plain.xyz, peopled.xyz))
    assert all(np.array_equal(view.rgb(), before) for view, before in zip(place.views, pictures, strict=True))


def test_places_make_pairs_with_background(tmp_path):
    count = build([_small("thing"), _small("street")], tmp_path / "out", scans=1, variants=1)
    truth = np.load(tmp_path / "out" / "truth.npy")
    assert count == 4 and (truth[:2, 3] == 0).mean() > 0.3 and (truth[:, 4] == 255).all()


def test_picture_sizes_are_known_without_rendering(monkeypatch):
    """Rendering the pictures of forty places to learn their sizes would take half an hour."""
    monkeypatch.setattr(ProceduralPlace, "place", property(lambda self: pytest.fail("a place was built")))
    places = list(procedural_places(range(40)))
    assert by_size(places) == [places] and {view.width for place in places for view in place.views} == {640}


def test_pictures_and_scans_of_a_place_in_use_are_cached(monkeypatch):
    place, made = _small("thing", 7), []
    once, traced = ProceduralPlace.picture, ProceduralPlace.traced
    monkeypatch.setattr(ProceduralPlace, "picture", lambda self, number: made.append(number) or once(self, number))
    monkeypatch.setattr(ProceduralPlace, "traced", lambda self, seed: made.append(seed) or traced(self, seed))
    for _ in range(2):
        assert [view.rgb().shape for view in place.views] == [(48, 64, 3)] * 2
        assert all(view.depth().shape == view.coverage().shape for view in any_typed(place.views))
        place.scan(8)
    assert made == [0, 1, 8]
    place.traced(8)
    assert made[3:] == [8]


def test_places_come_in_every_kind():
    assert {p.kind for p in procedural_places(range(8))} == {"room", "street", "thing"}
