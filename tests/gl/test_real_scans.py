"""Real scans, each opened once: a room, a cellar with pipes, a pump, a statue and two aerial surveys.

What is read of them, and the OpenGL frame against its reference.
"""

import sys
from pathlib import Path

import pytest
from reference import reference_frame
from test_frame import ALL, assert_agrees

from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.renderer import Renderer

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "golden"))
from eight_views import cameras

pytestmark = [pytest.mark.gl, pytest.mark.slow]
COUNT_AND_BITS = {
    "studio.laz": (3_234_126, 16), "plant_room.laz": (11_605_395, 16), "pumpA.e57": (155_201, 8),
    "lion_takanawa.copc.laz": (341_989, 16), "autzen_trim.laz": (110_000, 8), "sample_c.las": (14_408, 16),
}  # fmt: skip
SIZE = (480, 360)


@pytest.fixture(scope="module", params=COUNT_AND_BITS)
def opened(request, shared_data):
    """A scan's file name and its scene."""
    path = shared_data / "scans" / request.param
    if not path.is_file():
        pytest.skip(f"{path} is not there: real scans are never committed")
    return path.name, open_scene([path])


def test_real_scans_open_with_their_counts_and_colours(opened):
    name, scene = opened
    assert (scene.count, scene.meta.colour.bits) == COUNT_AND_BITS[name] and scene.meta.colour.source == "rgb"
    assert scene.step <= scene.spacing / 4
    xyz = unpack(scene)[0]
    assert (xyz >= scene.bounds[0] - scene.step).all() and (xyz <= scene.bounds[1] + scene.step).all()


def test_plant_room_is_the_real_scan_with_a_black_border(opened):
    name, scene = opened
    assert any("black border" in text for text in scene.meta.warning_texts) == (name == "plant_room.laz")


def test_real_scan_agrees_with_the_reference(context, opened):
    name, scene = opened
    renderer = Renderer(context, scene)
    try:
        for camera in cameras()[name]:
            camera, settings = camera.resized(*SIZE), Settings()
            frame = renderer.render(camera, settings, views=ALL)
            assert_agrees(frame, reference_frame(scene, camera, settings, metre=renderer.metre))
    finally:
        renderer.release()
