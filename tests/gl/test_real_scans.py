"""The OpenGL frame against its reference on real scans: a room, a pump, a statue and an aerial survey in feet."""

import sys
from pathlib import Path

import pytest
from reference import reference_frame
from test_frame import ALL, assert_agrees

from viewer.grid.open_scene import open_scene
from viewer.render.renderer import Renderer
from viewer.settings import Settings

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "golden"))
from eight_views import cameras

pytestmark = pytest.mark.gl


@pytest.mark.slow
@pytest.mark.parametrize("scan", list(cameras()))
def test_real_scan_agrees_with_twin(context, shared_data, scan):
    path = shared_data / "scans" / scan
    if not path.is_file():
        pytest.skip(f"{path} is not there: real scans are never committed")
    scene = open_scene([path])
    renderer = Renderer(context, scene)
    try:
        for camera in cameras()[scan]:
            settings = Settings()
            frame = renderer.render(camera, settings, views=ALL)
            assert_agrees(frame, reference_frame(scene, camera, settings, metre=renderer.metre))
    finally:
        renderer.release()
