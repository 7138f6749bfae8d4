"""Extreme lenses, picture sizes, poses and points near the camera plane, against float64 and against the reference
implementation in torch."""

import frame_claims
import numpy as np
import pytest
from reference import reference_frame
from scenes import axis_camera
from test_frame import assert_agrees

from pointglass.viewer.bench.cases.stability import VIEWS, placed, view_inside, walls
from pointglass.viewer.common.errors import DeviceError, InputError
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import MAX_SIDE, Camera, from_fov
from pointglass.viewer.picture.settings import Settings

pytestmark = pytest.mark.gl
PRIMES = [5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 53, 67, 89, 127]


def test_fields_of_view_from_1_to_170_degrees(renderers, seed, claims):
    claims(frame_claims.lenses(renderers, seed, (160, 120)))


def test_extreme_lenses_agree_with_the_reference(renderers, seed):
    xyz, rgb, origin = frame_claims.place_at(seed, 1.0, 1e6)
    scene = scene_from_arrays(xyz, rgb)
    with renderers.renderer(scene) as renderer:
        for fov in (1.0, 170.0):
            camera = placed(view_inside(seed, (96, 64), fov), 1.0, origin)
            shown = renderer.render(camera, Settings(), views=VIEWS)
            assert_agrees(shown, reference_frame(scene, camera, Settings()))


def test_cameras_in_a_cell_and_on_its_face_edge_and_corner(renderers, seed, claims):
    claims(frame_claims.cell_faces(renderers, seed, (96, 64)))


def test_points_at_behind_and_within_an_epsilon_of_the_cameras_plane(renderers, seed, claims):
    claims(frame_claims.camera_plane(renderers, seed))


@pytest.mark.parametrize("power", [None, 12, 30, 45])
def test_the_cameras_plane_is_the_same_in_both_rasterisers_and_the_reference(renderers, seed, power):
    """Every second point in one plane, the camera in it or 2**-power from it: depths equal to the bit."""
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform(-1, 1, (3000, 3)) * 2**12) / 2**12
    xyz[::2, 1] = 0.25
    scene = scene_from_arrays(xyz, rng.integers(0, 256, xyz.shape).astype(np.uint8))
    packed = 0.25 + 0.5 * scene.step
    with renderers.renderer(scene) as renderer:
        for side in (-1, 1):
            camera = axis_camera((41, 29), (0.0, packed + side * (2.0**-power if power else 0.0), 0.0))
            reference = reference_frame(scene, camera, Settings())
            for kind in ("compute", "points"):
                frame = renderer.render(camera, Settings(raster=kind), views=VIEWS)
                assert np.array_equal(frame.depth(), reference.raster.depth.numpy())
                assert (frame.depth() > 0).all()


def test_pictures_from_4x4_to_16384_along_a_side(renderers, seed, claims):
    claims(frame_claims.sizes(renderers, seed))


def test_odd_and_prime_sizes_agree_with_the_reference(renderers, seed):
    rng = np.random.default_rng(seed)
    scene = scene_from_arrays(*walls(seed, 20_000))
    with renderers.renderer(scene) as renderer:
        for size in [(4, 4), *(tuple(int(n) for n in rng.choice(PRIMES, 2)) for _ in range(6))]:
            camera = view_inside(seed, size, 70.0)
            shown = renderer.render(camera, Settings(), views=VIEWS)
            assert_agrees(shown, reference_frame(scene, camera, Settings()))


def test_pictures_beyond_the_devices_textures_are_refused_and_the_next_is_drawn(renderers, seed):
    scene = scene_from_arrays(*walls(seed, 5_000))
    camera = view_inside(seed, (40, 30))
    with renderers.renderer(scene) as renderer:
        before = renderer.render(camera, Settings(), views=("raw",)).image("raw")
        renderer._sizes._limit = 64
        for size in ((65, 10), (10, 65)):
            with pytest.raises(DeviceError, match=rf"{size[0]}x{size[1]} is larger than this device's textures \(64") as caught:
                renderer.render(camera.resized(*size), Settings(), views=("raw",))
            assert "\n" not in str(caught.value) and "--size" in str(caught.value)
        assert np.array_equal(renderer.render(camera, Settings(), views=("raw",)).image("raw"), before)
    for size in ((MAX_SIDE + 1, 10), (10, MAX_SIDE + 1), (0, 10)):
        with pytest.raises(InputError, match="expected a whole number of pixels"):
            from_fov(*size, 60.0, np.eye(4))


def test_rolled_and_upside_down_cameras_show_the_same_picture_turned(renderers, seed, claims):
    claims(frame_claims.rolled(renderers, seed))


def test_a_matrix_that_carries_a_scale_draws_the_same_picture(renderers, seed):
    scene = scene_from_arrays(*walls(seed))
    camera = view_inside(seed, (120, 90))
    rng = np.random.default_rng(seed)
    with renderers.renderer(scene) as renderer:
        plain = renderer.render(camera, Settings(), views=("raw",)).image("raw")
        for factor in (10.0 ** rng.uniform(-9, 9), 1e-160, 1e160):
            pose = camera.camera_to_world.copy()
            pose[:3, :3] *= factor
            made = renderer.render(camera.moved(pose), Settings(), views=("raw",)).image("raw")
            assert (made != plain).any(-1).mean() <= 1e-3


def test_singular_mirrored_and_sheared_matrices_are_refused_in_one_line(seed):
    rng = np.random.default_rng(seed)
    pose = view_inside(seed, (8, 6)).camera_to_world
    flat, mirrored, sheared, bent = (pose.copy() for _ in range(4))
    flat[:3, rng.integers(3)] = 0
    mirrored[:3, rng.integers(3)] *= -1
    sheared[:3, 0] += rng.uniform(0.1, 1) * sheared[:3, 1]
    bent[:3, rng.integers(3)] *= rng.uniform(2, 300)
    rank_one = pose.copy()
    rank_one[:3, :3] = np.outer(pose[:3, 0], pose[:3, 1])
    for matrix, said in [(flat, "singular"), (mirrored, "mirrored"), (sheared, "sheared"), (bent, "unevenly"),
                         (rank_one, "singular"), (np.full((4, 4), np.nan), "finite"), (np.full((4, 4), np.inf), "finite"),
                         (np.zeros((4, 4)), "singular")]:
        with pytest.raises(InputError, match=said) as caught:
            Camera(8, 6, 5.0, 5.0, 4.0, 3.0, matrix)
        assert "\n" not in str(caught.value)
