"""Withheld points: their selection, their figures, and their absence from the pictures that they evaluate."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from pointglass.model.data.dataset import MemoryPicture, MergedScan
from pointglass.model.data.heldout import HELD_OUT, Targets, targets, visible
from pointglass.model.data.surfaces.projected import project_scan
from pointglass.model.evaluation.heldout import (
    LEAST_IN_GAPS,
    PointErrors,
    Viewpoint,
    Withheld,
    figures,
    high_pass,
    nearer,
    point_errors,
)
from pointglass.model.evaluation.heldout_report import format_withheld
from pointglass.model.evaluation.methods import TRUE, Method, plain_methods, soft_z

pytestmark = pytest.mark.usefixtures("one_thread")

WIDTH, HEIGHT, FOCAL, FAR = 160, 120, 120.0, 5.0
SPACING = FAR / FOCAL  # of the wall's points: one per pixel


def camera():
    """At the origin, looking along -z."""
    return MemoryPicture(np.broadcast_to(np.zeros(3, np.uint8), (HEIGHT, WIDTH, 3)), FOCAL, np.eye(4))


def texture(u, v):
    """(..., 3) in 0..1 at pixels u, v: waves of 13 to 25 pixels."""
    return 0.5 + 0.2 * np.stack([np.sin(u / 3.0), np.cos(v / 4.0), np.sin((u + v) / 2.5)], -1)


def true_picture():
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    return torch.from_numpy(texture(u, v)).permute(2, 0, 1).float()


def wall(count, noise, seed=0):
    """Points of a textured wall that fills the picture, of colours with noise of this standard deviation (of 1)."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(0, WIDTH, count), rng.uniform(0, HEIGHT, count)
    colour = texture(np.floor(u) + 0.5, np.floor(v) + 0.5) + noise * rng.normal(size=(count, 3))
    xyz = np.stack([(u - WIDTH / 2) / FOCAL * FAR, -(v - HEIGHT / 2) / FOCAL * FAR, np.full(count, -FAR)], 1)
    return MergedScan(xyz, np.rint(255 * colour.clip(0, 1)).astype(np.uint8), np.zeros(count, np.uint8))


def fixed(name, picture):
    return Method(name, lambda _sight: picture, None)


def judged(scan, methods, **options):
    work = Withheld(scan, SPACING, methods, (1.0,), **options)
    work.judge(Viewpoint("wall", camera()))
    return {row["method"]: row for row in work.rows()}


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_the_psnr_of_the_true_picture_is_the_noise_of_the_points(noise):
    rows = judged(wall(150_000, noise), [fixed("true", true_picture())])
    expected = -10 * np.log10(noise**2 + 1 / 12 / 255**2)  # and rounding to bytes
    assert rows["true"]["psnr"] == pytest.approx(expected, abs=0.15)
    assert rows["true"]["slope"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("contrast", [0.5, 0.8, 1.5])
def test_the_slope_is_the_factor_of_the_missing_contrast(contrast):
    shown = 0.5 + contrast * (true_picture() - 0.5)
    row = judged(wall(100_000, 0.05), [fixed("shown", shown)])["shown"]
    assert row["slope"] == pytest.approx(1 / contrast, rel=0.03)


def test_noise_of_the_picture_lowers_the_slope_but_noise_of_the_points_does_not():
    noisy = true_picture() + 0.1 * torch.randn(3, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(3))
    rows = judged(wall(150_000, 0.2), [fixed("true", true_picture()), fixed("noisy", noisy)])
    assert rows["true"]["slope"] == pytest.approx(1.0, abs=0.05) and 0.4 < rows["noisy"]["slope"] < 0.85


def test_points_behind_a_surface_with_gaps_are_not_used():
    back = wall(100_000, 0.0)
    rng = np.random.default_rng(5)
    near = 2.0
    columns, rows = np.meshgrid(np.arange(40, 120, 3.0), np.arange(30, 90, 3.0))
    u, v = (part.ravel() + rng.uniform(0, 1, part.size) for part in (columns, rows))
    front = np.stack([(u - WIDTH / 2) / FOCAL * near, -(v - HEIGHT / 2) / FOCAL * near, np.full(len(u), -near)], 1)
    count = len(front)
    scan = MergedScan(np.concatenate([back.xyz, front]), np.concatenate([back.rgb, np.full((count, 3), 200, np.uint8)]),
                np.zeros(len(back.xyz) + count, np.uint8))
    seen = project_scan(scan, camera())
    row, column = np.divmod(seen.index.numpy(), WIDTH)
    inside = (column > 44) & (column < 114) & (row > 34) & (row < 84)
    behind = inside & (seen.z.numpy() > 3.0)
    shown = visible(seen, soft_z(SPACING)).numpy()
    assert behind.sum() > 10_000 and not (shown & behind).any()
    assert (shown & inside & ~behind).sum() > 0.95 * (inside & ~behind).sum()
    beside = (column < 34) | (column > 124)
    assert shown[beside].mean() > 0.95  # the wall beside it


def test_black_points_without_a_colour_are_not_used():
    scan = wall(50_000, 0.0)
    scan.rgb[::3] = 0
    seen = project_scan(scan, camera())
    wanted = targets(seen, torch.ones(len(seen.z), dtype=torch.bool), soft_z(SPACING, unlit=True))
    assert wanted.rgb.any(1).all() and len(wanted.index) > 20_000
    assert len(targets(seen, torch.ones(len(seen.z), dtype=torch.bool), soft_z(SPACING)).index) > len(wanted.index)


def test_the_high_pass_subtracts_a_gaussian_mean_of_the_points():
    rng = np.random.default_rng(7)
    shape, sigma = (30, 40), 2.0
    index, values = rng.integers(0, shape[0] * shape[1], 300), rng.random((300, 2))
    rows, columns = np.divmod(index, shape[1])
    expected = np.empty_like(values)
    for k in range(300):
        down, across = rows - rows[k], columns - columns[k]
        weight = np.exp(-(down**2 + across**2) / (2 * sigma**2)) * (np.maximum(np.abs(down), np.abs(across)) <= 3 * sigma)
        expected[k] = values[k] - weight @ values / weight.sum()
    assert np.allclose(high_pass(values, index, shape, sigma), expected, atol=1e-5)


def test_pictures_are_made_without_the_withheld_points():
    scan, shown = wall(60_000, 0.02), []

    def look(view_points):
        shown.append(view_points.seen)
        return view_points.raster.colour / 255

    work = Withheld(scan, SPACING, [Method("look", look, None)], (1.0, 0.2))
    wanted = work.judge(Viewpoint("wall", camera())).wanted
    counts = [len(seen.point) for seen in shown]
    assert all(not np.isin(seen.point.numpy(), wanted.point.numpy()).any() for seen in shown)
    assert counts == pytest.approx([0.9 * 60_000, 0.18 * 60_000], rel=0.03)
    assert len(wanted.point) == pytest.approx(HELD_OUT * 60_000, rel=0.1)


def test_a_withheld_station_is_evaluated_at_its_points_only():
    scan = wall(60_000, 0.0)
    station = (np.random.default_rng(2).random(60_000) < 0.3).astype(np.uint8)
    scan = MergedScan(scan.xyz, scan.rgb, station, np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]))
    shown = []

    def look(view_points):
        shown.append(view_points.seen)
        return view_points.raster.colour / 255

    work = Withheld(scan, SPACING, [Method("look", look, None)], (1.0,))
    wanted = work.judge(Viewpoint("station-2", camera(), station=1)).wanted
    assert (scan.station[wanted.point.numpy()] == 1).all() and len(wanted.point) > 0.9 * station.sum()
    assert (shown[0].station == 0).all() and len(shown[0].point) == (station == 0).sum()
    assert work.rows()[0]["withheld"] == "station 2"


def test_gaps_are_evaluated_separately():
    scan = wall(8_000, 0.0)  # four of ten pixels have a point
    true = true_picture()
    row = judged(scan, [fixed("true", true)])["true"]
    assert 0.3 < row["gaps"] < 0.9 and row["psnr_gaps"] == pytest.approx(row["psnr"], abs=1.0)
    few = PointErrors(np.full(500, 0.01), np.ones(500), np.ones(500), np.arange(500) < LEAST_IN_GAPS - 1)
    assert np.isnan(figures([few])["psnr_gaps"]) and figures([few])["psnr"] == pytest.approx(20.0)


def test_figures_are_split_by_local_noise():
    quiet, noisy = wall(60_000, 0.01, seed=1), wall(60_000, 0.1, seed=2)
    left, right = quiet.xyz[:, 0] < 0, noisy.xyz[:, 0] >= 0
    scan = MergedScan(np.concatenate([quiet.xyz[left], noisy.xyz[right]]), np.concatenate([quiet.rgb[left], noisy.rgb[right]]),
                np.zeros(left.sum() + right.sum(), np.uint8))

    def level(xyz, luma):
        assert len(xyz) == len(luma) and luma.min() >= 0 and 0.5 < luma.max() <= 1.0001
        return np.where(xyz[:, 0] < 0, 0.01, 0.1)

    row = judged(scan, [fixed("true", true_picture())], noise=SimpleNamespace(at=level))["true"]
    values = [(part["sigma"], part["psnr"]) for part in row["noise"]]
    assert values[0][0] < 0.02 and values[0][1] > 35 and values[-1][1] < 24
    text = format_withheld({"scan": "a.laz", "points": 1, "withheld": 0.1, "views": ["x"], "size": [1, 1], "rows": [row]})
    assert "by the noise level" in text and "compare pictures, not scans" in text


def test_the_nearer_picture_is_told_by_colour():
    true, grey = true_picture(), torch.full((3, HEIGHT, WIDTH), 0.5)
    left = torch.arange(WIDTH) < WIDTH // 2
    filled, neural = torch.where(left, true, grey), torch.where(left, grey, true)
    seen = project_scan(wall(100_000, 0.02), camera())
    wanted = Targets(seen.index, seen.rgb, seen.point)
    sheet = nearer(filled, neural, wanted).astype(int)
    warm = sheet[..., 0] - sheet[..., 2]
    assert (warm[:, :70] > 60).mean() > 0.9 and (warm[:, 90:] < -60).mean() > 0.9


def test_raw_and_filled_are_judged_as_the_evaluation_makes_them():
    scan = wall(60_000, 0.03)
    rows = judged(scan, [method for method in plain_methods() if method.mask != TRUE])
    assert {"raw", "pull-push, our filter"} <= set(rows)
    assert rows["pull-push, our filter"]["psnr"] > rows["raw"]["psnr"] + 1
    wanted = targets(project_scan(scan, camera()), torch.ones(60_000, dtype=torch.bool), soft_z(SPACING))
    errors = point_errors(true_picture(), wanted, torch.zeros(HEIGHT, WIDTH, dtype=torch.bool))
    assert figures([errors])["points"] == len(wanted.index)
