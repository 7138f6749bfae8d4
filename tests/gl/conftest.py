"""The headless context of all OpenGL tests, checked for errors around each of them."""

import pytest

pytestmark = pytest.mark.gl


@pytest.fixture(autouse=True)
def no_gl_error(context):
    assert context.error == "GL_NO_ERROR"
    yield
    assert context.error == "GL_NO_ERROR"
