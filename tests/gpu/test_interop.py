"""OpenGL and CUDA on one GPU: the mapped bridge against the copying one.  Skipped, saying why, where there is none."""

import numpy as np
import pytest

from model.reconstruct import PACKED_IN, Reconstructor, cuda_problem
from viewer.errors import DeviceError
from viewer.render.bridge import CudaBridge, ReadBackBridge
from viewer.render.context import create_context

pytestmark = pytest.mark.gpu


@pytest.fixture(scope="module")
def bridges():
    problem = cuda_problem()
    if problem:
        pytest.skip(f"no CUDA here: {problem}")
    context = create_context()
    try:
        mapped = CudaBridge(context, (96, 64))
    except DeviceError as error:
        pytest.skip(str(error))
    copied = ReadBackBridge(context, (96, 64))
    yield mapped, copied
    mapped.release()
    copied.release()
    context.release()


def test_mapped_and_copied_pixels_are_equal_to_the_bit(bridges):
    mapped, copied = bridges
    network = Reconstructor("balanced", filtered=True, device="cuda")
    pixels = np.random.default_rng(0).random((64, 96, PACKED_IN)).astype(np.float16)
    made = []
    for bridge in (mapped, copied):
        bridge.input.write(pixels)
        bridge.run(network)
        made.append(bridge.output.read())
    assert made[0] == made[1]


def test_many_frames_do_not_grow(bridges):
    import torch

    mapped, _ = bridges
    network = Reconstructor("balanced", filtered=True, device="cuda")
    for _ in range(20):
        mapped.run(network)
    torch.cuda.synchronize()
    before = torch.cuda.memory_reserved()
    for _ in range(1000):
        mapped.run(network)
    torch.cuda.synchronize()
    assert torch.cuda.memory_reserved() <= before
