"""What several tests of the lab use."""

import pytest
from rooms import make_room

from pointglass.model.data.pairs import build
from pointglass.model.data.stations import load_scene


@pytest.fixture(scope="session")
def pairs(tmp_path_factory):
    """A folder of eight training pairs with neighbours.  Nobody writes into it."""
    root = tmp_path_factory.mktemp("pairs")
    assert build([load_scene(make_room(root / "box"))], root / "out", scans=1, variants=2, neighbours=True) == 8
    return root / "out"
