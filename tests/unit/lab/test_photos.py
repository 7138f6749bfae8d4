"""Photographs: undistortion to a pinhole, and photographs of a scan as training data."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from untyped import any_typed
from walls import LENSES, SIZE, bend, cast, look, rays_of, straight_view, wall_scan

from pointglass.model.common.errors import DataError
from pointglass.model.data.dataset import MemoryPicture, MergedScan
from pointglass.model.data.images.lens import Lens
from pointglass.model.data.images.photo_place import BRIGHTNESS, CONTRAST, PhotoPlace
from pointglass.model.data.images.photos import Photograph
from pointglass.model.data.pairs import place_pairs
from pointglass.model.data.surfaces.projected import project_scan, raster_of
from pointglass.model.reference.projection import filled_input
from pointglass.model.train.objective import inside_flow, warp

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.model)
def test_an_undistorted_photograph_equals_a_pinholes(lens, tmp_path):
    colour, _ = cast(rays_of(lens), look(2))
    Image.fromarray(colour).save(tmp_path / "bent.png")
    photograph = Photograph(tmp_path / "bent.png", lens, look(2))
    straight = Lens("PINHOLE", photograph.width, photograph.height, photograph.fl, photograph.fl, photograph.cx, photograph.cy)
    expected, _ = cast(rays_of(straight), look(2))
    apart = np.abs(photograph.rgb().astype(int) - expected)
    assert apart.mean() < 0.8 and np.quantile(apart, 0.99) < 5
    as_it_was = np.abs(colour.astype(int) - expected)
    assert as_it_was.mean() > 2  # the picture was distorted


def test_the_pinhole_is_the_widest_that_the_lens_covers():
    for lens in LENSES:
        photograph = Photograph(Path("none"), lens, np.eye(4))
        corner = []
        for focal in (photograph.fl, photograph.fl * 0.99):
            v, u = np.mgrid[0 : lens.height, 0 : lens.width] + 0.5
            x, y = bend(lens.model, lens.distortion, (u - lens.width / 2) / focal, (v - lens.height / 2) / focal)
            column, row = lens.fx * x + lens.cx, lens.fy * y + lens.cy
            corner.append(((column >= 0) & (column <= lens.width) & (row >= 0) & (row <= lens.height)).all())
        assert corner == [True, False], lens.model


def test_a_lens_is_not_used_beyond_its_fold():
    lens = Lens("SIMPLE_RADIAL", 100, 80, 60, 60, 50, 40, (-0.3,))  # r (1 - 0.3 r^2) has its maximum at r = 1.054
    u, _ = lens.pixel(np.array([0.5, 1.05, 1.06, 3.0]), np.zeros(4))
    assert np.isfinite(u[:2]).all() and np.isnan(u[2:]).all()


def test_a_square_pinhole_is_unchanged(tmp_path):
    picture = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)
    Image.fromarray(picture).save(tmp_path / "a.png")
    photograph = Photograph(tmp_path / "a.png", Lens("PINHOLE", 40, 30, 33, 33, 18, 16.5), np.eye(4))
    assert np.array_equal(photograph.rgb(), picture) and (photograph.fl, photograph.cx, photograph.cy) == (33, 18, 16.5)


def test_pictures_are_known_where_the_scan_covers_them():
    view = straight_view(1, focal=30.0)
    assert any_typed(PhotoPlace("full", wall_scan(), [view]).views[0].known()).mean() > 0.99
    rays = (rays_of(Lens("PINHOLE", 96, 72, 30, 30, 48, 36)) * (1, -1, -1)) @ look(1)[:3, :3].T
    with np.errstate(divide="ignore"):
        reach = np.where(rays > 0, (SIZE - look(1)[:3, 3]) / rays, -look(1)[:3, 3] / rays)
    axis = reach.argmin(-1)
    far_side = np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0
    tried = 0
    for wall in {(int(a), int(s)) for a, s in zip(axis.ravel(), far_side.ravel())}:
        gone = (axis == wall[0]) & (far_side == wall[1])
        known = PhotoPlace("open", wall_scan(without=(wall,)), [view]).views[0].known()
        assert (known == ~gone).mean() > 0.97
        tried += 0.02 < gone.mean() < 0.98
    assert tried >= 2


def test_scans_get_the_papers_tones_by_seed():
    place = PhotoPlace("box", wall_scan(20_000), [straight_view(0)])
    counts = set()
    for seed in range(12):
        scan, again = place.scan(seed), place.scan(seed)
        assert np.array_equal(scan.rgb, again.rgb) and np.array_equal(scan.station, again.station)
        assert np.array_equal(scan.xyz, place.original_scan().xyz)
        counts.add(int(scan.station.max()) + 1)
        before = place.original_scan().rgb.astype(float)
        brightness, contrast = [], []
        for station in range(int(scan.station.max()) + 1):
            mine = (scan.station == station)[:, None] & (scan.rgb > 0) & (scan.rgb < 255)
            slope, shift = np.polyfit(before[mine], scan.rgb[mine], 1)
            brightness.append(shift)
            contrast.append(slope)
        assert np.ptp(contrast) <= 2.1 * CONTRAST and np.ptp(brightness) <= 2.1 * BRIGHTNESS
        assert abs(np.mean(contrast) - 1) < 0.01 and abs(np.mean(brightness)) < 1  # neutral on average
    assert counts == {2, 3, 4, 5}
    assert not np.array_equal(place.scan(1).rgb, place.scan(2).rgb)
    stations = np.arange(20_000) % 3
    own = PhotoPlace("own", replace(place.original_scan(), station=stations.astype(np.uint8)), [straight_view(0)])
    assert np.array_equal(own.scan(4).station, stations)


def two_walls():
    """A sparse red wall at 2 m in front of a dense blue one at 4 m, and a green photograph of them."""
    rng = np.random.default_rng(3)
    near, far = rng.uniform(-1.2, 1.2, (5000, 3)), rng.uniform(-3, 3, (30_000, 3))
    near[:, 2], far[:, 2] = -2, -4
    rgb = np.zeros((35_000, 3), np.uint8)
    rgb[:5000, 0], rgb[5000:, 2] = 200, 200
    picture = np.zeros((48, 64, 3), np.uint8)
    picture[..., 1] = 150
    picture[:, :, 0] = np.arange(64)  # a different green in each column
    view = MemoryPicture(picture, 60.0, np.eye(4))
    return MergedScan(np.concatenate([near, far]), rgb, np.zeros(35_000, np.uint8)), view


def test_points_in_front_have_the_photographs_colours_and_others_the_scans():
    scan, view = two_walls()
    place = PhotoPlace("walls", scan, [view])
    shown = place.views[0]
    seen = project_scan(scan, shown)
    made = place.photographed(seen, shown, 5, toned=False)
    near = seen.z < 3
    column = seen.index % 64
    assert near.sum() > 1000
    expected = torch.stack([column, torch.full_like(column, 150), torch.zeros_like(column)], 1)[near]
    assert (made.rgb[near] == expected).all(1).float().mean() > 0.97
    behind = (~near) & (column > 16) & (column < 48) & (seen.index // 64 > 12) & (seen.index // 64 < 36)
    hit = torch.bincount(seen.index[near], minlength=48 * 64)[seen.index] > 0
    assert (made.rgb[behind & hit] == seen.rgb[behind & hit]).all()  # behind another point of the pixel
    leaked = behind & ~hit
    assert leaked.any() and (made.rgb[leaked] == seen.rgb[leaked]).all(1).float().mean() > 0.85
    raster = raster_of(made, torch.ones(len(made.z), dtype=torch.bool), place.spacing)
    assert raster.depth.shape == (48, 64)
    spoiled = project_scan(place.scan(5), shown)
    plain, toned = (place.photographed(spoiled, shown, 5, toned=toned).rgb[near] for toned in (False, True))
    (tones, _), station = place._tones(5), spoiled.station[near].numpy()
    assert torch.equal(plain, made.rgb[near]) and len(set(station.tolist())) > 1
    taken = (plain != spoiled.rgb[near]).any(1).numpy()  # from the photograph
    assert np.array_equal(toned[taken], tones.apply(plain[taken].numpy(), station[taken])) and taken.mean() > 0.97
    assert len({int(toned[taken & (station == s), 1].median()) for s in set(station.tolist())}) > 1  # stations differ
    halved = place.photographed(project_scan(scan, shown, reduce=2), shown, 5, toned=False)
    assert (halved.rgb[halved.z < 3][:, 1] == 150).float().mean() > 0.95


def test_points_on_unusable_pixels_keep_the_scans_colours():
    scan, view = two_walls()
    usable = np.ones((48, 64), bool)
    usable[:, 32:] = False
    place = PhotoPlace("walls", scan, [replace(view, usable=usable)])
    seen = project_scan(scan, place.views[0])
    made = place.photographed(seen, place.views[0], 0, toned=False)
    hidden = seen.index % 64 >= 32
    assert (made.rgb[hidden] == seen.rgb[hidden]).all() and not (made.rgb[~hidden] == seen.rgb[~hidden]).all()
    known = place.views[0].known()
    assert known is not None and not known[:, 32:].any() and known[:, :32].all()


def test_only_the_place_used_last_keeps_its_scan():
    loads = []

    def load(name):
        loads.append(name)
        return wall_scan(2000)

    first, second = (PhotoPlace(name, lambda name=name: load(name), [straight_view(0)]) for name in "ab")
    for place in (first, first, second, second, first):
        place.original_scan()
    assert loads == ["a", "b", "a"]


def test_photographs_make_training_pairs():
    place = PhotoPlace("box", wall_scan(), [straight_view(1)])
    pairs = list(place_pairs(place, seed=2, scans=1, variants=2, preset="auto"))
    assert len(pairs) == 2
    for pair in pairs:
        assert pair.measured.shape == (6, 72, 96) and pair.truth.shape == (5, 72, 96)
        assert np.array_equal(pair.truth[:3].transpose(1, 2, 0), place.views[0].rgb()) and (pair.truth[4] == 255).mean() > 0.99
    dense = max(pairs, key=lambda pair: pair.where["density"])
    measured = dense.measured[3] > 0
    assert np.abs(dense.measured[:3] * 255 - dense.truth[:3])[:, measured].mean() < 25  # equal except for the tones


def test_the_neighbour_of_a_photographed_picture_has_the_photographs_colours(monkeypatch):
    """Otherwise a difference between scan and photograph would count as instability of the network."""
    monkeypatch.setattr("pointglass.model.data.pairs._density", lambda rng: 1.0)
    scan, lens = wall_scan(), Lens("PINHOLE", 96, 72, 60, 60, 48, 36)
    view = replace(straight_view(1), z=cast(rays_of(lens), look(1))[1].astype(np.float32))
    place = PhotoPlace("box", replace(scan, rgb=255 - scan.rgb), [view])
    (pair,) = place_pairs(place, seed=3, scans=1, variants=1, preset="auto", neighbours=True)
    assert pair.neighbour is not None and pair.flow is not None
    near, x = (filled_input(torch.from_numpy(shown.astype(np.float32)))[None] for shown in (pair.neighbour, pair.measured))
    flow = torch.from_numpy(pair.flow.astype(np.float32))[None]
    back = warp(near, flow)
    both = inside_flow(flow)[0, 0] & (back[0, 3] > 0.5) & (x[0, 3] > 0.5)
    apart, otherwise = (float((back - shown)[0, :3, both].abs().mean()) for shown in (x, 1 - x))
    assert both.sum() > 500 and apart < 0.2 * otherwise


def test_a_lens_without_a_fitting_pinhole_is_refused_naming_its_picture():
    lens = replace(LENSES[0], cy=-500.0)
    with pytest.raises(DataError, match=r"^room/bent\.png: .*no pinhole picture fits"):
        assert Photograph(Path("room/bent.png"), lens, np.eye(4)).fl
