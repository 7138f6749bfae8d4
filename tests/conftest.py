"""Fixtures for all tests: the shared data where it is present, and a cache of the test run's own."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real scans and registered rooms beside the checkout.  Absent in a plain clone: the test is skipped, saying so."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there: real scans and rooms are never committed")
    return folder


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """No test reads or writes the user's cache."""
    patch = pytest.MonkeyPatch()
    patch.setenv("POINTGLASS_CACHE", str(tmp_path_factory.mktemp("cache")))
    yield
    patch.undo()
