"""The passes of the fill against their reference implementations in torch: masks of all kinds, and the network's input by
channel."""

import numpy as np
import pytest
import torch
from clouds import camera_in, room, scanned
from reference import directions, looked_up, rays_met, reference_frame

from pointglass.model.network.network_layout import BACKGROUND, CLOSED, PACKED_IN
from pointglass.model.reference.hole_test import OPACITY_LEVELS, coverage, far_inside
from pointglass.model.reference.projection import DEPTH_FEATURE_LIMIT, Raster, depth_feature, network_input
from pointglass.model.reference.pull_push import pull_push
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import Camera, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.render.culling.enclosed_directions import OPEN, SEALED, SIDE, Directions
from pointglass.viewer.render.culling.occupancy import Occupancy, codes_of
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.passes.fill_cpu import CpuFill
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl
FEW = 2e-4
"""Of the pixels: float32 rays on the border of a direction's cell."""
SOFT = 0.5 / OPACITY_LEVELS
CLOSE = 2e-3
"""Half floats, up to DEPTH_FEATURE_LIMIT."""


def sent(context, fill: CpuFill, *inputs, **options) -> np.ndarray:
    """(PACKED_IN, H, W): what the network is given, by the passes; it and the filled picture are also those of the loops."""
    width, height = fill.size
    buffer = context.buffer(reserve=2 * PACKED_IN * width * height)
    colour, weight, depth, noise = (
        None if each is None else np.frombuffer(each.read(alignment=1), kind) for each, kind in zip(
            (*inputs, options.get("noise")), (np.uint32, np.uint8, np.float32, np.float32), strict=True))
    try:
        fill.run_here(colour, weight / np.float32(255), depth, **{**options, "noise": noise}, network=True, with_depth=True)
        here, picture, far = fill.packed.copy(), fill.shown.view(np.uint8), np.frombuffer(fill.depth.read(), np.float32).copy()
        fill.run(*inputs, **options, network=buffer, with_depth=True)
        packed = np.frombuffer(buffer.read(), np.float16).reshape(height, width, PACKED_IN).astype(np.float32)
        few = FEW * packed[..., 0].size + 2
        assert (np.abs(here - packed).max(-1) > CLOSE).sum() <= few
        assert (np.abs(picture - np.frombuffer(fill.filled.read(alignment=1), np.uint8).astype(int)) > 1).sum() <= 4 * few
        assert (np.abs(far / np.maximum(np.frombuffer(fill.depth.read(), np.float32), 1e-9) - 1)[far > 0] > 1e-4).sum() <= few
    finally:
        buffer.release()
    return packed.transpose(2, 0, 1)


@pytest.mark.parametrize("size", [(1, 1), (3, 130), (97, 61), (255, 16), (400, 90), (47, 448), (513, 40)])
@pytest.mark.parametrize("known, marched", [(False, False), (True, False), (False, True)])
def test_any_mask_is_filled_and_closed_as_by_the_reference(context, seed, size, known, marched):
    """Sizes with one to three distances to look at, next to each other or not; masks without a pixel, with few, in clumps, and
    full.  Of the directions nothing is known, or each cell is
    open, closed or sealed by chance; or rays are tested against blocks, some of which hold points by chance."""
    rng = np.random.default_rng(seed)
    width, height = size
    programs = Programs(context)
    fill = CpuFill(programs, size)
    pose = look_at(np.zeros(3), rng.normal(size=3))
    camera = Camera(width, height, *rng.uniform(40, 60, 2), *(rng.uniform(0.2, 0.8, 2) * size), pose)
    held = rng.random((14, 9, 11)) < rng.choice([0.02, 0.3])
    held[7:, 4] |= rng.random((7, 11)) < 0.95  # a surface
    occupancy = Occupancy(codes_of(held), rng.uniform(-6, 1, 3), 0.5, 0.1) if marched else None
    clumps = np.kron(rng.random((-(-height // 8), -(-width // 8))) < 0.3, np.ones((8, 8)))[:height, :width]
    sparse = [rng.random((height, width)) < share for share in (0.003, 0.02, 0.1)]
    made = []
    try:
        for mask in (np.zeros((height, width)), *sparse, clumps, np.ones((height, width))):
            kept = torch.from_numpy(mask.astype(bool))
            closed = (rng.integers(0, 3, (6 * SIDE, SIDE)) if known else np.zeros((6 * SIDE, SIDE))).astype(np.int8)
            around = Directions(closed, occupancy)
            met = rays_met(around, camera)
            rgb = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
            depth = rng.uniform(1, 9, (height, width)).astype(np.float32)
            made += [context.texture(size, 4, np.dstack([rgb, np.full_like(rgb[..., 0], 255)]).tobytes()),
                     context.texture(size, 1, (255 * mask).astype(np.uint8).tobytes(), alignment=1),
                     context.texture(size, 1, depth.tobytes(), dtype="f4")]  # fmt: skip
            got = sent(context, fill, *made[-3:], camera=camera, around=around, spacing=0.1)
            colour = torch.from_numpy(rgb).permute(2, 0, 1).float()
            wanted = network_input(Raster(colour, torch.from_numpy(depth), kept.long()), kept, camera.fx, 0.1).numpy()
            assert np.abs(got[:6] - wanted).max() < CLOSE
            towards = looked_up(closed, camera)
            alpha = np.where(towards != OPEN, 1.0, coverage(kept, met).numpy()) * mask.any()
            sealed = (towards == SEALED) | ((towards == OPEN) & far_inside(kept, met).numpy())
            few = FEW * mask.size + 2 if known else 0
            assert (got[CLOSED] != sealed).sum() <= few and not got[5].any()
            assert (np.abs(got[BACKGROUND] - (1 - alpha)) > SOFT).sum() <= few
            opaque = np.where(np.abs(got[BACKGROUND] - (1 - alpha)) > SOFT, np.round(1 - got[BACKGROUND]), alpha)
            image = np.frombuffer(fill.filled.read(alignment=1), np.uint8).reshape(height, width, 4)
            shown = 255 * np.clip(np.stack([*wanted[:3], np.ones_like(depth)], -1), 0, 1) * opaque[..., None]
            assert np.abs(image - shown).max() < 0.51
    finally:
        for texture in made:
            texture.release()
        fill.release()
        programs.release()


@pytest.mark.parametrize("size", [(1, 1), (3, 130), (255, 16), (401, 90)])
def test_surfaces_and_the_noise_level_are_filled_as_by_the_reference(context, seed, size):
    """Surfaces of two depths in blocks, trusted a little or fully, of spacings from a tenth of a pixel to ten; the noise level
    follows what the fill decides, and changes nothing else."""
    rng = np.random.default_rng(seed)
    width, height = size
    programs = Programs(context)
    fill = CpuFill(programs, size)
    camera = Camera(width, height, 50.0, 50.0, width / 2, height / 2, look_at(np.zeros(3), rng.normal(size=3)))
    around, made = Directions(np.zeros((6 * SIDE, SIDE), np.int8), None), []
    try:
        for share, spacing in ((0.01, 1.0), (0.1, 0.1), (0.4, 0.02), (0.4, 0.1), (1.0, 0.1)):
            near = np.kron(rng.random((-(-height // 16), -(-width // 16))) < 0.5, np.ones((16, 16)))[:height, :width] > 0
            depth = (np.where(near, 4.0, 4.0 * rng.uniform(1.05, 3)) * rng.uniform(0.99, 1.01, near.shape)).astype(np.float32)
            weight = np.where(rng.random(near.shape) < share, rng.integers(1, 256, near.shape), 0).astype(np.uint8)
            rgb = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
            noise = np.where(weight > 0, rng.uniform(0, 2, near.shape), 0).astype(np.float32)
            made += [context.texture(size, 4, np.dstack([rgb, np.full_like(rgb[..., 0], 255)]).tobytes()),
                     context.texture(size, 1, weight.tobytes(), alignment=1),
                     *(context.texture(size, 1, part.tobytes(), dtype="f4") for part in (depth, noise))]  # fmt: skip
            options = {"camera": camera, "around": around, "spacing": spacing}
            got = sent(context, fill, *made[-4:-1], **options, noise=made[-1])
            feature = depth_feature(torch.from_numpy(depth), camera.fx, spacing)
            image = torch.cat([torch.from_numpy(rgb).permute(2, 0, 1) / 255, feature[None], torch.from_numpy(noise)[None]])
            wanted = pull_push(image, torch.from_numpy(weight / np.float32(255))).numpy()
            assert np.abs(got[[0, 1, 2, 4, 5]] - wanted).max() < CLOSE, (share, spacing)
            without = sent(context, fill, *made[-4:-1], **options)
            others = [channel for channel in range(PACKED_IN) if channel != 5]
            assert np.array_equal(without[others], got[others]) and not without[5].any()
    finally:
        for texture in made:
            texture.release()
        fill.release()
        programs.release()


def without_roof(scene, share=0.6):
    """What of a room lies below its middle and a little above: directions closed and sealed, and background."""
    xyz, rgb, _, scan = unpack(scene)
    kept = xyz[:, 2] < share * xyz[:, 2].max()
    return scene_from_arrays(xyz[kept], rgb[kept], scan=scan[kept], meta=ScanDescription(scans=scene.meta.scans))


@pytest.mark.parametrize("size, weighted, cut", [
    ((97, 61), False, False), ((97, 61), True, False), ((97, 61), False, True), ((97, 61), True, True),
    ((320, 241), True, True),
])  # fmt: skip
def test_each_channel_is_what_the_network_learnt_from(context, seed, size, weighted, cut):
    """In a closed room, and in one that lacks its upper part; spacings that take the depth past both its limits."""
    scene = scanned(seed) if weighted else room(seed)
    if cut:
        scene = without_roof(scene)
    camera, settings = camera_in(scene, seed, size), Settings()
    renderer = Renderer(context, scene)
    try:
        renderer.render(camera, settings, views=("filled",))
        reference, towards = reference_frame(scene, camera, settings), directions(scene, camera)
        mask = torch.from_numpy(reference.mask)
        sealed = (towards == SEALED) | ((towards == OPEN) & far_inside(mask, reference.met).numpy())
        (rasteriser,), around = renderer._passes.rasterisers.values(), renderer._enclosure.around(camera.position)
        colour, trusted = renderer._passes.fill_input(rasteriser, renderer._passes.filter.mask)
        for factor, limit in ((1e-7, 1), (1.0, 0), (1e7, -1)):
            spacing = factor * scene.spacing
            got = sent(context, renderer._passes.fill, colour, trusted, rasteriser.depth,
                       camera=camera, around=around, spacing=spacing)  # fmt: skip
            wanted = network_input(reference.raster, mask, camera.fx, spacing).numpy()
            assert np.abs(got[:6] - wanted).max() < CLOSE
            assert (got[CLOSED] != sealed).mean() <= FEW
            assert (np.abs(got[BACKGROUND] - (1 - reference.alpha)) > SOFT).mean() <= FEW
            assert not limit or np.abs(wanted[4] - limit * DEPTH_FEATURE_LIMIT).max() < CLOSE
    finally:
        renderer.release()
