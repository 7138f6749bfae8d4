"""The evaluation's figures agree with hand computation: of a picture, of matched exposures."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from evaluation_files import rgb_of
from scipy.io import loadmat

import pointglass.model.evaluation.room_scores as scene_module
from pointglass.model.appearance.exposure import exposures_of, match_exposures
from pointglass.model.data.dataset import MergedScan
from pointglass.model.data.stations import ScanModel, load_scene, scan_stations
from pointglass.model.data.surfaces.projected import Projected, picture, project_scan
from pointglass.model.evaluation.methods import TRUE, thinned, true_visibility
from pointglass.model.evaluation.metrics.figures import Truth
from pointglass.model.evaluation.metrics.image_metrics import gradient_energy, masked_error, masked_psnr, ssim
from pointglass.model.evaluation.metrics.perceptual import SQUEEZE_FILES, SqueezeDistance
from pointglass.model.evaluation.room_scores import matched_colours
from pointglass.model.evaluation.rooms.view_scores import column_means

pytestmark = pytest.mark.usefixtures("one_thread")


def test_ssim_is_that_of_a_plain_window():
    generator = torch.Generator().manual_seed(1)
    a = torch.rand(1, 14, 17, generator=generator).double()
    b = (a + 0.2 * torch.rand(1, 14, 17, generator=generator)).clamp(0, 1)
    offsets = np.arange(11) - 5
    one = np.exp(-(offsets**2) / 4.5)
    kernel = np.outer(one, one) / one.sum() ** 2
    values = []
    for y in range(4):
        for x in range(7):
            p, q = (t[0, y : y + 11, x : x + 11].numpy() for t in (a, b))
            mp, mq = (kernel * p).sum(), (kernel * q).sum()
            vp, vq, c = (kernel * p * p).sum() - mp**2, (kernel * q * q).sum() - mq**2, (kernel * p * q).sum() - mp * mq
            values.append((2 * mp * mq + 1e-4) * (2 * c + 9e-4) / ((mp**2 + mq**2 + 1e-4) * (vp + vq + 9e-4)))
    assert ssim(a, b) == pytest.approx(np.mean(values), abs=1e-12)
    assert Truth(b.float().expand(3, -1, -1), None).similarity(a.expand(3, -1, -1)) == pytest.approx(np.mean(values), abs=1e-5)


def test_figures_over_invented_pixels_agree_with_hand_computation():
    truth, made = torch.full((3, 12, 12), 0.5), torch.full((3, 12, 12), 0.5)
    invented = torch.zeros(12, 12, dtype=torch.bool)
    invented[:4, :3] = True
    made[:, :4, :3] += 0.1  # 12 pixels off by 0.1, another that is measured by 0.4
    made[:, 11, 11] += 0.4
    figures = Truth(truth, None).figures(made, invented)
    assert figures.invented_psnr == pytest.approx(20.0, abs=1e-4) and figures.invented_error == pytest.approx(0.1, abs=1e-6)
    assert figures.invented == pytest.approx(12 / 144)
    assert figures.psnr == pytest.approx(-10 * np.log10((12 * 0.01 + 0.16) / 144), abs=1e-4)
    none = torch.zeros(12, 12, dtype=torch.bool)
    assert np.isnan(masked_psnr(made, truth, none)) and np.isnan(masked_error(made, truth, none))
    assert np.isnan(figures.distance)


def test_gradient_energy_counts_both_directions():
    ramp = torch.linspace(0, 1, 11).expand(3, 5, 11)
    assert [gradient_energy(ramp), gradient_energy(ramp.transpose(1, 2))] == pytest.approx([0.1, 0.1])
    assert gradient_energy(ramp + torch.linspace(0, 2, 5)[:, None]) == pytest.approx(0.1 + 0.5)


def test_what_a_mask_keeps_and_lets_through_is_judged_by_what_can_be_told(seed):
    rng = np.random.default_rng(seed)
    mask, visible, hidden = (torch.from_numpy(rng.random((20, 30)) < 0.5) for _ in range(3))
    hidden &= ~visible  # the rest is too close to call
    view = SimpleNamespace(masks={TRUE: visible, "hidden": hidden})
    kept, leaked = scene_module._mask_shares(mask, view)  # type: ignore[arg-type]
    both, through = int((mask & visible).sum()), int((mask & hidden).sum())
    assert kept == pytest.approx(both / int(visible.sum())) and leaked == pytest.approx(through / (both + through))
    assert np.isnan(scene_module._mask_shares(None, view)).all()  # type: ignore[arg-type]


def test_points_are_visible_or_hidden_by_what_is_true_around_them(seed):
    """A hundredth and a centimetre behind is still there, two and three are not; in between nobody can tell."""
    rng = np.random.default_rng(seed)
    true = rng.choice([2.0, 2.5, 10.0, np.inf], (14, 17), p=[0.5, 0.3, 0.19, 0.01])
    near = rng.choice([2.0, 2.5, 10.0], true.shape) * rng.uniform(0.98, 1.04, true.shape)
    depth = np.where(rng.random(true.shape) < 0.2, np.inf, near)
    visible, hidden = true_visibility(torch.from_numpy(depth), torch.from_numpy(true))
    for j, i in np.ndindex(*true.shape):
        farthest = true[max(j - 1, 0) : j + 2, max(i - 1, 0) : i + 2].max()
        there = np.isfinite(depth[j, i])
        assert visible[j, i] == (there and depth[j, i] <= farthest * 1.01 + 0.01)
        assert hidden[j, i] == (there and depth[j, i] > farthest * 1.02 + 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("density", [1.0, 0.25])
def test_fewer_points_are_judged_with_their_own_spacing(room, monkeypatch, density):
    given, view_points = [], scene_module.view_points
    monkeypatch.setattr(scene_module, "view_points", lambda seen, depth, spacing, *masks, **more: (
        given.append(spacing), view_points(seen, depth, spacing, *masks, **more))[1])
    scene_module.evaluate(room, densities=(density,), views=1, open3d=False)
    spacing = scene_module.scan_spacing(scan_stations(load_scene(room), 11)) / density**0.5
    assert len(given) == 1 + 4 and given == pytest.approx([spacing] * 5), "a view and the frames of the path"


def test_means_over_views_leave_out_what_a_view_does_not_have():
    nan = float("nan")
    means = column_means(np.array([[1.0, nan, nan, 2.0], [3.0, 5.0, nan, float("inf")]]))
    assert means[:2] == [2.0, 5.0] and np.isnan(means[2]) and means[3] == float("inf")


def _plain_squeeze(folder: Path, picture: np.ndarray) -> list[np.ndarray]:
    """Maps of unit features (H, W, C) of a picture (H, W, 3) 0..1: SqueezeNet 1.1 as its paper and Caffe's file have it."""
    stored = loadmat(str(folder / SQUEEZE_FILES[0]))

    def convolved(x, name, stride=1):
        weight, bias = stored[name][0]
        side = weight.shape[0]
        x = np.pad(x, ((1, 1), (1, 1), (0, 0))) if "expand3x3" in name else x
        windows = np.lib.stride_tricks.sliding_window_view(x, (side, side), (0, 1))[::stride, ::stride]
        return np.maximum(np.einsum("hwcij,ijco->hwo", windows, weight, optimize=True) + bias.ravel(), 0)

    def pooled(x):  # the last window may hang over the border
        rows, columns = (range(0, n - 1, 2) for n in x.shape[:2])
        return np.array([[x[i : i + 3, j : j + 3].max((0, 1)) for j in columns] for i in rows])

    x = convolved(picture[..., ::-1] * 255 - (104, 117, 123), "conv1", 2)  # blue, green, red, less ImageNet's means
    maps = [x]
    for fire in range(2, 10):
        x = pooled(x) if fire in (2, 4, 6) else x
        x = convolved(x, f"fire{fire}/squeeze1x1")
        x = np.concatenate([convolved(x, f"fire{fire}/expand1x1"), convolved(x, f"fire{fire}/expand3x3")], 2)
        maps += [x] if fire in (3, 5, 6, 7, 8, 9) else []
    return [m / np.linalg.norm(m, axis=2, keepdims=True) for m in maps]


def test_the_distance_is_that_of_the_network_written_out(squeeze):
    generator = torch.Generator().manual_seed(4)
    pictures = torch.rand(2, 2, 3, 44, 50, generator=generator)  # sides that every pooling cuts unevenly somewhere
    heads = torch.load(squeeze / SQUEEZE_FILES[1], weights_only=True)
    expected = 0.0
    for a, b in zip(*(p.permute(0, 2, 3, 1).double().numpy() for p in pictures), strict=True):
        for k, (p, q) in enumerate(zip(_plain_squeeze(squeeze, a), _plain_squeeze(squeeze, b), strict=True)):
            head = heads[f"lin{k}.model.1.weight"].numpy().ravel()
            expected += ((p - q) ** 2 @ head).mean() / len(pictures[0])
    with torch.inference_mode():
        assert float(SqueezeDistance(squeeze).eval()(*pictures)) == pytest.approx(expected, rel=1e-4)


def test_the_distance_to_a_truth_whose_features_are_kept_is_the_distance(squeeze):
    distance = SqueezeDistance(squeeze).eval()
    generator = torch.Generator().manual_seed(2)
    truth, made = torch.rand(2, 3, 40, 48, generator=generator)
    invented = torch.rand(40, 48, generator=generator) < 0.3
    judge = Truth(truth, distance)
    with torch.inference_mode():
        whole = float(distance(made[None], truth[None]))
        composed = float(distance(torch.where(invented, made, truth)[None], truth[None]))
    figures = judge.figures(made, invented)
    assert figures.distance == pytest.approx(whole, rel=1e-4) and whole > 0
    assert figures.invented_distance == pytest.approx(composed, rel=1e-4) and composed < whole
    assert judge.gap(truth) == pytest.approx(0, abs=1e-6)


def test_matching_undoes_known_gains_and_is_what_opening_does(room):
    scene = load_scene(room)
    clean = scan_stations(scene, 1, ScanModel(0, 0, 0, 0, 0, 0, 0, 0))
    gains = np.array([[1.08], [0.92]])
    dimmed = MergedScan(clean.xyz, np.clip(np.rint(clean.rgb * gains[clean.station]), 0, 255).astype(np.uint8), clean.station)
    solved = exposures_of(dimmed.xyz, dimmed.rgb, dimmed.station)
    assert solved.matched.all()
    undone = matched_colours(torch.from_numpy(dimmed.rgb), torch.from_numpy(dimmed.station), solved.gains).numpy()
    assert np.array_equal(undone, match_exposures(dimmed.xyz, dimmed.rgb, dimmed.station))
    middling = (clean.rgb > 20).all(1) & (clean.rgb < 220).all(1)
    before, after = (np.abs(rgb[middling].astype(float) - clean.rgb[middling]).mean() for rgb in (dimmed.rgb, undone))
    assert after < 0.35 * before


@pytest.fixture(scope="module")
def seen(room) -> tuple[Projected, torch.Tensor, float]:
    scene = load_scene(room)
    scan = scan_stations(scene, 1)
    left = thinned(project_scan(scan, scene.views[0], 1), 0.5)
    return left, rgb_of(SimpleNamespace(rgb=lambda: scene.views[0].rgb().copy())), scene_module.scan_spacing(scan) / 0.5**0.5


def _scaled(seen, scale: float) -> torch.Tensor:
    """(5, H, W) network input with the scan in other units."""
    points, _, spacing = seen
    other = replace(points, z=points.z * torch.tensor(scale, dtype=points.z.dtype))
    return picture(other, torch.ones(len(points.z), dtype=torch.bool), spacing * scale, "auto")


@pytest.mark.parametrize("scale, pixels", [(2.0**-10, 0), (2.0**10, 0), (1e-3, 4), (1e3, 4)])
def test_the_unit_of_a_scan_changes_nothing_that_a_network_sees(seen, scale, pixels):
    """To the bit for powers of two; but for rounding ties of the filter and the soft z-buffer for others."""
    metres, other = (_scaled(seen, s) for s in (1.0, scale))
    differs = (metres - other).abs() > (0 if pixels == 0 else 1e-5)
    assert int(differs.any(0).sum()) <= pixels
    assert metres[4].abs().max() > 0.1
