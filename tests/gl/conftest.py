"""The headless context of all OpenGL tests, checked for errors around each of them."""

from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.hookimpl(tryfirst=True)  # before -m looks at the marks
def pytest_collection_modifyitems(items):
    """Every test of this folder needs OpenGL: a ``pytestmark`` here would mark nothing."""
    for item in items:
        if HERE in item.path.parents:
            item.add_marker("gl")


@pytest.fixture(autouse=True)
def no_gl_error(context):
    assert context.error == "GL_NO_ERROR"
    yield
    assert context.error == "GL_NO_ERROR"
