"""The pass that tells the network a picture's noise level, against its reference implementation."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from clouds import camera_in, room, scanned
from reference import reference_frame

from pointglass.model.appearance.noise import KNOTS, NoiseModel
from pointglass.model.reference.fill_constants import FOR_NETWORK, FOR_PICTURE
from pointglass.model.reference.noise_level import pixel_noise
from pointglass.model.reference.projection import NOISE_SCALE, averaging
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.passes.averaging import AveragingPass
from pointglass.viewer.render.renderer import Renderer

AT_EDGES = 2e-3
"""Share of the pixels whose place lies on the border of two voxels, which float32 gives to either."""


def lattice(scene, seed: int) -> NoiseModel:
    """Noise that differs from voxel to voxel, and by brightness."""
    rng = np.random.default_rng(seed)
    low, high = scene.bounds
    voxel = float((high - low).max()) / 7
    shape = tuple(np.maximum(np.ceil((high - low) / voxel), 1).astype(int)[::-1])
    sigma = rng.uniform(0.001, 0.1, shape).astype(np.float32)
    return NoiseModel(low.copy(), voxel, sigma, rng.uniform(0.3, 2.0, KNOTS).astype(np.float32), float(np.median(sigma)), 99)


@pytest.mark.parametrize("weighted, detail", [(False, 0.0), (False, 1.0), (False, 1.7), (False, 2.0), (True, 1.0), (True, 2.0)])
def test_the_noise_level_is_that_of_the_reference(context, seed, weighted, detail):
    scene = scanned(seed) if weighted else room(seed, 200_000)
    scene = replace(scene, noise=replace(lattice(scene, seed), overall=0.01))  # above, the filled picture has its own run
    renderer, camera = Renderer(context, scene, device="cpu"), camera_in(scene, seed)
    settings = Settings(view="neural", device="cpu", quality="fast", detail=detail)
    try:
        renderer.render(camera, settings)
        made = renderer._passes.noise
        assert made is not None
        level = made.levels.reshape(camera.height, camera.width).astype(float)  # of the loops; the shader's are the same
        (rasteriser,), mask = renderer._passes.rasterisers.values(), renderer._passes.filter.mask
        weight = renderer._passes.fill_input(rasteriser, mask)[1]
        given = rasteriser.colour, rasteriser.depth, rasteriser.weight, weight
        made.run(*given, camera=camera, weighted=weighted, detail=detail)
        shader = np.frombuffer(made.level.read(alignment=1), np.float16).reshape(level.shape).astype(float)
        assert (np.abs(shader - level) > 2e-3 * level + 1e-4).mean() <= AT_EDGES
    finally:
        renderer.release()
    reference = reference_frame(scene, camera, settings)
    sigma = pixel_noise(scene.noise, reference.raster, camera, camera.view_rotation.T, camera.position).numpy()
    averaged = averaging(reference.raster.count, weighted=reference.raster.weighted).numpy()
    wanted = (2 - detail) * NOISE_SCALE * sigma * averaged * reference.mask
    assert reference.raster.weighted == weighted and reference.mask.mean() > 0.001
    wrong = np.abs(level - wanted) > 2e-3 * wanted + 1e-4
    assert wrong.mean() <= AT_EDGES
    assert (level[~reference.mask] == 0).all() and (detail == 2.0) == (not level.any())


def test_a_scan_of_unknown_noise_tells_none(context):
    scene = replace(room(1), noise=None)
    renderer, camera = Renderer(context, scene, device="cpu"), camera_in(scene, 1)
    try:
        renderer.render(camera, Settings(view="neural", device="cpu", quality="fast"))
        assert renderer._passes.noise is None
        packed = renderer._passes.neural.bridge.sent()
        assert not packed[..., 5].any() and packed[..., :3].any()
    finally:
        renderer.release()


def test_averaging_counts_points_or_their_weights():
    count = torch.tensor([[0, 1, 4, 255, 10_000]])
    assert averaging(count, weighted=False)[0].tolist() == pytest.approx([1, 1, 0.5, 255**-0.5, 255**-0.5])
    assert averaging(count, weighted=True)[0].tolist() == pytest.approx([1, 1, 1, (255 / 8) ** -0.5, (255 / 8) ** -0.5])


@pytest.mark.parametrize("weighted", [False, True])
def test_sparse_points_of_a_noisy_scan_are_averaged_as_by_the_reference(context, seed, weighted):
    """The filled picture alone, and the network's input whatever the detail; in a scan of little noise all count in full."""
    scene = (scanned if weighted else room)(seed, points=1_000)
    camera, weights = camera_in(scene, seed, (193, 110)), {}
    for overall in (0.06, 0.045, 0.01):
        noisy = replace(scene, noise=replace(lattice(scene, seed), overall=overall))
        renderer, wanted = Renderer(context, noisy, device="cpu"), reference_frame(noisy, camera, Settings())
        try:
            shown = renderer.render(camera, Settings(), views=("filled",)).image("filled").astype(int)
            renderer.render(camera, Settings(view="neural", device="cpu", quality="fast", detail=1.5))
            packed = renderer._passes.neural.bridge.sent()
        finally:
            renderer.release()
        assert (np.abs(packed[..., :4] - wanted.filled[:4].transpose(1, 2, 0)) > 5e-3).mean() <= AT_EDGES
        opaque = wanted.alpha[..., None] == 1
        assert ((np.abs(shown[..., :3] - 255 * wanted.shown.transpose(1, 2, 0)) > 2) & opaque).mean() <= AT_EDGES
        weights[overall] = packed[..., 3].astype(float)
    assert (weights[0.045] == weights[0.01]).all(), "of this noise only the picture that is shown is averaged"
    assert (weights[0.06] <= weights[0.01]).all() and (weights[0.06].sum() < weights[0.01].sum() or not wanted.mask.any())


@pytest.mark.parametrize("by", [FOR_PICTURE, FOR_NETWORK])
def test_averaging_in_loops_gives_the_weights_of_the_passes(context, seed, by):
    """On surfaces with steps, of random density, up to borders that cut blocks."""
    random = np.random.default_rng(seed)
    width, height = int(random.integers(90, 200)), int(random.integers(50, 150))
    across = np.arange(width * height) % width / width
    kept = random.random(width * height) < np.select([across < 0.5, across < 0.8], [0.03, 0.4], 0.0)
    weights = np.where(kept, random.choice([0.25, 0.5, 1.0], width * height), 0.0).astype(np.float32)
    rough = random.choice([0.0, 0.05, 1.0], width * height) + 0.01 * random.normal(size=width * height)
    depths = np.exp(rough).astype(np.float32)
    depths[~kept] = np.inf
    levels = random.uniform(0, 3, width * height).astype(np.float32)
    step, scale = AveragingPass(Programs(context), (width, height)), float(random.uniform(0.1, 10))
    textures = [context.texture((width, height), 1, values.tobytes(), dtype="f4") for values in (weights, levels, depths)]
    step.run(*textures, scale, by)
    wanted = np.frombuffer(step.averaged.read(), np.float32)
    made = step.run_here(weights, levels, depths, scale, by)
    np.testing.assert_allclose(made, wanted, rtol=1e-6)  # equal in the Mesa that the loops follow (test_drivers.py)
    assert (made[kept] < weights[kept]).any() and (made <= weights).all()
    for owned in (step, *textures):
        owned.release()
