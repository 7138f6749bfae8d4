"""The mean of a pixel's colour sums against plain whole numbers: what crowds of points, drawn one by one, seldom meet."""

import numpy as np
import pytest
from clouds import room

from pointglass.model.common.linear_light import TO_SRGB
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device import shader
from pointglass.viewer.render.device.shader import BINDINGS
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl
SIZE = (64, 40)


@pytest.fixture(scope="module")
def made(context):
    """A rasteriser that has drawn something, so that all it needs is there."""
    renderer = Renderer(context, room(0, 2_000), raster="compute")
    renderer.render(from_fov(*SIZE, 60.0, look_at((1.0, 1.0, 1.0), (3.0, 2.0, 1.0))), Settings(), views=("raw",))
    yield renderer._passes.rasterisers["compute"]
    renderer.release()


def shown(rasteriser, sums: np.ndarray, count: np.ndarray) -> np.ndarray:
    """(N, 3) uint8 colours.  sums: (N, 3) and count: (N,) uint64, of all pixels, linear light."""
    words, carries = np.zeros((len(count), 2), np.uint64), np.zeros((len(count), 4), np.uint64)
    for number, (low, high) in enumerate(((sums[:, 0], sums[:, 1]), (sums[:, 2], count))):
        both = low + (high << np.uint64(16))
        if rasteriser.wide_sums:
            held = [int(a) + (int(b) << 32) for a, b in zip(low, high)]
            words[:, number] = [value & (1 << 64) - 1 for value in held]
            carries[:, 2 * number], carries[:, 2 * number + 1] = low >> np.uint64(32), [value >> 64 for value in held]
            continue
        words[:, number] = both & np.uint64(0xFFFFFFFF)
        carries[:, 2 * number], carries[:, 2 * number + 1] = low >> np.uint64(16), both >> np.uint64(32)
    head = np.array([*shader.groups(*SIZE), 0], np.uint32)
    rasteriser.sums.write(words.astype(np.uint64 if rasteriser.wide_sums else np.uint32).tobytes())
    rasteriser.carries.write(head.tobytes() + carries.astype(np.uint32).tobytes())
    rasteriser.frame.bind_to_uniform_block(BINDINGS["FRAME"])
    rasteriser.resolve(SIZE[1])
    assert not any(rasteriser.carries.read()[16:]), "empty for the next picture"
    return np.frombuffer(rasteriser.colour.read(), np.uint8).reshape(-1, 4)[:, :3]


@pytest.mark.parametrize("bits", [8, 16, 24, 31])
def test_any_sum_is_divided_and_rounded_half_up(made, seed, bits):
    """Means on, just below and just above where they are rounded up, of a crowd of up to 2 to the 31."""
    rng = np.random.default_rng(seed)
    pixels = SIZE[0] * SIZE[1]
    count = np.floor(2.0 ** rng.uniform(0, bits, pixels)).astype(np.uint64)
    most = np.minimum(4095, np.where(rng.random(pixels) < 0.5, 65535 // count, 4095))[:, None]  # half of them fit 16 bits
    mean = np.floor(rng.random((pixels, 3)) * (most + 1)).astype(np.int64)
    each = count.astype(np.int64)[:, None]
    sums = mean * each - each // 2 + rng.integers(-1, 2, mean.shape)
    sums = np.clip(sums, 0, 4095 * each)
    wraps = 4095 * each[:, 0] >> 32  # how often the green sum could go round 32 bits; it has just done so
    sums[:, 1] = np.where(wraps > 0, (np.floor(rng.random(pixels) * wraps).astype(np.int64) + 1 << 32) - (1 << 20), sums[:, 1])
    sums[:, 1] += np.where(wraps > 0, rng.integers(0, 2 << 20, pixels), 0)
    sums = np.clip(sums, 0, 4095 * each).astype(np.uint64)
    wanted = TO_SRGB[(sums + count[:, None] // np.uint64(2)) // count[:, None]]
    assert np.array_equal(shown(made, sums, count), wanted)
