"""Moving an orthographic camera: changing to it and back, zooming about a pixel, keys, and views that are kept."""

import io
import xml.etree.ElementTree as xml
import zipfile
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from documents import random_document

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.json_values import from_json, to_json
from pointglass.viewer.window.flight.flight import Flight
from pointglass.viewer.window.flight.start_viewpoint import start_state, survey
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.notes.note_bcf import Topic, bcf_bytes
from pointglass.viewer.work.project import read_project, write_project
from pointglass.viewer.work.viewpoint import Viewpoint

SIZE = 600, 400


@pytest.fixture
def flown(seed):
    """A flight over a box of points far from the origin, its clock, and random numbers."""
    rng = np.random.default_rng(seed)
    points = rng.random((20_000, 3)) * (12.0, 9.0, 4.0) + rng.uniform(-1e5, 1e5, 3)
    scene = scene_from_arrays(points, np.full((len(points), 3), 180, np.uint8))
    now = [0.0]
    flight, seen = Flight(lambda: now[0]), survey(scene)
    flight.begin(start_state(scene, seen, 1.5, (0.0, 0.0, 1.0)), seen)
    return flight, now, rng


def test_what_lies_at_the_depth_of_the_change_keeps_its_pixel_there_and_back(flown):
    flight, _, rng = flown
    before = flight.camera(SIZE)
    pixels = rng.uniform((0, 0), SIZE, (5, 2))
    places = before.unproject(pixels, 3.7)
    flight.to_orthographic(3.7)
    assert np.allclose(flight.camera(SIZE).project(places)[0], pixels, atol=1e-5) and not flight.moving
    flight.to_perspective()
    after = flight.camera(SIZE)
    assert after.orthographic is None and np.allclose(after.position, before.position, atol=1e-6)


def test_zooming_keeps_what_is_under_the_pointer_at_every_depth_and_stays_within_limits(flown):
    flight, _, rng = flown
    flight.to_orthographic(5.0)
    pixel = tuple(rng.uniform((0, 0), SIZE))
    places = flight.camera(SIZE).unproject([pixel] * 3, [0.5, 4.0, 90.0])
    for factor in (0.5, 0.1, 3.0):
        distance = flight.orthographic
        flight.zoom_at(SIZE, pixel, factor)
        assert flight.orthographic == pytest.approx(distance * factor)
        assert np.allclose(flight.camera(SIZE).project(places)[0], pixel, atol=1e-4)
    for factor in (1e-9, 1e12):
        flight.zoom_at(SIZE, pixel, factor)
        assert np.isfinite(flight.camera(SIZE).position).all() and 1e-6 < flight.height < 100.0


def test_keys_pan_and_zoom_and_the_direction_stays(flown):
    flight, now, _ = flown
    flight.to_orthographic(5.0)
    first = flight.camera(SIZE)
    middle = first.unproject([(300, 200)], 5.0)
    for held, moved in ((("right",), (-1, 0)), (("up",), (0, 1)), (("forward",), (0, 0))):
        before = flight.camera(SIZE)
        flight.held.update(held)
        for _ in range(5):
            now[0] += 0.05
            flight.advance()
        flight.held.clear()
        shift = flight.camera(SIZE).project(middle)[0] - before.project(middle)[0]
        assert (np.sign(np.round(shift[0], 6)) == moved).all() or held == ("forward",)
        flight.advance()
        assert not flight.under_way, "no momentum"
    assert np.array_equal(flight.camera(SIZE).view_rotation, first.view_rotation) and flight.orthographic < 5.0


def test_a_plan_that_is_kept_looks_straight_down_when_it_is_shown_again(flown, tmp_path):
    flight, now, rng = flown
    flight.to_orthographic(5.0)
    flight.look_from("top", 1.5)
    now[0] += 2.0
    flight.advance()
    plan = flight.camera(SIZE)
    assert np.abs(plan.forward - (0, 0, -1)).max() < 1e-6, "not a degree aside, as in flight"
    view = Viewpoint.of(plan, "plan")
    document = replace(random_document(rng, ["a.laz"]), viewpoints=(view,), view=view)
    write_project(tmp_path / "p.pointglass", document)
    kept = read_project(tmp_path / "p.pointglass").viewpoints[0]
    flight.go_home()
    assert flight.orthographic is None and flight.at_home
    flight.show(kept.camera(*SIZE))
    again = flight.camera(SIZE)
    assert np.allclose(again.camera_to_world, plan.camera_to_world, atol=1e-9) and again.orthographic == plan.orthographic
    flight.glide_to(replace(flight.home))
    assert flight.orthographic is None, "places are flown to in perspective"


def test_views_of_older_projects_are_pinholes_and_new_ones_are_written_as_before():
    pose = look_at((1.0, 2.0, 3.0), (0.0, 0.0, 0.0))
    pinhole = Viewpoint.of(from_fov(640, 480, 50.0, pose), "a")
    assert "orthographic" not in to_json(pinhole) and from_json(Viewpoint, to_json(pinhole), "view") == pinhole


def test_an_issue_of_an_orthographic_view_has_an_orthogonal_camera():
    camera = replace(from_fov(640, 480, 50.0, look_at((1.0, 2.0, 30.0), (0.0, 0.0, 0.0))), orthographic=7.0)
    note = Annotation("crack", (0.0, 0.0, 0.0), view=Viewpoint.of(camera, ""))
    data = bcf_bytes([Topic(note, 0, note.view)], metres_per_unit=0.3048, unit="ft", author="me", now=datetime.now())
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        (name,) = [each for each in file.namelist() if each.endswith(".bcfv")]
        view = xml.fromstring(file.read(name))
    assert view.find("PerspectiveCamera") is None
    height = float(view.findtext("OrthogonalCamera/ViewToWorldScale"))
    assert height == pytest.approx(480 * 7.0 / camera.fy * 0.3048)
