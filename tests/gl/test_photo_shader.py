"""The shaders of photographs against the compiled loops, on random places, photographs and cameras, in software OpenGL."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pointglass.model.reference import photo_colours as reference
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.photographs.photo_pass import photographed
from pointglass.viewer.render.photographs.photo_pool import PhotoPool, prepared_photo
from pointglass.viewer.render.photographs.photo_shader import PhotoShader, ResidentPool

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
    for number, photo in enumerate(prepared[:-1]):
        pool.put(number, photo)
    numbers, pool.presence = list(range(len(prepared) - 1)), {1: 0.5, 3: 0.8}  # they fade in
    programs, size = Programs(context), (width, height)
    step, resident = PhotoShader(programs, size), ResidentPool(context, pool)
    textures = [context.texture(size, 4, filled.tobytes()), context.texture(size, 1, depth.tobytes(), dtype="f4"),
                context.texture(size, 1, measured.tobytes(), alignment=1), context.texture(size, 1, alignment=1)]
    given = rng.integers(0, 1 << 32, (height, width, 4), dtype=np.uint32)
    network = context.buffer(given.tobytes())
    try:
        for again in range(2):
            if again:  # one photograph takes the place of another
                pool.put(8, prepared[8], keep=frozenset(range(7)))
                numbers = [number for number in range(9) if number in pool]
                textures[0].write(filled.tobytes())
                network.write(given.tobytes())
            told = given.copy()
            wanted, part = photographed(filled, depth, measured, camera, pool, numbers, told)
            step.run(textures[0], textures[3], textures[1], textures[2], camera, resident, numbers, network)
            made = np.frombuffer(textures[0].read(), np.uint8).reshape(filled.shape)
            share = np.frombuffer(textures[3].read(alignment=1), np.uint8).reshape(height, width)
            assert 0.1 < np.mean(part > 25) < 0.99  # the case decides something
            assert np.mean(np.abs(share.astype(int) - part) > 2) < 0.004
            assert np.mean(np.abs(made.astype(int) - wanted).max(-1) > 1) < 0.004
            out = np.frombuffer(network.read(), np.uint32).reshape(given.shape)
            assert np.array_equal(out[..., 3], given[..., 3]) and np.mean((out == told).all(-1)) > 0.8
            coloured = (part > 0) & (share > 0)
            halves = [array.view(np.float16).reshape(height, width, 8)[coloured, :3].astype(float) for array in (out, told)]
            assert np.mean(np.abs(halves[0] - halves[1]).max(-1) > 1.6 / 255) < 0.004
    finally:
        for owned in (programs, step, resident, network, *textures):
            owned.release()
