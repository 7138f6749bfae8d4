"""Copies of GPU buffers for the host: what was there when each was made, in order, and no waiting for ever."""

import numpy as np
import pytest

from pointglass.viewer.common.errors import DeviceError
from pointglass.viewer.render.device import read_ring
from pointglass.viewer.render.device.device_failure import DeviceMemoryError
from pointglass.viewer.render.device.read_ring import PlainRing, ReadRing

pytestmark = pytest.mark.gl
SLOTS = 3


@pytest.mark.parametrize("kind", [ReadRing, PlainRing])
def test_each_copy_holds_what_the_buffers_held_when_it_was_made(context, kind, seed):
    if kind is ReadRing and not ReadRing.available(context):
        pytest.skip("this driver cannot keep buffers mapped")
    rng = np.random.default_rng(seed)
    ring, expected = kind(context, SLOTS), {}
    first, second = context.buffer(reserve=400_000), context.buffer(reserve=64)
    for number in range(1, 12):
        words, tail = rng.integers(0, 2**32, int(rng.integers(1, 100_000)), np.uint32), rng.integers(0, 2**32, 16, np.uint32)
        first.write(words)
        second.write(tail)
        ring.push(number, [(first, 0, words.nbytes), (second, 8, 16)])
        first.write(np.zeros_like(words))  # the copy is not of what comes later
        expected[number] = np.concatenate([words, tail[2:6]])
        held = ring.read(int(rng.integers(max(1, number - SLOTS + 1), number + 1)))
        assert held is not None and any(np.array_equal(held, other) for other in expected.values())
        assert ring.read(number - SLOTS) is None and ring.read(number + 1) is None
    for number in range(9, 12):
        held = ring.read(number)
        assert held is not None and np.array_equal(held, expected[number])
    for owned in (ring, first, second):
        owned.release()


def test_a_buffer_that_was_refused_is_asked_for_again(context, monkeypatch):
    """The renderer frees memory and draws again with the same ring: it must not read where nothing is mapped."""
    if not ReadRing.available(context):
        pytest.skip("this driver cannot keep buffers mapped")
    ring, buffer = ReadRing(context, SLOTS), context.buffer(np.arange(16, dtype=np.uint32))
    monkeypatch.setattr(ring._slots[1]._gl, "map", lambda *_: None)
    for _ in range(2):
        with pytest.raises(DeviceMemoryError, match="no memory left"):
            ring.push(1, [(buffer, 0, 64)])
        assert ring.read(1) is None
    monkeypatch.undo()
    ring.push(1, [(buffer, 0, 64)])
    held = ring.read(1)
    assert held is not None and np.array_equal(held, np.arange(16))
    ring.release()
    buffer.release()


def test_a_fence_that_is_never_reached_ends_with_a_message(context, monkeypatch):
    """As of a GPU that hangs: the driver says that the time has passed."""
    if not ReadRing.available(context):
        pytest.skip("this driver cannot keep buffers mapped")
    ring, buffer = ReadRing(context, SLOTS), context.buffer(reserve=64)
    ring.push(1, [(buffer, 0, 64)])
    timeout_expired = 0x911B
    monkeypatch.setattr(ring._slots[1]._gl, "wait", lambda fence, flags, timeout: timeout_expired)
    with pytest.raises(DeviceError, match="did not answer within 10 s") as raised:
        ring.read(1)
    assert raised.value.exit_code == 3 and read_ring.TIMEOUT == 10.0
    monkeypatch.undo()
    ring.release()
    buffer.release()
