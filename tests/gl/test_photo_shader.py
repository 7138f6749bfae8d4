"""The shaders of photographs against the compiled loops, on random places, photographs and cameras, in software OpenGL."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pointglass.model.reference import photo_colours as reference
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.network.bridge import ReadBackBridge
from pointglass.viewer.render.network.neural_picture import unpacking
from pointglass.viewer.render.photographs.kept_photographs import OverNetwork
from pointglass.viewer.render.photographs.photo_pass import photographed
from pointglass.viewer.render.photographs.photo_pool import PhotoPool, prepared_photo
from pointglass.viewer.render.photographs.photo_shader import PhotoShader, ResidentPool
from pointglass.viewer.render.photographs.photo_surface_loops import count_measured

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit" / "render"))

from test_photographs import random_photo, random_surface

pytestmark = pytest.mark.gl


@pytest.mark.parametrize("kind", [reference.PINHOLE, reference.SPHERICAL, reference.CYLINDRICAL])
def test_the_shaders_colour_as_the_loops_do(context, kind, seed):
    rng = np.random.default_rng(seed)
    camera, depth, filled, measured = random_surface(rng)
    height, width = depth.shape
    prepared = [prepared_photo(*random_photo(rng, kind if k else reference.PINHOLE)) for k in range(9)]
    pool = PhotoPool(len(prepared) - 1, max(len(photo.words) for photo in prepared))
    resident = ResidentPool(context, pool)  # which grows with what the pool holds
    for number, photo in enumerate(prepared[:-1]):
        pool.put(number, photo)
    numbers, pool.presence = list(range(len(prepared) - 1)), {1: 0.5, 3: 0.8}  # they fade in
    programs, size = Programs(context), (width, height)
    step = PhotoShader(programs, size)
    textures = [context.texture(size, 4, filled.tobytes()), context.texture(size, 1, alignment=1), context.texture(size, 4),
                context.texture((-(-width // 8), -(-height // 8)), 1, dtype="f4"),
                context.texture(size, 1, depth.tobytes(), dtype="f4"),
                context.texture(size, 1, measured.tobytes(), alignment=1)]
    try:
        for again in range(2):
            if again:  # one photograph takes the place of another
                pool.put(8, prepared[8], keep=frozenset(range(7)))
                numbers = [number for number in range(9) if number in pool]
                textures[0].write(filled.tobytes())
            expected = photographed(filled, depth, measured, camera, pool, numbers)
            told, blocks = expected.colours, expected.grid
            step.run(*textures, camera, resident, numbers)
            made, own = (np.frombuffer(textures[k].read(), np.uint8).reshape(filled.shape).astype(int) for k in (0, 2))
            share = np.frombuffer(textures[1].read(alignment=1), np.uint8).reshape(height, width)
            assert np.allclose(np.frombuffer(textures[3].read(), np.float32).reshape(blocks.shape), blocks, rtol=1e-6)
            wanted, part = reference.over_filled(filled[..., :3].astype(float), own[..., :3].astype(float), own[..., 3] / 255)
            assert 0.1 < np.mean(told[..., 3] > 25) < 0.99 and np.mean(part[own[..., 3] > 25] < 0.05) > 0.02
            assert np.mean(np.abs(own[..., 3] - told[..., 3]) > 2) < 0.004
            assert np.mean(np.abs(own - told)[(told[..., 3] > 2)].max(-1) > 1) < 0.004
            assert np.abs(share / 255 - part).max() < 0.01 and np.abs(made[..., :3] - wanted).max() < 1.5
            assert np.array_equal(made[..., 3], filled[..., 3])
    finally:
        for owned in (programs, step, resident, *textures):
            owned.release()


@pytest.mark.parametrize("bounded", [True, False])
def test_photographs_come_over_the_networks_picture_as_the_reference_says(context, bounded, seed):
    """And how far is written where the picture is shown at once."""
    rng = np.random.default_rng(seed)
    width, height = 53, 37
    measured = rng.random((height, width)) < np.linspace(0.02, 1.2, width)  # from sparse to dense
    made = rng.uniform(0, 1, (height, width, 4)).astype(np.float16)
    made[..., 3] = 1
    off = rng.normal(0, 40, (height, width, 3))
    off[height // 2 :] += 45 * (np.arange(width) > 30)[:, None]  # a thing that only the photographs hold
    close = np.clip(255 * made[..., :3].astype(float) + off, 0, 255)
    share = np.clip(rng.integers(-100, 400, (height, width)), 0, 255)
    share[:, :10] = 255
    photo = np.dstack([np.rint(close), share]).astype(np.uint8)
    blocks = np.empty((-(-height // reference.BLOCK), -(-width // reference.BLOCK)), np.float32)
    count_measured(np.where(measured, 255, 0).astype(np.uint8), blocks)
    programs, bridge = Programs(context), ReadBackBridge(context, (width, height))
    bridge.output.write(made)
    step = unpacking(programs, copied=True, bounded=bounded, photographs=True)
    textures = [context.texture((width, height), 4), context.texture((width, height), 1, alignment=1),
                context.texture((width, height), 4, photo.tobytes()),
                context.texture(blocks.shape[::-1], 1, blocks.tobytes(), dtype="f4"),
                context.texture((width, height), 4, bytes([255] * 4 * width * height))]
    source, over = {"copied": bridge.output_texture()}, OverNetwork(programs, textures[3].size, copied=True)
    inputs = source | over.inputs(SimpleNamespace(colours=textures[2], grid=textures[3]), source, {})
    try:
        step.run(*textures[: 2 if bounded else 1], inputs=inputs | ({"filled": textures[4]} if bounded else {}))
        shown = np.frombuffer(textures[0].read(), np.uint8).reshape(height, width, 4).astype(int)
        wanted, counts = reference.over_network(255 * made[..., :3].astype(float), photo[..., :3].astype(float),
                                                photo[..., 3] / 255, reference.spacing_in_pixels(measured))
        assert counts.min() < 0.1 < 0.8 < counts.max()
        assert np.abs(shown[..., :3] - wanted).max() < 0.6 and (shown[..., 3] == 255).all()
        if bounded:
            told = np.frombuffer(textures[1].read(alignment=1), np.uint8).reshape(height, width)
            assert np.abs(told - 255 * counts).max() < 0.6
    finally:
        for owned in (*textures, over, bridge, programs):
            owned.release()
