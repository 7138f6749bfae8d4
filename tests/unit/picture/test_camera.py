"""The camera's geometry and what it refuses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.camera import FOCAL_LENGTHS, MAX_SIDE, Camera, from_fov, look_at

coordinate = st.floats(-1e7, 1e7)
point = st.tuples(coordinate, coordinate, coordinate)


@given(point, point)
def test_look_at_is_a_rotation_that_looks_there(position, target):
    matrix = look_at(position, target)
    rotation = matrix[:3, :3]
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) and np.linalg.det(rotation) > 0
    ahead = np.subtract(target, position)
    if np.linalg.norm(ahead) > 1e-3:
        assert np.allclose(-matrix[:3, 2], ahead / np.linalg.norm(ahead), atol=1e-9)


@given(point, point, st.floats(1, 170))
def test_view_rotation_and_inverse_agree(position, target, fov):
    camera = from_fov(80, 60, fov, look_at(position, target))
    assert np.allclose(camera.world_to_camera @ camera.camera_to_world, np.eye(4), atol=1e-6 * (1 + np.abs(position).max()))
    ahead = camera.view_rotation @ camera.forward
    assert np.allclose(ahead, [0, 0, 1], atol=1e-9) and camera.vertical_fov == pytest.approx(fov)
    assert np.allclose(camera.view_rotation @ camera.up, [0, -1, 0], atol=1e-9)


def test_resized_keeps_the_vertical_field_of_view_and_the_centre():
    camera = Camera(640, 480, 500, 510, 300, 250, np.eye(4))
    twice = camera.resized(1280, 960)
    assert (twice.fx, twice.fy, twice.cx, twice.cy) == (1000, 1020, 600, 500)
    assert camera.resized(960, 480).cx == 460 and camera.resized(960, 480).vertical_fov == camera.vertical_fov


@pytest.mark.parametrize("factor", [0.01, 3.0, 1000.0])
def test_a_scale_in_the_rotation_is_taken_out(factor):
    matrix = look_at((1, 2, 3), (4, 5, 6))
    scaled = matrix.copy()
    scaled[:3, :3] *= factor
    assert np.allclose(from_fov(8, 6, 60, scaled).camera_to_world, matrix, atol=1e-9)


def test_an_exact_rotation_stays_to_the_bit():
    matrix = look_at((0.1, 0.2, 0.3), (4, 5, 6))
    assert np.array_equal(from_fov(8, 6, 60, matrix).camera_to_world, matrix)


@pytest.mark.parametrize("changes, said", [
    ({"width": 0}, "width 0"), ({"height": 20000}, "height 20000"), ({"width": 3.5}, "width 3.5"),
    ({"fx": 0.0}, "fx 0.0"), ({"fy": float("nan")}, "fy nan"), ({"cx": float("inf")}, "principal point"),
    ({"camera_to_world": np.zeros((4, 4))}, "singular"), ({"camera_to_world": np.diag([1.0, 1, -1, 1])}, "mirrored"),
    ({"camera_to_world": np.eye(3)}, "4x4"), ({"camera_to_world": np.full((4, 4), np.nan)}, "finite"),
    ({"camera_to_world": np.diag([1.0, 2.0, 1.0, 1.0])}, "not a rotation"),
])
def test_bad_cameras_are_refused_by_name_and_value(changes, said):
    good = {"width": 8, "height": 6, "fx": 5.0, "fy": 5.0, "cx": 4.0, "cy": 3.0, "camera_to_world": np.eye(4), "name": "c7"}
    with pytest.raises(InputError, match=said) as caught:
        Camera(**{**good, **changes})
    assert "'c7'" in str(caught.value)


@pytest.mark.parametrize("shear, fine", [(0.015, True), (0.025, False)])
def test_a_pose_may_be_off_a_rotation_by_a_hundredth(shear, fine):
    matrix = look_at((1, 2, 3), (4, 5, 6))
    sheared = matrix.copy()
    sheared[:3, 0] += shear * matrix[:3, 1]
    if fine:
        assert np.allclose(from_fov(8, 6, 60, sheared).camera_to_world, matrix, atol=0.01)
        return
    with pytest.raises(InputError, match="not a rotation"):
        from_fov(8, 6, 60, sheared)


def test_whatever_the_last_row_says_the_pose_ends_in_that_of_a_pose():
    matrix = np.eye(4)
    matrix[3] = (1, 2, 3, 4)
    assert np.array_equal(from_fov(8, 6, 60, matrix).camera_to_world, np.eye(4))


def test_the_largest_side_is_allowed_and_no_larger_one():
    for width, height in ((MAX_SIDE, 1), (1, MAX_SIDE)):
        camera = Camera(width, height, 5.0, 5.0, 0.5, 0.5, np.eye(4))
        assert (camera.width, camera.height) == (width, height)
        with pytest.raises(InputError, match=f"{MAX_SIDE + 1}: expected a whole number of pixels from 1 to {MAX_SIDE}"):
            Camera(width + (width > 1), height + (height > 1), 5.0, 5.0, 0.5, 0.5, np.eye(4))


@pytest.mark.parametrize("focal, side", [("fx", "width"), ("fy", "height")])
def test_a_focal_length_is_judged_by_its_own_side(focal, side):
    lens = {"width": 1, "height": 1, "fx": 1.0, "fy": 1.0, "cx": 0.5, "cy": 0.5, "camera_to_world": np.eye(4)}
    most = FOCAL_LENGTHS[1] * 1000
    assert getattr(Camera(**{**lens, side: 1000, focal: most}), focal) == most
    with pytest.raises(InputError, match=f"{focal} .* no picture 1000 pixels across"):
        Camera(**{**lens, side: 1000, focal: 2 * most})


def test_projection_follows_the_pixel_convention():
    camera = Camera(80, 60, 100.0, 50.0, 40.0, 30.0, look_at((1, 2, 3), (2, 2, 3)))  # along +x: right is -y, up is +z
    x, y, z = camera.view_rotation @ (np.array([6.0, 1.5, 3.25]) - camera.position)
    assert (x, y, z) == pytest.approx((0.5, -0.25, 5.0))
    assert (camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy) == pytest.approx((50.0, 27.5))
    assert camera.right == pytest.approx([0, -1, 0]) and camera.up == pytest.approx([0, 0, 1])


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0, 1e-3), (0, 3, 4)])
@pytest.mark.parametrize("sign", [1, -1])
def test_looking_straight_along_up_is_still_a_rotation(up, sign):
    matrix = look_at((5, 6, 7), np.array([5.0, 6, 7]) + sign * np.array(up, float), up)
    assert np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3)) and np.linalg.det(matrix[:3, :3]) == pytest.approx(1)


def test_moved_keeps_the_lens_and_nothing_else():
    camera = Camera(640, 480, 500, 510, 300, 250, np.eye(4), "here")
    there = camera.moved(look_at((1, 2, 3), (4, 5, 6)))
    assert (there.fx, there.fy, there.cx, there.cy, there.name) == (500, 510, 300, 250, "here")
    assert np.array_equal(there.position, [1, 2, 3]) and there.forward == pytest.approx(np.full(3, 3**-0.5))
    assert np.array_equal(camera.position, [0, 0, 0]) and np.array_equal(camera.view_rotation, np.diag([1, -1, -1]))


def test_a_pose_cannot_be_changed_from_outside():
    matrix = np.eye(4)
    camera = from_fov(8, 6, 60, matrix)
    matrix[0, 3] = 9
    assert camera.position[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        camera.camera_to_world[0, 3] = 9


@pytest.mark.parametrize("fov", [0, 180, -5, float("nan")])
def test_from_fov_refuses_what_no_lens_sees(fov):
    with pytest.raises(InputError, match=f"field of view {fov!r}"):
        from_fov(8, 6, fov, np.eye(4))


@pytest.mark.parametrize("field", ["width", "height", "fx", "fy", "cx", "cy"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), "wide", None, 10**400])
def test_a_lens_that_is_no_number_is_refused_in_one_line(field, value):
    lens = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 32.0, "cy": 24.0, field: value}
    with pytest.raises(InputError) as caught:
        Camera(**lens, camera_to_world=np.eye(4))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("matrix", [[["a"] * 4] * 4, None, [[1, 2], [3]], "identity"])
def test_a_pose_that_is_no_matrix_is_refused_in_one_line(matrix):
    with pytest.raises(InputError, match="camera_to_world must be a finite 4x4 matrix"):
        Camera(64, 48, 50.0, 50.0, 32.0, 24.0, matrix)


@pytest.mark.parametrize("up", [(1, 1, 1), (0, 0, 1), (-2, -2, -2), (1, 0, 0), (1, 1, 0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_looking_along_any_up_is_still_a_rotation(up, sign):
    matrix = look_at((1, 2, 3), np.array((1, 2, 3)) + sign * np.array(up, float), up)
    assert np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1)
