"""Draws stress scenes, and fails with the claims that do not hold."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "gl"))  # the reference of a frame


@pytest.fixture(autouse=True)
def all_on_one_thread(one_thread):
    """Every test of this folder draws small pictures."""


@pytest.fixture
def renderers(context):
    """Draws stress scenes; no OpenGL error before or after."""
    from pointglass.viewer.bench.cases.stability import Renderers

    context.__enter__()  # another test may have left its own context current
    assert context.error == "GL_NO_ERROR"
    yield Renderers(context)
    assert context.error == "GL_NO_ERROR"


@pytest.fixture
def claims():
    """Fails with every row that is beyond its limit."""

    def check(rows: list[dict]) -> None:
        assert rows
        wrong = [f"{row['name']}: {row['value']:.6g}, limit {row['limit']:g}" for row in rows if not row["ok"]]
        assert not wrong, "\n".join(wrong)

    return check
