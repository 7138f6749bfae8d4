"""Textures painted onto a place: points and true views agree at every scale."""

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from untyped import any_typed

from pointglass.model.common.errors import DataError
from pointglass.model.data.dataset import MemoryPicture, MergedScan
from pointglass.model.data.surfaces.diffuse import diffuse
from pointglass.model.data.surfaces.painting import (
    SIDE,
    Painting,
    load_textures,
    make_painting,
    mip_levels,
    paint_picture,
    painted,
)
from pointglass.model.data.surfaces.projected import project_scan

POSE = np.diag([1.0, -1.0, -1.0, 1.0])  # looks along +z, OpenGL axes


def sheet(folder, count: int, rng) -> None:
    """A thumbnail sheet as ambientCG's: textures at (16, 16), 144 apart, the last cell white."""
    picture = np.full((208, 1024, 3), 255, np.uint8)
    for column in range(count):
        picture[16:144, 16 + 144 * column : 144 + 144 * column] = rng.integers(0, 200, (128, 128, 3))
    Image.fromarray(picture).save(folder / "Noise.webp", lossless=True)


def stripes(texel: float, contrast: float = 1.0) -> Painting:
    """One sphere of radius 10 at the origin, striped along x: one texel light, the next dark."""
    texture = np.zeros((SIDE, SIDE, 3), np.uint8) + np.where(np.arange(SIDE) % 2, 200, 80).astype(np.uint8)[None, :, None]
    mips = np.minimum(mip_levels(texture) ** contrast, 1.8)[None].astype(np.float32)
    tile = texel * SIDE
    return Painting(np.zeros((1, 3)), np.array([10.0]), np.array([[1 / tile, 0, 0]]), np.array([[0, 1 / tile, 0]]),
                    np.array([texel]), mips)


def test_sheets_are_cut_into_textures_without_white_cells(tmp_path):
    rng = np.random.default_rng(1)
    sheet(tmp_path, 3, rng)
    found = load_textures(tmp_path)
    assert len(found) == 3 and all(texture.shape == (SIDE, SIDE, 3) for texture in found)
    (tmp_path / "none").mkdir()
    with pytest.raises(DataError, match=r"none: no thumbnail sheets"):
        load_textures(tmp_path / "none")


def test_a_texture_preserves_mean_light_and_its_mips_are_box_means(seed):
    texture = np.random.default_rng(seed).integers(0, 256, (SIDE, SIDE, 3)).astype(np.uint8)
    levels = mip_levels(texture)
    assert np.allclose(levels[0].mean((0, 1)), 1, atol=1e-4)
    for level in range(1, len(levels)):
        side = SIDE >> level
        finer = levels[level - 1, : 2 * side, : 2 * side].reshape(side, 2, side, 2, 3).mean((1, 3))
        assert np.allclose(levels[level, :side, :side], finer, atol=1e-5)


def test_a_point_samples_its_texel_and_a_wide_beam_the_mean():
    painting = stripes(0.01)
    x = (np.arange(40) + 0.5) * 0.01
    at = np.stack([x, np.zeros(40), np.zeros(40)], 1)
    fine, wide = painting.gain(at, np.full(40, 1e-4)), painting.gain(at, np.full(40, 1.0))
    assert np.allclose(fine[::2, 0], fine[0, 0]) and np.allclose(fine[1::2, 0], fine[1, 0]) and fine[1, 0] > 3 * fine[0, 0]
    assert np.ptp(wide) < 0.02, "what a beam cannot resolve is grey"
    outside = painting.gain(at + (0, 0, 20.0), np.full(40, 1e-4))
    assert (outside == 1).all()


@pytest.mark.slow
def test_points_and_true_view_agree_where_the_texture_is_resolved(seed):
    """A wall seen frontally: the mean of a pixel's points equals the pixel at any scale of the texture."""
    rng = np.random.default_rng(seed)
    texel = float(np.exp(rng.uniform(np.log(0.005), np.log(0.2))))
    painting, z, size, fl = stripes(texel), 2.0, 48, 40.0
    picture = MemoryPicture(np.full((size, size, 3), 128, np.uint8), fl, POSE, np.full((size, size), z, np.float32))
    true = paint_picture(painting, picture)
    inside = rng.uniform(0, size, (200_000, 2))
    xyz = np.column_stack([(inside - size / 2) / fl * z, np.full(len(inside), z)])
    gain = painting.gain(xyz, np.full(len(xyz), 1e-4))
    index = inside[:, 1].astype(int) * size + inside[:, 0].astype(int)
    mean = np.bincount(index, gain[:, 0].astype(float), size * size) / np.maximum(np.bincount(index, minlength=size * size), 1)
    drawn = painted(np.full((size * size, 3), 128, np.uint8), np.repeat(mean[:, None], 3, 1).astype(np.float32))
    apart = np.abs(true.reshape(-1, 3).astype(int) - drawn)[:, 0]
    assert np.median(apart) <= 6 and (texel < 0.1 or true.std() > 10), f"texel {texel:.3f}"


def test_a_painting_covers_part_of_a_place(seed):
    rng = np.random.default_rng(seed)
    textures = [rng.integers(0, 256, (SIDE, SIDE, 3)).astype(np.uint8) for _ in range(3)]
    xyz = rng.uniform(-3, 3, (50_000, 3))
    gain = make_painting(textures, xyz, rng).gain(xyz, np.full(len(xyz), 0.002))
    share = float((gain != 1).any(1).mean())
    assert 0.02 < share <= 1 and 0.5 < gain.mean() < 1.3 and gain.max() <= 1.81


def test_diffuse_points_on_visible_surfaces_have_the_true_colours():
    size, fl = 40, 40.0
    true = np.random.default_rng(2).integers(0, 256, (size, size, 3)).astype(np.uint8)
    shot = MemoryPicture(true, fl, POSE, np.full((size, size), 3.0, np.float32))
    rows, columns = (part.ravel() for part in np.mgrid[0:size, 0:size])
    parts = []
    for z in (3.0, 3.01, 2.5, 4.0):
        across, down = (columns + 0.5 - size / 2) / fl * z, (rows + 0.5 - size / 2) / fl * z
        parts.append(np.column_stack([across, down, np.full(size**2, z)]))
    xyz = np.concatenate(parts)
    scan = MergedScan(xyz, np.full((len(xyz), 3), 7, np.uint8), np.zeros(len(xyz), np.uint8))
    made = diffuse(project_scan(scan, shot), scan, shot)
    on = scan.xyz[made.point.numpy(), 2] < 3.02
    on &= scan.xyz[made.point.numpy(), 2] > 2.9
    assert np.array_equal(made.rgb.numpy()[on], true.reshape(-1, 3)[made.index.numpy()[on]])
    assert on.sum() == 2 * size**2 and (made.rgb.numpy()[~on] == 7).all()
    lens = ("width", "height", "fl", "cx", "cy", "camera_to_world")
    unknown = SimpleNamespace(**{name: getattr(shot, name) for name in lens}, depth=lambda: None)
    assert diffuse(project_scan(scan, shot), scan, any_typed(unknown)).rgb.unique().tolist() == [7]
