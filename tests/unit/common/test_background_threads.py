"""A process ends in order whatever its background threads are doing."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
BUSY = """
import atexit, sys, threading, time
from pointglass.model.common.process.background_threads import leave
atexit.register(lambda: print("cleaned up", flush=True))
begun = threading.Event()
def work():
    import torch
    conv, picture = torch.nn.Conv2d(16, 16, 3, padding=1), torch.rand(1, 16, 64, 64)
    begun.set()
    end = time.monotonic() + {seconds}
    while time.monotonic() < end:
        conv(picture)
    print("work done", flush=True)
threading.Thread(target=work, name="pointglass network", daemon=True).start()
begun.wait()
sys.stdout.write("not yet flushed; ")
sys.exit(leave(3, {wait}))
"""


@pytest.mark.parametrize(("seconds", "wait", "said"), [(0.3, 30, ["not yet flushed; work done", "cleaned up"]),
                                                       (60, 0.2, ["not yet flushed; cleaned up"])])
def test_a_thread_that_runs_the_network_is_waited_for_or_left_behind(seconds, wait, said):
    """Without it the second one ends with "terminate called without an active exception" and -6."""
    done = subprocess.run([sys.executable, "-c", BUSY.format(seconds=seconds, wait=wait)], cwd=ROOT, capture_output=True,
                          text=True, timeout=50)
    assert done.returncode == 3, done.stderr
    assert done.stdout.splitlines() == said and not done.stderr
