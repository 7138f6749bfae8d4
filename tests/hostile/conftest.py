"""The fork server comes first: a fork has one thread, and waits for ever for threads of a library that another test started."""

from pathlib import Path

HERE = Path(__file__).resolve().parent


def pytest_collection_modifyitems(items):
    """Moves the tests of this folder to the front."""
    items.sort(key=lambda item: HERE not in item.path.parents)
