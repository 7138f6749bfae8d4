"""A device that runs out of memory: half of the points' memory is given back and the same picture is made, or one line says why
not.  See test_pages.py for memory that is refused when the points are loaded."""

from dataclasses import replace

import pytest
from clouds import camera_in, room

from pointglass.viewer.common.errors import DeviceError, DeviceLostError
from pointglass.viewer.grid.scene import CHUNK
from pointglass.viewer.picture.settings import Memory, Settings
from pointglass.viewer.render import renderer as module
from pointglass.viewer.render.device.device_failure import DeviceMemoryError
from pointglass.viewer.render.passes.fill_cpu import CpuFill
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl


def test_a_network_without_memory_halves_the_points_and_the_picture_is_made(context, monkeypatch, caplog):
    """A fill pass that fails while the points hold more than half of what they wanted, as a network's allocation would."""
    monkeypatch.setattr(module, "_WORTH_HALVING", 1 << 20)
    scene = room(3, 40 * CHUNK)
    renderer = Renderer(context, scene)
    camera = camera_in(scene, 3)
    wanted = renderer.render(camera, Settings(view="filled")).image("filled").tobytes()
    most, run = renderer.pages.nbytes // 2, CpuFill.run_here

    def short(self, *arguments, **named):
        if renderer.pages.nbytes > most:
            raise DeviceMemoryError("the GPU has not enough memory left for the network")
        return run(self, *arguments, **named)

    monkeypatch.setattr(CpuFill, "run_here", short)
    frame = renderer.render(camera, Settings(view="filled"))
    assert frame.image("filled").tobytes() == wanted
    assert renderer.pages.nbytes <= most and frame.stats["points_gpu_budget"] <= most
    said = [record.message for record in caplog.records if "continuing with" in record.message]
    assert len(said) == 1 and "not enough memory" in said[0] and "\n" not in said[0]
    renderer.release()


def test_a_small_scan_has_nothing_to_give_back(context, monkeypatch):
    scene = room(3)
    renderer = Renderer(context, scene, memory=Memory(gpu=1 << 28))

    def short(self, *arguments, **named):
        raise DeviceMemoryError("the GPU has not enough memory left for the network")

    monkeypatch.setattr(CpuFill, "run_here", short)
    with pytest.raises(DeviceError, match="not enough memory") as raised:
        renderer.render(camera_in(scene, 3), Settings(view="filled"))
    assert raised.value.exit_code == 3
    monkeypatch.undo()
    assert renderer.render(camera_in(scene, 3), Settings(view="filled")).image("filled").any()  # and it goes on
    renderer.release()


@pytest.mark.parametrize(
    ("state", "raised", "text"),
    [
        ("GL_OUT_OF_MEMORY", DeviceError, "no memory left for a picture of"),
        ("GL_CONTEXT_LOST", DeviceLostError, "driver was reset; start pointglass again"),
    ],
)
def test_a_gpu_that_refuses_or_is_lost_ends_with_a_message_and_exit_code_3(context, monkeypatch, state, raised, text):
    known = module.describe_device
    monkeypatch.setattr(module, "describe_device", lambda context: replace(known(context), software=False))
    scene = room(3)
    renderer = Renderer(context, scene, raster="compute")

    class Failing:
        error = state

        def __getattr__(self, name):
            return getattr(context, name)

    renderer.context = Failing()  # type: ignore[assignment]
    with pytest.raises(raised, match=text) as found:
        renderer.render(camera_in(scene, 3), Settings(view="filled"))
    assert found.value.exit_code == 3
    renderer.context = context
    renderer.release()


def test_passes_that_a_later_picture_first_needs_are_not_made_without_memory(context, monkeypatch):
    """The size of the picture stays, and a moving picture is not waited for: the next one finds out."""
    known = module.describe_device
    monkeypatch.setattr(module, "describe_device", lambda context: replace(known(context), software=False))
    scene = room(3)
    renderer, camera = Renderer(context, scene, raster="compute"), camera_in(scene, 3)

    class Driver:
        """Says an error once, as OpenGL does."""

        said = "GL_NO_ERROR"

        @property
        def error(self):
            said, self.said = self.said, "GL_NO_ERROR"
            return said

        def __getattr__(self, name):
            return getattr(context, name)

    driver = Driver()
    renderer.context = driver  # type: ignore[assignment]
    wanted = renderer.render(camera, Settings(view="raw")).image("raw")
    renderer.render(camera, Settings(view="filled"), streaming=True)
    driver.said = "GL_OUT_OF_MEMORY"  # of what that picture was the first to need
    with pytest.raises(DeviceMemoryError, match="no memory left for a picture of"):
        renderer.render(camera, Settings(view="filled"), streaming=True)
    assert (renderer.render(camera, Settings(view="raw")).image("raw") == wanted).all()
    renderer.context = context
    renderer.release()
