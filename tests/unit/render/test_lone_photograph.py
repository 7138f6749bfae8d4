"""Photographs of an E57 in place: every projection lands within a pixel, from its own place and from beside it."""

import numpy as np
import pytest
from e57_photo_files import AWAY, Picture, encoded, hit, paint, projected, room_points, write_photos
from scipy.spatial.transform import Rotation
from untyped import any_typed

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.preprocess.closed_depth import filled_depth
from pointglass.viewer.readers.e57.e57_photographs import KINDS, posed_photographs
from pointglass.viewer.render.photographs.lone_photograph import photograph_alone
from pointglass.viewer.render.photographs.photo_fit import PointSample, unfitted
from pointglass.viewer.render.photographs.photo_pool import PhotoPool, prepared_photo
from pointglass.viewer.window.viewport.photo_blend import agreement, blended, strength

SIZE = (250, 125)
"""Below 256, so that a channel can say which column or row a pixel is."""
PLACE = np.array([0.3, -0.2, 0.1])


def geometry(kind: str, finer: int = 1) -> dict:
    """The numbers of a representation; its own arithmetic is in :func:`rays_of`.  finer: times as many pixels along a side."""
    width, height = SIZE[0] * finer, SIZE[1] * finer
    values: dict = {"imageWidth": width, "imageHeight": height}
    if kind == "pinhole":
        return values | {"focalLength": 0.02, "pixelWidth": 0.0002 / finer, "pixelHeight": 0.0002 / finer,
                         "principalPointX": 120.0 * finer, "principalPointY": 66.0 * finer}  # fmt: skip
    if kind == "spherical":
        return values | {"pixelWidth": 2 * np.pi / width, "pixelHeight": np.pi / height}
    return values | {"pixelWidth": 2 * np.pi / width, "pixelHeight": 0.02 / finer, "radius": 0.8,
                     "principalPointY": 60.0 * finer}


def rays_of(kind: str) -> np.ndarray:
    """(H, W, 3) directions of the pixel centres in the photograph's frame, from the standard's text."""
    width, height = SIZE
    i, j = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    if kind == "pinhole":
        return np.stack([(i - 120.0) * 0.0002, (66.0 - j) * 0.0002, np.full(i.shape, -0.02)], -1)
    azimuth = (width / 2 - i) * 2 * np.pi / width
    if kind == "spherical":
        elevation = (height / 2 - j) * np.pi / height
        return np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)
    return np.stack([0.8 * np.cos(azimuth), 0.8 * np.sin(azimuth), (60.0 - j) * 0.02], -1)


def written(tmp_path, kind: str, picture: np.ndarray, rotation: Rotation):
    x, y, z, w = rotation.as_quat()
    values, blobs = geometry(kind, len(picture) // SIZE[1]), {"pngImage": encoded(picture)}
    made = Picture(kind, values, blobs, (w, x, y, z), tuple(PLACE + AWAY), kind)
    (photo,), warnings = posed_photographs(write_photos(tmp_path / f"{kind}.e57", [made], *room_points(50)))
    assert warnings == [] and photo.kind == kind
    return photo


def resampled(photo, camera, depth, points=None):
    """The photograph alone in a view; points: what hides it from itself."""
    picture, valid = photo.decode(4096)
    sample = PointSample((np.zeros((1, 3)) if points is None else points - photo.position).astype(np.float32),
                         np.zeros((1, 3), np.uint8), photo.position)
    fit = unfitted(photo, picture.shape[:2], sample)
    made = prepared_photo(picture, valid, KINDS.index(photo.kind), photo.lens, photo.around, fit.camera_to_world, fit.nearest,
                          fit.gains)  # fmt: skip
    pool = PhotoPool(1, len(made.words))
    pool.put(0, made)
    return photograph_alone(depth, camera, pool, 0, hides=points is not None)


@pytest.mark.parametrize("kind", KINDS)
def test_a_photograph_lies_in_place_within_a_pixel(tmp_path, seed, kind):
    random = np.random.default_rng(seed)
    width, height = SIZE
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    picture = np.stack([column, row, np.zeros_like(row)], -1).astype(np.uint8)  # each pixel says which one it is
    rotation = any_typed(Rotation.random)(random_state=int(random.integers(1 << 31)))
    photo = written(tmp_path, kind, picture, rotation)
    matrix, compared = rotation.as_matrix(), 0
    rays = rays_of(kind) @ matrix.T
    places = hit(PLACE, rays) + AWAY  # what each pixel saw, file coordinates
    for beside in (np.zeros(3), random.uniform(-0.2, 0.2, 3)):
        eye = PLACE + AWAY + beside
        for ahead in (photo.forward, photo.forward + random.normal(size=3) * 0.3):
            camera = from_fov(200, 150, 70.0, look_at(eye, eye + ahead, (0.1, 0.2, 1.0)))
            i, j = np.meshgrid(np.arange(200) + 0.5, np.arange(150) + 0.5)
            seen = camera.unproject(np.stack([i.ravel(), j.ravel()], 1), 1.0) - eye
            depth = np.linalg.norm(hit(PLACE + beside, seen) - (PLACE + beside), axis=1) / np.linalg.norm(seen, axis=1)
            shown = resampled(photo, camera, depth.reshape(150, 200).astype(np.float32))
            pixels, z = camera.project(places.reshape(-1, 3))
            at = np.floor(np.clip(np.nan_to_num(pixels, nan=-1.0), -1e6, 1e6)).astype(int)
            inside = (z > 0) & (at >= 0).all(axis=1) & (at < (200, 150)).all(axis=1)
            wanted = np.stack([column.ravel(), row.ravel()], 1)[inside]
            got = shown[at[inside, 1], at[inside, 0]].astype(int)
            # The photo's pixel was seen somewhere in this pixel of the picture: allow for where in it, in photo pixels.
            found = camera.unproject(at[inside] + 0.5, z[inside])
            there, fits = projected(photo, found)
            clear = (got[:, 3] == 255) & fits & (there[:, 0] > 2) & (there[:, 0] < width - 2) & (there[:, 1] > 2)
            clear &= (there[:, 1] < height - 2) & (np.abs(there - wanted - 0.5).max(axis=1) < 3)
            residual = np.abs(got[clear][:, :2] + 0.5 - there[clear])
            compared += int(clear.sum())
            assert np.percentile(residual, 99) < 1.0, (kind, np.percentile(residual, 99))
    assert compared > 2000


@pytest.mark.parametrize("kind", KINDS)
def test_a_photograph_does_not_colour_what_it_could_not_see(tmp_path, seed, kind):
    """A board stands between the photograph and a wall; from beside, the wall behind the board keeps its own colours."""
    random = np.random.default_rng(seed)
    rotation = Rotation.from_euler("x" if kind == "pinhole" else "z", 90, degrees=True)
    photo = written(tmp_path, kind, np.full((4 * SIZE[1], 4 * SIZE[0], 3), 90, np.uint8), rotation)
    place, wall, board, half = photo.position, 5.0, 2.0, 0.3  # along +y of the photograph's place
    spread = random.uniform(-1, 1, (200_000, 2))
    points = np.concatenate([
        place + np.column_stack([spread[:100_000, 0] * 4, np.full(100_000, wall), spread[:100_000, 1] * 3]),
        place + np.column_stack([spread[100_000:, 0] * half, np.full(100_000, board), spread[100_000:, 1] * half]),
    ])
    assert abs(photo.forward[1]) > 0.99
    eye = place + (1.5, 0.0, 0.0)
    camera = from_fov(240, 180, 60.0, look_at(eye, place + (0.0, wall, 0.0), (0.0, 0.0, 1.0)))
    i, j = np.meshgrid(np.arange(240) + 0.5, np.arange(180) + 0.5)
    rays = camera.unproject(np.stack([i.ravel(), j.ravel()], 1), 1.0) - eye
    to_board = eye + rays * (board / rays[:, 1:2]) - place
    on_board = (np.abs(to_board[:, [0, 2]]) < half).all(axis=1)
    z = np.where(on_board, board, wall) / rays[:, 1]
    seen = eye + rays * z[:, None] - place
    shadow = ~on_board & (np.abs(seen[:, [0, 2]]) < half * wall / board * 0.9).all(axis=1)
    clear = ~on_board & (np.abs(seen[:, [0, 2]]) > half * wall / board * 1.15).any(axis=1)
    clear &= (np.abs(seen[:, [0, 2]]) < (3.9, 2.9)).all(axis=1)  # where there are points
    depth = z.reshape(180, 240).astype(np.float32)
    plain = resampled(photo, camera, depth)[..., 3].ravel() > 127
    shown = resampled(photo, camera, depth, points)[..., 3].ravel() > 127
    assert (plain & shadow).sum() > 200, "else nothing is tested"
    assert not (shown & shadow).any()
    assert (shown <= plain).all() and shown[on_board].sum() == plain[on_board].sum()
    assert shown[clear].sum() > 0.97 * plain[clear].sum(), "but for grazing places, which vary much within a direction"


@pytest.mark.parametrize("kind", KINDS)
def test_places_project_onto_the_pixels_that_saw_them(tmp_path, seed, kind):
    rotation = any_typed(Rotation.random)(random_state=seed)
    rays = rays_of(kind) @ rotation.as_matrix().T
    photo = written(tmp_path, kind, paint(hit(PLACE, rays)), rotation)
    pixels, seen = projected(photo, (hit(PLACE, rays) + AWAY).reshape(-1, 3))
    i, j = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    assert seen.all() and np.abs(pixels - np.stack([i.ravel(), j.ravel()], 1)).max() < 1e-6


def test_what_lies_behind_a_pinhole_camera_is_not_in_the_picture(tmp_path):
    photo = written(tmp_path, "pinhole", np.zeros((SIZE[1], SIZE[0], 3), np.uint8), Rotation.identity())
    _, seen = projected(photo, photo.position + np.array([[0.0, 0, 1], [0, 0, -1]]))
    assert seen.tolist() == [False, True]


def test_blending_and_splitting(seed):
    random = np.random.default_rng(seed)
    view, photo = (np.dstack([random.integers(0, 256, (8, 9, 3)), np.full((8, 9), 255)]).astype(np.uint8) for _ in range(2))
    photo[:, 6:] = 0
    assert (blended(view, photo, 0.0) == view).all()
    whole = blended(view, photo, 1.0)
    assert (whole[:, :6] == photo[:, :6]).all() and (whole[:, 6:] == view[:, 6:]).all()
    half = blended(view, photo, 1.0, split=3)
    assert (half[:, :3] == photo[:, :3]).all() and (half[:, 3:] == view[:, 3:]).all()


def test_agreement_is_psnr_where_both_show(seed):
    random = np.random.default_rng(seed)
    view = np.dstack([random.integers(20, 200, (30, 40, 3)), np.full((30, 40), 255)]).astype(np.uint8)
    photo = view.copy()
    photo[..., :3] += 10
    photo[5:, :, 3] = 0
    assert agreement(view, photo) == pytest.approx(20 * np.log10(255 / 10))
    assert agreement(view, view) == np.inf and agreement(view, np.zeros_like(view)) is None


def test_a_photograph_fades_on_the_way():
    assert strength(0.0, 1.0, 0.7) == 0.7
    assert 0 < strength(1.0, 1.0, 1.0) < 1 and strength(2.0, 1.0, 1.0) == 0.0
    assert strength(1.0, 0.3048, 1.0) > strength(1.0, 1.0, 1.0)


def test_holes_get_a_depth_between_those_around(seed):
    random = np.random.default_rng(seed)
    for shape in ((37, 53), (1, 9), (64, 64)):
        depth = np.where(random.random(shape) < 0.1, random.uniform(2, 5, shape), np.inf).astype(np.float32)
        depth[0, 0] = 3.0
        full = filled_depth(depth)
        known = np.isfinite(depth)
        assert (full[known] == depth[known]).all()
        assert full.min() >= depth[known].min() and full.max() <= depth[known].max()
    assert np.isinf(filled_depth(np.full((5, 6), np.inf, np.float32))).all()
    wall = np.full((40, 40), np.inf, np.float32)
    wall[::4, ::4] = 2.5
    assert np.allclose(filled_depth(wall), 2.5)


def test_damaged_geometry_is_refused_by_name(tmp_path):
    values = geometry("cylindrical")
    del values["radius"]
    made = Picture("cylindrical", values, {"pngImage": encoded(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))}, name="bent")
    found, (warning,) = posed_photographs(write_photos(tmp_path / "a.e57", [made], *room_points(50)))
    assert found == [] and "bent" in warning and "radius" in warning
