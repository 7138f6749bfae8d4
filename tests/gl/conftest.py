"""The headless context of all OpenGL tests, checked for errors around each of them."""

from pathlib import Path

import pytest

from pointglass.viewer.render.device.context import describe_device
from pointglass.viewer.render.device.device_class import DIFFERING_PIXELS, FOLLOWING_PIXELS, pictures_agree

HERE = Path(__file__).parent


@pytest.hookimpl(tryfirst=True)  # before -m looks at the marks
def pytest_collection_modifyitems(items):
    """Every test of this folder needs OpenGL: a ``pytestmark`` here would mark nothing."""
    for item in items:
        if HERE in item.path.parents:
            item.add_marker("gl")


@pytest.fixture
def agree(context):
    """agree(made, expected): whether two lists of pictures of one scene and camera, by view, agree as far as the renderer here
    promises: to the byte in software OpenGL, within the stated tolerance on a GPU.  A view ``raw`` or ``depth`` may differ in
    DIFFERING_PIXELS of its pixels there, any other in FOLLOWING_PIXELS."""
    software = describe_device(context).software

    def agreeing(made: dict, expected: dict) -> bool:
        assert made.keys() == expected.keys()
        return all(pictures_agree(made[name], expected[name], software=software,
                                  share=DIFFERING_PIXELS if name in ("raw", "depth") else FOLLOWING_PIXELS) for name in made)

    return agreeing


@pytest.fixture(autouse=True)
def no_gl_error(context):
    """Makes the shared context current, and again afterwards for the next module's fixtures: a test that makes a context of its
    own leaves another one current when it ends."""
    context.__enter__()
    assert context.error == "GL_NO_ERROR"
    yield
    context.__enter__()
    assert context.error == "GL_NO_ERROR"


@pytest.fixture
def renderer_of(context):
    """Makes renderers of scenes, which are released after the test."""
    from pointglass.viewer.render.renderer import Renderer

    made = []

    def make(scene):
        made.append(Renderer(context, scene))
        return made[-1]

    yield make
    for renderer in made:
        renderer.release()
