"""The demo scan's own choices: the exposures of its stations and its camera path."""

import json
from pathlib import Path

import laspy
import numpy as np
import pytest
from untyped import any_typed

from pointglass.model.synth import demo
from pointglass.viewer.readers.formats import open_source


@pytest.mark.parametrize("seed", range(6))
def test_exposures_average_to_exactly_one(seed):
    gains = demo.exposures(seed)
    assert gains.mean() == 1.0 and np.abs(gains - 1).max() <= demo.SPREAD and np.ptp(gains) > 0.1


def test_camera_path_has_eight_rigid_views():
    path = json.loads(json.dumps(demo.camera_path()))
    assert len(path["camera_path"]) == 8 and (path["render_width"], path["render_height"]) == (960, 720)
    for view in path["camera_path"]:
        matrix = np.array(view["camera_to_world"]).reshape(4, 4)
        np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-8)
        assert np.linalg.det(matrix) == pytest.approx(1) and 20 < view["fov"] < 90


def test_the_demo_scan_is_in_metres():
    with laspy.open("assets/demo.laz") as scan:
        (keys,) = scan.header.vlrs.get("GeoKeyDirectoryVlr")
    assert {key.id: key.value_offset for key in any_typed(keys).geo_keys}[3076] == 9001, "as other programs read it"
    reference = open_source(Path("assets/demo.laz"))
    assert (reference.units, reference.metres_per_unit, reference.crs) == ("metre", 1.0, None)
