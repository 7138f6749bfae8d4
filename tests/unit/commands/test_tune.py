"""Tuning on an E57's photographs, or on withheld points: what fits is learned from, what is not registered is refused, what is
no better not kept."""

import json
from dataclasses import replace

import numpy as np
import pytest
from cloud_files import write_ply
from e57_photo_files import AWAY, panorama, pinhole, room_points, write_photos
from untyped import any_typed

from pointglass.model.data.surfaces.projected import scan_spacing
from pointglass.model.network.weights import load_weights
from pointglass.model.network.weights_folder import weights_dir
from pointglass.viewer.commands.tuning import tune as tuning
from pointglass.viewer.commands.tuning import withheld
from pointglass.viewer.commands.tuning.material import DENSITIES
from pointglass.viewer.commands.tuning.photographs import agreement, photographs_in, read_points, registered_pictures
from pointglass.viewer.commands.tuning.tune import tune
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.preprocess.point_colour import Colours
from pointglass.viewer.readers.e57.e57_images import read_photographs
from pointglass.viewer.readers.formats import open_source

PLACES = [((0.3, -0.4, 0.2), 0.7, 0.3), ((-0.5, 0.2, 0.0), 2.4, -0.2), ((0.1, 0.6, -0.3), 4.0, 0.1),
          ((0.8, 0.0, 0.1), 5.5, 0.0), ((-0.9, -0.5, 0.3), 1.6, -0.4), ((0.0, 0.0, 0.5), 3.1, 0.2)]  # fmt: skip


@pytest.fixture(scope="module")
def points():
    return room_points(150_000)


@pytest.fixture(scope="module")
def photographed(points, tmp_path_factory):
    """Six photographs, each with an exposure of its own."""
    given = [pinhole(at, yaw, pitch, name=f"p{n}", gain=0.75 + 0.06 * n) for n, (at, yaw, pitch) in enumerate(PLACES)]
    return write_photos(tmp_path_factory.mktemp("tune") / "room one.e57", given, *points)


def test_points_are_thinned_and_keep_their_colours(points, photographed):
    scan = read_points(photographed, most=50_000)
    assert abs(len(scan.xyz) - 50_000) < 1500 and scan.rgb.dtype == np.uint8 and scan.station.max() == 0
    order = {tuple(np.round(x, 6)): tuple(c) for x, c in zip(*points, strict=True)}
    assert all(order[tuple(np.round(x, 6))] == tuple(c) for x, c in zip(scan.xyz[:500], scan.rgb[:500], strict=True))


def test_points_are_learned_from_in_the_colours_that_the_viewer_shows(points, tmp_path):
    """Those nobody photographed are black in the file, and no colour to learn from."""
    xyz, rgb = points[0], points[1].copy()
    rgb[np.random.default_rng(4).random(len(rgb)) < 0.2] = 0
    path = write_photos(tmp_path / "a.e57", [pinhole(*PLACES[0])], xyz, rgb)
    scan = read_points(path)
    assert len(scan.xyz) == np.count_nonzero(rgb.any(1)) and scan.rgb.any(1).all()
    sources = [open_source(path)]
    colours, chunks = Colours(sources), list(sources[0].chunks())
    colours.add(0, 0, chunks[0])
    colours.decide((0.0, 1.0), {})
    shown = colours.apply(0, 0, chunks[0])
    assert len(chunks) == 1 and np.array_equal(scan.rgb, shown[shown.any(1)])


def test_exposure_is_matched_to_the_points_and_registered_pictures_fit(photographed):
    scan = read_points(photographed)
    photos, _ = read_photographs(photographed)
    for number, photo in enumerate(photos):
        found = agreement(photo, scan, scan_spacing(scan))
        assert found.correlation > 0.6 and found.offset == 0
        srgb = (0.75 + 0.06 * number) ** 2.2
        assert np.allclose(found.gain * srgb, 1.0, atol=0.15)  # undone, sRGB being nearly a power law
        assert found.picture.usable is not None and found.picture.usable.mean() > 0.6


def test_what_moved_is_not_trusted(points, tmp_path):
    given = pinhole(*PLACES[0], size=(192, 144), fl=120.0)
    photo = read_photographs(write_photos(tmp_path / "a.e57", [given], *points))[0][0]
    scan = read_points(tmp_path / "a.e57")
    before = agreement(photo, scan, scan_spacing(scan)).picture.usable
    changed = photo.picture.copy()
    changed[50:90, 60:110] = (250, 20, 20)
    after = agreement(replace(photo, picture=changed), scan, scan_spacing(scan)).picture.usable
    assert before is not None and after is not None
    assert before[55:85, 65:105].mean() > 0.7 and not after[55:85, 65:105].any()
    outside = np.ones_like(before)
    outside[40:100, 50:120] = False
    assert after[outside].mean() > 0.9 * before[outside].mean()


@pytest.mark.parametrize("wrong", ["pose", "a little", "another place"])
def test_photographs_that_are_not_registered_are_refused(points, tmp_path, wrong):
    given = [pinhole(at, yaw, pitch, size=(192, 144), fl=120.0, name=f"p{n}") for n, (at, yaw, pitch) in enumerate(PLACES)]
    for number, picture in enumerate(given):
        if wrong == "pose":
            picture.quaternion = pinhole((0, 0, 0), PLACES[number][1] + 1.3).quaternion
        elif wrong == "a little":  # three degrees: 6 pixels
            picture.quaternion = pinhole((0, 0, 0), PLACES[number][1] + 0.05, PLACES[number][2]).quaternion
        else:
            picture.blobs = pinhole((0.4, 0.3, 0.2), 2.9 * number + 1.0, size=(192, 144), fl=120.0).blobs
    path = write_photos(tmp_path / "a.e57", given, *points)
    with pytest.raises(InputError, match="not registered") as caught:
        tune(path, tmp_path / "out", quality="fast", steps=1)
    assert "a.e57" in str(caught.value) and "\n" not in str(caught.value) and not (tmp_path / "out").exists()


def test_one_photograph_that_does_not_fit_is_left_out_by_name(points, tmp_path):
    given = [pinhole(at, yaw, pitch, size=(192, 144), fl=120.0, name=f"p{n}") for n, (at, yaw, pitch) in enumerate(PLACES)]
    given[2].translation = tuple(AWAY + (-1.2, -0.9, 0.6))
    path, said = write_photos(tmp_path / "a.e57", given, *points), []
    scan = read_points(path)
    pictures = registered_pictures(path, photographs_in(path)[0], scan, scan_spacing(scan), say=said.append)
    assert len(pictures) == 5 and len(said) == 1 and "'p2'" in said[0] and "left out" in said[0]


def test_panoramas_are_learned_from_too(points, tmp_path):
    path = write_photos(tmp_path / "a.e57", [panorama((0.4, 0.1, -0.2), 0.6)], *points)
    scan = read_points(path)
    assert len(registered_pictures(path, photographs_in(path)[0], scan, scan_spacing(scan))) == 6


def test_what_cannot_be_tuned_with_is_refused_in_one_line(points, photographed, tmp_path):
    out = tmp_path / "out"
    grey = write_photos(tmp_path / "grey.e57", [pinhole(*PLACES[0])], points[0], None)
    plain = write_photos(tmp_path / "plain.e57", [], points[0], None)
    few = write_ply(tmp_path / "few.ply", points[0][:500], points[1][:500])
    single = write_photos(tmp_path / "single.e57", [pinhole(*PLACES[0])], *points)
    refused = ((grey, "no colours"), (plain, "no colours"), (few, "500 points are too few"), (single, "at least two"),
               (tmp_path / "missing.laz", "no such file"))  # fmt: skip
    for path, told in refused:
        with pytest.raises(InputError, match=told) as caught:
            tune(path, out, quality="fast", steps=1)
        assert path.name in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no weights are shipped"):
        tune(photographed, out, quality="nonsense")
    with pytest.raises(InputError, match="minutes"):
        tune(photographed, out, quality="fast", minutes=0)
    assert not out.exists()


def _tuned(photographed, out, capsys, monkeypatch, **changes):
    if not (weights_dir() / "fast-filtered.safetensors").is_file():
        pytest.skip("no fast weights are shipped")
    monkeypatch.setenv("POINTGLASS_WEIGHTS", str(out))
    made = tune(photographed, quality="fast", device="cpu", **changes)
    assert not list(out.glob(".*")) and not list(out.glob("*.partial"))
    return made, capsys.readouterr().out


@pytest.mark.slow
def test_a_few_steps_run_end_to_end_and_keep_only_what_is_better(photographed, tmp_path, capsys, monkeypatch):
    made, said = _tuned(photographed, tmp_path / "w", capsys, monkeypatch, steps=6, minutes=5)
    assert "5 photographs to learn from, 1 held out" in said and "tuned" in said
    if made.parent == weights_dir():
        assert "shipped weights are kept" in said and not list((tmp_path / "w").iterdir())
        return
    assert made == tmp_path / "w" / "room_one-fast-filtered.safetensors"
    _, header = load_weights(made)
    notes = json.loads(header["notes"])
    assert header["quality"] == "fast" and header["input"] == "filtered"
    assert notes["psnr_after"] > notes["psnr_before"] and notes["photographs"] == 5


@pytest.mark.slow
@pytest.mark.parametrize("gain, count", [(1.0, 6), (0.0, 2)])
def test_weights_are_written_where_the_judged_gain_and_only_there(photographed, tmp_path, capsys, monkeypatch, gain, count):
    """Of two photographs, too, one is judged that is not learned from."""
    values, material, judging = iter([20.0, 20.0 + gain]), tuning.material_of, []

    def some(*given):
        found = any_typed(material(*given))
        pictures = (*found.held_out, *found.learned_from)[:count]
        return replace(found, held_out=list(pictures[:1]), learned_from=list(pictures[1:]))

    monkeypatch.setattr(tuning, "material_of", some)
    monkeypatch.setattr(tuning, "mean_psnr", lambda network, judged: (judging.append(len(judged)), next(values))[1])
    out = tmp_path / "own"
    made, said = _tuned(photographed, out, capsys, monkeypatch, steps=1)
    if gain > 0:
        assert made == out / "room_one-fast-filtered.safetensors" and load_weights(made)[1]["input"] == "filtered"
        assert "21.00 dB tuned" in said
    else:
        assert made == weights_dir() / "fast-filtered.safetensors" and not list(out.iterdir())
        assert "nothing is written" in said
    assert f"{count - 1} photographs to learn from, 1 held out" in said and judging == [len(DENSITIES)] * 2


@pytest.fixture
def small(monkeypatch):
    """Withheld points at a small size."""
    for name, value in (("SIZE", (128, 96)), ("VIEWPOINTS", 6), ("PICTURES", 10)):
        monkeypatch.setattr(withheld, name, value)


def _noisy(points, path, sigma=12.0):
    rgb = points[1] + np.random.default_rng(9).normal(0, sigma, points[1].shape)
    return write_ply(path, points[0], np.rint(rgb).clip(0, 255).astype(np.uint8))


def test_pairs_are_known_where_withheld_points_are_and_made_without_them(points, tmp_path, small, monkeypatch):
    material, shown = withheld.withheld_points(_noisy(points, tmp_path / "a.ply"), 1), []
    view_points = withheld.view_points
    monkeypatch.setattr(withheld, "view_points",
                        lambda seen, *given, **more: (shown.append(seen), view_points(seen, *given, **more))[1])
    assert material.learned == 5 and material.held == 1
    (tmp_path / "work").mkdir()
    ((folder, views),) = material.pairs(tmp_path / "work", "a", 1)
    inputs, truth = np.load(folder / "measured.npy"), np.load(folder / "truth.npy")
    assert views == 5 and len(inputs) == len(truth) == 10 and inputs.shape[2:] == truth.shape[2:] == (96, 128)
    known = truth[:, 4] > 0
    both = known & (inputs[:, 3] > 0)
    assert set(np.unique(truth[:, 4])) == {0, 255} and 0.01 < known.mean() < 0.5 and (truth[:, 3] == 255).all()
    total = len(material.scan.xyz)
    assert all(len(seen.point) < 0.82 * total and int(seen.point.max()) < np.count_nonzero(~material.apart) for seen in shown)
    apart = inputs[:, :3].astype(float).transpose(0, 2, 3, 1)[both] - truth[:, :3].transpose(0, 2, 3, 1)[both] / 255
    assert 0.03 < np.sqrt(np.mean(apart**2)) < 0.2  # true colours of the place, but for noise of both
    shown.clear()
    judged = material.held_out_pictures()
    assert len(judged) == len(DENSITIES) and all(not material.apart[seen.point.numpy()].any() for seen in shown)


def test_points_are_learned_from_where_there_are_no_photographs(points, tmp_path, small, capsys, monkeypatch):
    made, said = _tuned(_noisy(points, tmp_path / "a.ply"), tmp_path / "w", capsys, monkeypatch, steps=4, minutes=5)
    assert "only an E57 carries photographs" in said and "learning from points withheld" in said
    assert "5 viewpoints to learn from, 1 held out" in said and "held-out viewpoints" in said
    if made.parent == weights_dir():
        assert "shipped weights are kept" in said and not list((tmp_path / "w").iterdir())
    else:
        notes = json.loads(load_weights(made)[1]["notes"])
        assert notes["psnr_after"] > notes["psnr_before"] and notes["viewpoints"] == 5
