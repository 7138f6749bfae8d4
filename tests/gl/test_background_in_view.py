"""Background and holes in the picture: passes for directions in view that are all alike, against the one that looks them up."""

import numpy as np
import pytest
from clouds import room
from test_fill import without_roof

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.culling.enclosed_directions import OPEN, SEALED
from pointglass.viewer.render.passes import fill
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl
INSIDE = look_at((1.0, 1.0, 1.2), (3.0, 2.5, 1.0))
AWAY = look_at((-30.0, -30.0, 20.0), (-60.0, -60.0, 60.0))


@pytest.mark.parametrize("pose, said", [(INSIDE, SEALED), (AWAY, OPEN), (INSIDE, None)])
def test_what_is_known_beforehand_changes_no_byte(context, monkeypatch, pose, said):
    scene = room(4, 20_000 if said is not None else 200_000)
    renderer = Renderer(context, without_roof(scene, 0.95) if said is None else scene)  # the ground is closed, the sky is not
    camera, settings = from_fov(97, 71, 50.0, pose), Settings(quality="fast", device="cpu")
    answers, looked = [], []

    def told(closed, camera):
        answers.append(closed_in_view(closed, camera))
        return answers[-1]

    closed_in_view = fill.closed_in_view
    try:
        for answer in (told, lambda *_: None):
            monkeypatch.setattr(fill, "closed_in_view", answer)
            frame = renderer.render(camera, settings, views=("filled", "neural"))
            sent = np.frombuffer(renderer._passes.neural.bridge.input.read(), np.uint16)
            looked.append((frame.image("filled").tobytes(), sent.tobytes()))
        assert answers == [said]
        assert looked[0] == looked[1]
    finally:
        renderer.release()
