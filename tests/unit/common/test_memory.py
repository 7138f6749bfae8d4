"""Settings of the process under which networks run: freed memory is kept, all processors are used, by commands alone.

Memory is measured in a fresh process each time, because the setting cannot be undone."""

import platform
import subprocess
import sys

import pytest
import torch

from pointglass.model.common.process import torch_process
from pointglass.model.common.process.processors import usable_processors
from pointglass.model.network.reconstruct import Reconstructor
from pointglass.viewer.commands.neural_setup import check_weights
from pointglass.viewer.picture.settings import Settings

COUNT = """
import os, resource, sys
import torch
from pointglass.model.common.process.memory import keep_freed_memory
from pointglass.model.network.unet import make_network

how = "given back" if os.fork() else "kept"  # torch is loaded once
if how == "kept" and not keep_freed_memory():
    sys.exit(3)
network, picture = make_network("fast").eval(), torch.rand(1, 6, 240, 480)
with torch.inference_mode():
    network(picture)
    pictures = []
    for _ in range(5):  # the fewest of five: the allocator may still grow in one of the first, by how threads ran
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        network(picture)
        pictures.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
print(how, min(pictures), sep=": ", flush=True)
if how != "kept":
    sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))
"""

HELD = """
import os, sys
from pathlib import Path
from pointglass.model.common.process.memory import give_back, keep_freed_memory

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


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only the GNU C library has the setting")
def test_the_system_clears_memory_once_and_not_for_every_picture():
    counted = subprocess.run([sys.executable, "-c", COUNT], capture_output=True, text=True)
    if counted.returncode == 3:
        pytest.skip("this C library has no such setting")
    assert counted.returncode == 0, counted.stderr
    faults = {how: int(count) for how, count in (line.split(": ") for line in counted.stdout.splitlines())}
    if faults["given back"] < 5000:
        pytest.skip("memory comes in huge pages here, which are few")
    assert faults["kept"] < faults["given back"] / 5, faults


def test_other_c_libraries_are_left_alone(monkeypatch):
    from pointglass.model.common.process import memory

    monkeypatch.setattr(memory.platform, "libc_ver", lambda: ("", ""))
    monkeypatch.setattr(memory.ctypes, "CDLL", None)
    assert memory.keep_freed_memory() is False
    memory.give_back()


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only the GNU C library has the setting")
def test_kept_memory_can_be_given_back():
    counted = subprocess.run([sys.executable, "-c", HELD], capture_output=True, text=True)
    if counted.returncode == 3:
        pytest.skip("this C library has no such setting")
    kept, given_back = map(int, counted.stdout.split())
    assert kept > 150 << 20 and given_back < kept / 3, (kept, given_back)


def test_a_network_changes_no_setting_of_the_process(one_thread, monkeypatch):
    monkeypatch.setattr(torch_process, "keep_freed_memory", lambda: pytest.fail("memory is the command's"))
    Reconstructor("fast", filtered=True, device="cpu")
    assert torch.get_num_threads() == 1


def test_commands_prepare_the_process_for_the_neural_view_alone(one_thread, monkeypatch):
    monkeypatch.setattr(torch_process, "keep_freed_memory", lambda: True)
    check_weights(Settings(view="filled"))
    assert torch.get_num_threads() == 1
    check_weights(Settings(view="neural"))
    assert torch.get_num_threads() == usable_processors()
