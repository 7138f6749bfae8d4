"""Pictures from ``import pointglass``: those of the renderer, by scan and in turn; and the example that people copy."""

import doctest

import numpy as np
import pytest
from clouds import camera_in, room

import pointglass
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.settings import Memory, Settings
from pointglass.viewer.tools.provenance import provenance

pytestmark = pytest.mark.gl


@pytest.fixture(autouse=True)
def back_to_the_tests_own_context(no_gl_error, context):
    yield
    context.__enter__()  # the check for errors asks this one


def plain(context, scene, camera, settings, views):
    with context:
        renderer = Renderer(context, scene)
        try:
            frame = renderer.render(camera, settings, views)
            return frame.image(settings.view).copy(), frame.depth().copy(), frame.mask().copy()
        finally:
            renderer.release()


@pytest.mark.parametrize("view, extra", [("raw", ("filtered",)), ("filtered", ()), ("filled", ())])
def test_a_full_frame_is_what_the_renderer_makes(context, seed, view, extra):
    scene = room(seed, 20_000)
    camera = camera_in(scene, seed, (96, 72))
    image, depth, mask = plain(context, scene, camera, Settings(view=view, filter_strength=0.5), (view, *extra))
    with pointglass.Scan(scene, "room", Memory()) as scan:
        frame = scan.render(camera, view=view, full=True, filter_strength=0.5)
        alone = scan.render(camera, view=view, filter_strength=0.5)
    assert frame.image.shape == (72, 96, 4) and frame.image.flags.writeable
    assert np.array_equal(frame.image, image) and np.array_equal(alone, image)
    assert np.array_equal(frame.depth, depth) and np.array_equal(frame.mask, mask)
    assert np.array_equal(frame.provenance, provenance(view, image, mask))
    assert frame.stats["total_ms"] > 0 and frame.stats["points_total"] == scene.count
    assert "network" not in frame.stats["stages"]


def test_the_network_repaints_what_was_measured_and_fills_the_rest(one_thread):
    scene = room(3, 20_000)
    camera = camera_in(scene, 3, (64, 48))
    with pointglass.Scan(scene, "room", Memory()) as scan:
        frame = scan.render(camera, full=True, quality="fast", device="cpu", precision="fp32")
    shown = frame.image[..., 3] > 0
    assert set(np.unique(frame.provenance)) <= {0, 2, 3} and (frame.provenance == 2).any()
    assert np.array_equal(frame.provenance == 2, shown & frame.mask) and np.array_equal(frame.provenance > 0, shown)
    assert "fast" in frame.stats["network"]


def test_scans_rendered_in_turn_do_not_mix(seed):
    scenes = [room(seed + n, 20_000) for n in range(2)]
    cameras = [camera_in(scene, seed, (64, 48)) for scene in scenes]
    first, second = (pointglass.Scan(scene, "room", Memory()) for scene in scenes)
    alone = [first.render(cameras[0], view="filled"), second.render(cameras[1], view="filled")]
    assert np.array_equal(first.render(cameras[0], view="filled"), alone[0])
    second.close()
    assert np.array_equal(first.render(cameras[0], view="filled"), alone[0])
    first.close()
    with pointglass.Scan(scenes[1], "again", Memory()) as again:
        assert np.array_equal(again.render(cameras[1], view="filled"), alone[1])


def test_a_context_that_cannot_be_had_is_said_and_asked_for_again(monkeypatch):
    def refuse():
        raise pointglass.DeviceError("OpenGL 4.3 is needed")

    scene = room(1, 20_000)
    with pointglass.Scan(scene, "room", Memory()) as scan:
        with monkeypatch.context() as patch:
            patch.setattr("pointglass.viewer.render.context.create_context", refuse)
            with pytest.raises(pointglass.DeviceError, match=r"^OpenGL 4\.3"):
                scan.render(camera_in(scene, 1, (16, 16)), view="raw")
        assert scan.render(camera_in(scene, 1, (16, 16)), view="raw").shape == (16, 16, 4)


def test_the_example_in_the_documentation_runs():
    example = doctest.DocTestParser().get_doctest(pointglass.__doc__ or "", {}, "pointglass", pointglass.__file__, 0)
    said: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    runner.run(example, out=said.append)
    assert runner.tries >= 10 and not runner.failures, "".join(said)
