"""Several files in one scene: which points are of which, places far apart, and the view that a scan in its own colours gets."""

from dataclasses import replace

import numpy as np
import pytest
from cloud_files import surface, write_las

from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.picture.look import Look
from pointglass.viewer.window.flight.start_viewpoint import near_survey, start_camera, survey
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.places.start_view import standing_view_in
from pointglass.viewer.work.scan_files import files_of, main_place, sample_of_file


def two_files(tmp_path, away, points=(3000, 2000)):
    """Two tiles, the second ``away`` metres east of the first."""
    files = []
    for number, count in enumerate(points):
        xyz, rgb = surface(count, number, (number * away, 0.0, 0.0))
        files.append(write_las(tmp_path / f"{number}.las", xyz, rgb))
    return open_scene(files, cache=False), files


def test_each_file_has_its_points(tmp_path):
    scene, files = two_files(tmp_path, 6.0)
    parts = files_of(scene)
    assert [part.path for part in parts] == [str(file) for file in files] and all(part.apart for part in parts)
    for number, part in enumerate(parts):
        seen = sample_of_file(scene, survey(scene), part)
        assert seen is not None
        assert np.abs(seen.points[:, 0].mean() - survey(scene).points[:, 0].mean()) > 1.0
        assert (seen.points[:, 0].min() > 5.0) == (number == 1)
    assert near_survey(survey(scene)) is not None and main_place(survey(scene))[1] == 1


@pytest.mark.parametrize("away", [900.0, 60_000.0])
def test_the_view_of_places_far_apart_begins_at_one_of_them(tmp_path, away):
    scene, _ = two_files(tmp_path, away)
    near, places = main_place(survey(scene))
    assert places == 2 and np.ptp(near.points, axis=0).max() < 10 and abs(near.points[:, 0]).max() < 10
    camera = start_camera(scene, 320, 200)
    pixels, depth = camera.project(near.points)
    inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels <= (320, 200)).all(axis=1)
    assert inside.mean() > 0.5 and np.ptp(pixels[inside], axis=0).max() > 80, "it fills the picture"


def test_control_points_and_one_wide_scan_are_no_places():
    random = np.random.default_rng(4)
    for xyz in (random.random((12, 3)) * 4000, random.random((5000, 3)) * (4000, 4000, 20)):
        seen = survey(scene_from_arrays(xyz, np.full((len(xyz), 3), 90, np.uint8), noise=False))
        assert main_place(seen)[0] is seen


def test_the_next_scan_is_not_shown_as_the_one_that_was_coloured_by_class():
    from window_session import session

    made, _ = session()
    views = made.view_settings
    assert views.settings.view == "filled"
    views.show_points()
    made.work.edit("class", look=Look(colour_by="class"))
    views.begin(made.document)
    assert views.settings.view == "filtered", "a project that is coloured by class stays so"
    views.begin(Document())
    assert views.settings.view == "filled"
    views.show_points()
    views.show("raw")  # chosen by a person
    views.begin(replace(Document()))
    assert views.settings.view == "raw"


def test_a_file_of_a_place_is_shown_from_within_where_one_can_stand(tmp_path, seed):
    random, size, files = np.random.default_rng(seed), np.array([6.0, 5.0, 3.0]), []
    for number in range(2):  # two rooms, wall to wall
        xyz = random.random((60_000, 3))
        xyz[np.arange(60_000), random.integers(0, 3, 60_000)] = random.integers(0, 2, 60_000)
        rgb = random.integers(60, 256, (60_000, 3), dtype=np.uint8)
        files.append(write_las(tmp_path / f"{number}.las", xyz * size + (6.0 * number, 0.0, 0.0), rgb))
    scene = open_scene(files, cache=False)
    for number, part in enumerate(files_of(scene)):
        own = sample_of_file(scene, survey(scene), part)
        assert own is not None
        view = standing_view_in(scene, own, np.eye(3))
        assert view is not None
        assert (view[0] > (6.0 * number, 0.0, 0.0)).all() and (view[0] < (6.0 + 6.0 * number, 5.0, 3.0)).all()
