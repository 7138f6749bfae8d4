"""One headless context for all OpenGL tests, checked for errors around each of them."""

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


@pytest.fixture(autouse=True)
def no_gl_error(context):
    assert context.error == "GL_NO_ERROR"
    yield
    assert context.error == "GL_NO_ERROR"
