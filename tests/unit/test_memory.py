"""Memory kept between pictures: in a process of its own each, since it is set once and for all."""

import platform
import subprocess
import sys

import pytest

COUNT = """
import resource, sys
import torch
from model.common.memory import keep_freed_memory
from model.unet import make_network

if sys.argv[1] == "kept" and not keep_freed_memory():
    sys.exit(3)
network, picture = make_network("balanced").eval(), torch.rand(1, 6, 480, 640)
with torch.inference_mode():
    for _ in range(6):
        network(picture)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(8):
        network(picture)
print((resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before) // 8)
"""

HELD = """
import os, sys
from pathlib import Path
from model.common.memory import give_back, keep_freed_memory

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

if not keep_freed_memory() or not os.path.exists("/proc/self/statm"):
    sys.exit(3)
before = resident()
large = bytearray(os.urandom(1 << 20) * 200)
del large
print(resident() - before, end=" ")
give_back()
print(resident() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only the GNU C library can be told")
def test_a_network_has_its_memory_cleared_once_and_not_for_every_picture():
    faults = {}
    for how in ("given back", "kept"):
        counted = subprocess.run([sys.executable, "-c", COUNT, how], capture_output=True, text=True)
        if counted.returncode == 3:
            pytest.skip("this C library cannot be told")
        faults[how] = int(counted.stdout)
    if faults["given back"] < 5000:
        pytest.skip("memory comes in huge pages here, which are few")
    assert faults["kept"] < faults["given back"] / 5, faults


def test_other_c_libraries_are_left_alone(monkeypatch):
    from model.common import memory

    monkeypatch.setattr(memory.platform, "libc_ver", lambda: ("", ""))
    monkeypatch.setattr(memory.ctypes, "CDLL", None)
    assert memory.keep_freed_memory() is False
    memory.give_back()


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only the GNU C library can be told")
def test_what_is_kept_can_be_given_back():
    counted = subprocess.run([sys.executable, "-c", HELD], capture_output=True, text=True)
    if counted.returncode == 3:
        pytest.skip("this C library cannot be told")
    kept, given_back = map(int, counted.stdout.split())
    assert kept > 150 << 20 and given_back < kept / 3, (kept, given_back)
