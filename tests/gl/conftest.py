"""One headless context for all OpenGL tests, checked for errors around each of them."""

import os
import secrets

import pytest

from viewer.errors import DeviceError

pytestmark = pytest.mark.gl


@pytest.fixture(scope="session")
def context():
    from viewer.render.context import create_context

    try:
        made = create_context()
    except DeviceError as error:  # the set-up installs Mesa, so in CI this is a failure, not a skip
        pytest.fail(str(error))
    yield made
    made.release()


@pytest.fixture
def seed() -> int:
    """A new one each time; pytest shows the line of a test that fails, and POINTGLASS_SEED repeats it."""
    value = int(os.environ.get("POINTGLASS_SEED") or secrets.randbits(31))
    print(f"POINTGLASS_SEED={value}")
    return value


@pytest.fixture(autouse=True)
def no_gl_error(context):
    assert context.error == "GL_NO_ERROR"
    yield
    assert context.error == "GL_NO_ERROR"
