"""Background and holes in the picture: passes for directions in view that are all alike, against the one that looks them up."""

import numpy as np
import pytest
from clouds import room
from test_fill import without_roof

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.records.point_marks import file_keys
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.point_sets import PointSet
from pointglass.viewer.picture.regions import Region
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.render.culling.enclosed_directions import OPEN, SEALED
from pointglass.viewer.render.passes import fill_cpu
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl
INSIDE = look_at((1.0, 1.0, 1.2), (3.0, 2.5, 1.0))
WINDOW = look_at((3.0, 2.5, 1.5), (6.0, 2.5, 1.5))
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

    closed_in_view = fill_cpu.closed_in_view
    try:
        for answer in (told, lambda *_: None):
            monkeypatch.setattr(fill_cpu, "closed_in_view", answer)
            frame = renderer.render(camera, settings, views=("filled", "neural"))
            sent = renderer._passes.neural.bridge.sent()
            looked.append((frame.image("filled").tobytes(), sent.tobytes()))
        assert answers and set(answers) == {said}  # once more where the filled picture is averaged differently
        assert looked[0] == looked[1]
    finally:
        renderer.release()


def without_window(scene):
    """A room with a pane of glass in one wall, which returns no point."""
    xyz, rgb, _, scan = unpack(scene)
    pane = (xyz[:, 0] > 5.9) & (np.abs(xyz[:, 1] - 2.5) < 0.9) & (np.abs(xyz[:, 2] - 1.5) < 0.9)
    return scene_from_arrays(xyz[~pane], rgb[~pane], scan=scan[~pane], meta=ScanDescription(scans=scene.meta.scans))


@pytest.mark.parametrize("share, dark", [(0.005, False), (0.03, True)])
def test_a_person_who_is_deleted_opens_no_other_hole(context, share, dark):
    """In a sealed room a hole of the scan stays filled where little is hidden; much may be what closed the room."""
    scene = without_window(room(4, 60_000))
    files = file_keys(scene)
    inside = np.linalg.norm(unpack(scene)[0] - np.array([0.0, 0.0, 0.0]), axis=1).argsort()[: round(share * scene.count)]
    mask = np.zeros(sum(records for _, records in files), bool)
    mask[scene.records.numbers(slice(0, scene.count))[inside]] = True
    hidden = Edits(regions=(Region("person", PointSet.of(mask, files), shown=False),))
    camera, settings = from_fov(97, 71, 70.0, WINDOW), Settings(quality="fast", device="cpu")
    renderer = Renderer(context, scene)
    try:
        for edits, open_hole in ((None, False), (hidden, dark)):
            image = renderer.render(camera, settings, views=("filled",), edits=edits).image("filled")
            assert (image[..., 3] == 0).any() == open_hole
    finally:
        renderer.release()
