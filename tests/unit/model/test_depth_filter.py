"""The depth filter in torch, without OpenGL: kept pixels, dropped pixels, and independence of units."""

import numpy as np
import pytest
import torch

from pointglass.model.data.surfaces.projected import project_scan
from pointglass.model.evaluation.methods import true_visibility
from pointglass.model.reference.depth_filter import keep_mask
from pointglass.model.reference.projection import SoftZ, rasterise
from pointglass.model.reference.pyramid import bilinear, half, parents, quads

SIZE = (240, 320)


def two_layers(front_share: float, near: float, far: float, seed: int, scale: float = 1.0):
    """A near plane covering the left two thirds at ``front_share`` points a pixel, a dense far plane behind it all.
    Returns depth (H, W), and which pixels show near, leaked far and open far."""
    rng = np.random.default_rng(seed)
    w = SIZE[1]
    front = (rng.random(SIZE) < front_share) & (np.arange(w) < 2 * w // 3)
    depth = np.where(front, near, far).astype(np.float32)
    covered = np.broadcast_to(np.arange(w) < 2 * w // 3, SIZE)
    return torch.from_numpy(depth * np.float32(scale)), front, covered & ~front, ~covered


@pytest.mark.parametrize("share", [0.9, 0.5, 0.2, 0.1])
@pytest.mark.parametrize("distance", [1.0, 8.0, 60.0])
def test_auto_drops_hidden_points_and_keeps_visible_ones(share, distance):
    depth, near, leaked, open_far = two_layers(share, distance, 1.5 * distance, seed=3)
    keep = keep_mask(depth).numpy()
    assert keep[near].all()
    assert keep[leaked].mean() < {0.9: 0.03, 0.5: 0.05, 0.2: 0.08, 0.1: 0.25}[share]
    assert keep[open_far].mean() > 0.97  # also beside the silhouette


@pytest.mark.parametrize("distance", [2.0, 10.0, 40.0, 60.0])
def test_auto_keeps_a_plain_floor_at_any_distance(distance):
    """A plane is affine in inverse depth, so a dense floor at a grazing angle must be kept completely."""
    h = SIZE[0]
    rows = np.arange(h)[:, None] + 0.5
    inverse = np.broadcast_to((rows / h) * 0.9 + 0.1, SIZE) / distance
    assert keep_mask(torch.from_numpy((1 / inverse).astype(np.float32))).float().mean() > 0.999


@pytest.mark.parametrize("preset", ["auto", "paper-text"])
@pytest.mark.parametrize("scale", [2.0**-12, 2.0**10, 1e-3, 1e6])
def test_scale_changes_no_pixel(preset, scale):
    """Exactly for powers of two, and up to rounding ties for other scales."""
    reference = keep_mask(two_layers(0.3, 2.0, 3.0, 5)[0], preset)
    scaled = keep_mask(two_layers(0.3, 2.0, 3.0, 5, scale)[0], preset)
    assert (reference != scaled).sum() <= (0 if np.log2(scale) % 1 == 0 else 2)


def test_a_smaller_strength_keeps_fewer():
    rng = np.random.default_rng(1)
    depth = torch.from_numpy((2 + 0.06 * rng.random(SIZE)).astype(np.float32))
    for preset in ("auto", "paper-code", "paper-text", "npbg++"):
        kept = [int(keep_mask(depth, preset, strength=s).sum()) for s in (0.1, 1.0, 10.0)]
        assert kept[0] <= kept[1] <= kept[2] and kept[0] < kept[2], preset


@pytest.mark.parametrize("preset", ["auto", "paper-code", "paper-text", "npbg++", "off"])
def test_empty_pixels_stay_empty_and_a_single_point_is_kept(preset):
    depth = torch.full(SIZE, torch.inf)
    assert not keep_mask(depth, preset).any()
    depth[100, 77] = 3.0
    assert keep_mask(depth, preset).nonzero().tolist() == [[100, 77]]


def barred(seed: int, gap: float, spacing: int = 10, width: int = 3):
    """Depth of a dense wall at 4 behind dense vertical bars, nearer by the share ``gap``; and where the bars are."""
    shift = np.random.default_rng(seed).integers(spacing)
    bars = np.broadcast_to((np.arange(SIZE[1]) + shift) % spacing < width, SIZE)
    return torch.from_numpy(np.where(bars, 4.0 * (1 - gap), 4.0).astype(np.float32)), bars


@pytest.mark.parametrize("gap", [0.03, 0.06, 0.12])
def test_a_wall_close_behind_thin_dense_bars_is_kept(seed, gap):
    """In blocks of four pixels each has a bar, and they look like a sparse surface: without the rule for clumped points more
    than half of the wall would go."""
    depth, bars = barred(seed, gap)
    keep = keep_mask(depth).numpy()
    assert keep[bars].all() and keep[~bars].mean() > 0.9


def test_a_dense_surface_is_not_hidden_by_a_few_nearer_points_around_it(seed):
    """A column 5 % behind single points of other things: they are no surface, at any level."""
    rng = np.random.default_rng(seed)
    depth = np.full(SIZE, 9.0, np.float32)
    floating = rng.random(SIZE) < 1 / 700
    depth[floating] = rng.uniform(8.4, 8.8, floating.sum())
    keep = keep_mask(torch.from_numpy(depth)).numpy()
    assert keep.mean() > 0.99


def test_rows_of_points_a_metre_away_hide_what_is_far_behind(seed):
    """A scanner's rows on a near surface are clumped, and still a surface."""
    shift = np.random.default_rng(seed).integers(8)
    rows = np.broadcast_to(((np.arange(SIZE[0]) + shift) % 8 == 0)[:, None], SIZE)
    keep = keep_mask(torch.from_numpy(np.where(rows, 1.0, 5.0).astype(np.float32))).numpy()
    assert keep[rows].all() and keep[8:-8][~rows[8:-8]].mean() < 0.02


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (5, 4), (13, 31)])
def test_pyramid_steps_equal_a_plain_loop(shape):
    rng = np.random.default_rng(0)
    image = torch.from_numpy(rng.random(shape))
    h, w = half(shape[0]), half(shape[1])
    a, b, c, d = quads(image, -1.0)
    for y in range(h):
        for x in range(w):
            block = [image[2 * y + j, 2 * x + i] if 2 * y + j < shape[0] and 2 * x + i < shape[1] else -1.0
                     for j in (0, 1) for i in (0, 1)]
            assert [float(q[y, x]) for q in (a, b, c, d)] == [float(v) for v in block]
    coarse = torch.from_numpy(rng.random((h, w)))
    fine, own = bilinear(coarse, *shape), parents(coarse, *shape)
    for y in range(shape[0]):
        for x in range(shape[1]):
            assert own[y, x] == coarse[y // 2, x // 2]
            ny = min(max(y // 2 + (1 if y % 2 else -1), 0), h - 1)
            nx = min(max(x // 2 + (1 if x % 2 else -1), 0), w - 1)
            py, px = y // 2, x // 2
            expected = (9 * coarse[py, px] + 3 * coarse[py, nx] + 3 * coarse[ny, px] + coarse[ny, nx]) / 16
            assert abs(float(fine[y, x] - expected)) < 1e-12


@pytest.mark.slow
def test_auto_is_above_the_papers_filter_on_real_rooms(registered_scan):
    """Against true visibility at densities from 100 % to 3 %: F1 of kept and dropped pixels, the mean of two rooms."""
    scores: dict[tuple[str, float], list[float]] = {}
    for room, number in (("living-room-2", 0), ("kitchen", 14)):
        scene, scan = registered_scan(room)
        shot = scene.views[number]
        seen = project_scan(scan, shot)
        truth = torch.from_numpy(shot.depth())
        for density in (1.0, 0.3, 0.1, 0.03):
            keep = seen.rank < density
            soft = SoftZ(1 / 128, 0.005 / density**0.5)
            raster = rasterise(seen.index[keep], seen.z[keep], seen.rgb[keep], shot.width, shot.height, soft)
            visible, hidden = true_visibility(raster.depth, truth)
            for preset in ("auto", "paper-code"):
                kept = keep_mask(raster.depth, preset)
                hits, leaks, lost = (kept & visible).sum(), (kept & hidden).sum(), (~kept & visible).sum()
                scores.setdefault((preset, density), []).append(float(2 * hits / (2 * hits + leaks + lost)))
    for density in (1.0, 0.3, 0.1, 0.03):
        assert np.mean(scores["auto", density]) > np.mean(scores["paper-code", density]), (density, scores)


@pytest.mark.parametrize("share", [0.15, 0.3])
def test_hidden_points_are_dropped_up_to_the_border(seed, share):
    """A sparse slanted wall in front of another, in a cropped and in the full picture."""
    rng = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(260), np.arange(220))
    depth = np.where(rng.random(i.shape) < share, 2.0 + 0.002 * i + 0.001 * j, 4.0 + 0.003 * j).astype(np.float32)
    inner = slice(30, 190), slice(30, 230)
    whole, cut = (keep_mask(torch.from_numpy(d)).numpy() for d in (depth, np.ascontiguousarray(depth[inner])))
    whole, behind = whole[inner], depth[inner] > 3.5
    outer = np.ones(cut.shape, bool)
    outer[4:-4, 4:-4] = False
    assert (cut & behind & ~whole)[outer].sum() < 0.1 * outer.sum()  # 44 to 78 % without mirroring
    assert (cut & ~behind)[outer].sum() > 0.97 * (whole & ~behind)[outer].sum()
