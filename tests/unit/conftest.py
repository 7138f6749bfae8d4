"""What the modules of the evaluation share, made once for each; a module with a room of its own overrides this one."""

from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    from evaluation_files import film_room  # here: it loads torch, which most modules do without

    return film_room(tmp_path_factory.mktemp("rooms") / "box")


@pytest.fixture(scope="module")
def squeeze(tmp_path_factory) -> Path:
    from evaluation_files import squeeze_files

    return squeeze_files(tmp_path_factory.mktemp("squeeze"))
