"""What depends on the class of a device: workgroup shapes, and how exactly pictures repeat."""

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.render.device.device_class import (
    DIFFERING_PIXELS,
    WORKGROUP_VARIABLE,
    WORKGROUPS,
    Workgroup,
    device_class,
    pictures_agree,
    workgroups,
)


@pytest.mark.parametrize(("vendor", "renderer", "software", "expected"), [
    ("NVIDIA Corporation", "NVIDIA H100/PCIe/SSE2", False, "nvidia"), ("AMD", "AMD Radeon Pro W7900", False, "amd"),
    ("ATI Technologies Inc.", "Radeon RX", False, "amd"), ("Intel", "Mesa Intel(R) UHD Graphics", False, "intel"),
    ("Collabora Ltd", "zink (NVIDIA GeForce RTX 4090)", False, "nvidia"), ("Apple", "Apple M2", False, "other"),
    ("Mesa/X.org", "llvmpipe (LLVM 15.0.6, 256 bits)", True, "software"),
])  # fmt: skip
def test_a_device_is_classed_by_its_strings(vendor, renderer, software, expected):
    assert device_class(vendor, renderer, software=software) == expected and WORKGROUPS[expected]


def test_the_environment_replaces_the_shapes(monkeypatch):
    monkeypatch.setenv(WORKGROUP_VARIABLE, "128x8")
    assert all(workgroups(kind) == (Workgroup(128, 8),) for kind in WORKGROUPS)
    for wrong in ("128", "0x8", "2048x1", "axb", "8x8x8"):
        monkeypatch.setenv(WORKGROUP_VARIABLE, wrong)
        with pytest.raises(InputError, match=f"{WORKGROUP_VARIABLE}={wrong}"):
            workgroups("nvidia")


def test_bytes_are_promised_in_software_and_a_share_of_pixels_on_a_gpu(seed):
    rng = np.random.default_rng(seed)
    expected = rng.integers(0, 256, (200, 300, 4), dtype=np.uint8)
    allowed = int(DIFFERING_PIXELS * 200 * 300)
    order = rng.permutation(200 * 300)
    for wrong in (0, 1, allowed, allowed + 1):
        made = expected.copy()
        made.reshape(-1, 4)[order[:wrong], rng.integers(0, 4)] ^= 1
        assert pictures_agree(made, expected, software=True) == (wrong == 0)
        assert pictures_agree(made, expected, software=False) == (wrong <= allowed)
