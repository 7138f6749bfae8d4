"""Fixtures for all tests: the shared data where it is present, a cache of the test run's own, a fresh seed, one thread of
torch's, and one headless context."""

import gc
import os
import secrets
import signal
from pathlib import Path
from typing import Any

import pytest

from pointglass.viewer.common.errors import DeviceError

# As every command does (viewer/cli.py): waiting threads of torch sleep.  Otherwise they take the processors from software
# OpenGL.  One thread, also in what the tests start, where it is not set: small pictures gain nothing from more, and other tests
# run on the other processors (.ci/test.sh).  torch and NumPy read both when they are imported.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
os.environ.setdefault("OMP_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parent.parent

pytest.register_assert_rewrite("bench_run", "walls")  # helpers that check: their failures show values too


gc.disable()  # while tests are imported, which makes a million objects that stay: 3 seconds of looking through them


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real scans and registered rooms beside the checkout.  Absent in a plain clone: the test is skipped, saying so."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there: real scans and rooms are never committed")
    return folder


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """No test reads or writes the user's cache or state."""
    patch = pytest.MonkeyPatch()
    patch.setenv("POINTGLASS_STATE", str(tmp_path_factory.mktemp("state")))
    patch.setenv("POINTGLASS_CACHE", str(tmp_path_factory.mktemp("cache")))
    yield
    patch.undo()


@pytest.fixture(scope="session", autouse=True)
def no_progress_lines():
    """Beside other work a command takes longer, and tests of what it says would find lines of its progress."""
    patch = pytest.MonkeyPatch()
    patch.setattr("pointglass.viewer.common.progress._FIRST_LINE", float("inf"))
    patch.setattr("pointglass.model.common.loop_cache._QUIET_SECONDS", float("inf"))  # a loop that set-up has not compiled
    yield
    patch.undo()


@pytest.fixture(scope="session", autouse=True)
def ctrl_c_is_heard():
    """Also where the tests are started in the background, which a shell makes deaf to it, and with them what they start."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def thin_demo(tmp_path_factory) -> Path:
    """The demo scan with every fifth of its points, for what only wants a scan: its grid takes a fifth of the time."""
    import laspy
    import numpy as np

    from pointglass.viewer.common.paths import assets_dir

    demo = laspy.read(assets_dir() / "demo.laz")
    points: Any = demo.points  # laspy declares that a selection has another class
    demo.points = points[np.arange(0, len(points), 5)]
    path = tmp_path_factory.mktemp("demo") / "thin_demo.laz"
    demo.write(str(path))
    return path


@pytest.fixture
def seed() -> int:
    """A new one each time; pytest shows the line of a test that fails, and POINTGLASS_SEED repeats it."""
    value = int(os.environ.get("POINTGLASS_SEED") or secrets.randbits(31))
    print(f"POINTGLASS_SEED={value}")
    return value


@pytest.fixture
def one_thread():
    """For tests of small pictures, which gain nothing from more, and lose much where other work fills the cores.

    Around each test: some of what is tested sets the number itself.
    """
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def context():
    from pointglass.viewer.render.device.context import create_context

    try:
        made = create_context()
    except DeviceError as error:  # the set-up installs Mesa, so in CI this is a failure, not a skip
        pytest.fail(str(error))
    yield made
    made.release()
