"""Memory kept between pictures: in a process of its own each, since it is set once and for all."""

import platform
import subprocess
import sys

import pytest

COUNT = """
import resource, sys
import torch
from model.memory import keep_freed_memory
from model.unet import make_network

if sys.argv[1] == "kept":
    assert keep_freed_memory()
network, picture = make_network("balanced").eval(), torch.rand(1, 5, 480, 640)
with torch.inference_mode():
    for _ in range(3):
        network(picture)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(4):
        network(picture)
print((resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before) // 4)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only the GNU C library can be told")
def test_a_network_has_its_memory_cleared_once_and_not_for_every_picture():
    faults = {
        how: int(subprocess.run([sys.executable, "-c", COUNT, how], check=True, capture_output=True, text=True).stdout)
        for how in ("given back", "kept")
    }
    assert faults["kept"] < 500 and faults["given back"] > 5 * max(faults["kept"], 100), faults


def test_other_c_libraries_are_left_alone(monkeypatch):
    from model import memory

    monkeypatch.setattr(memory.platform, "libc_ver", lambda: ("", ""))
    monkeypatch.setattr(memory.ctypes, "CDLL", None)
    assert memory.keep_freed_memory() is False
