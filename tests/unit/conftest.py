"""What the modules of the evaluation share, made once for each; a module with a room of its own overrides this one."""

from functools import lru_cache
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def registered_scan(shared_data):
    """registered_scan(name): a registered room (model.data.stations) and a scan of its stations, each scanned once."""

    @lru_cache
    def scanned(name: str):
        from pointglass.model.data.stations import load_scene, scan_stations

        scene = load_scene(shared_data / "renders" / name)
        return scene, scan_stations(scene, 11)

    return scanned


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    from evaluation_files import film_room  # here: it loads torch, which most modules do without

    return film_room(tmp_path_factory.mktemp("rooms") / "box")


@pytest.fixture(scope="module")
def squeeze(tmp_path_factory) -> Path:
    from evaluation_files import squeeze_files

    return squeeze_files(tmp_path_factory.mktemp("squeeze"))
