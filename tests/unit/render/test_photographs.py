"""The compiled loops of photographs against their reference implementation, on random places, photographs and cameras."""

from functools import partial

import numpy as np
import pytest
from e57_photo_files import projected
from scipy.spatial.transform import Rotation
from untyped import any_typed

from pointglass.model.reference import photo_colours as reference
from pointglass.viewer.picture.camera import Camera
from pointglass.viewer.readers.e57.e57_photographs import KINDS
from pointglass.viewer.readers.photographs.posed_photograph import PosedPhotograph
from pointglass.viewer.render.photographs.photo_pass import photographed
from pointglass.viewer.render.photographs.photo_pool import LEVEL, LEVELS, PhotoPool, mip_levels, prepared_photo
from pointglass.viewer.render.photographs.shadow_kernels import VOTES, count_votes

SIZE = 90, 70


def random_photo(rng, kind):
    width, height = int(rng.integers(40, 200)), int(rng.integers(30, 120))
    picture = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    valid = rng.random((height, width)) > 0.02 if rng.random() < 0.5 else None
    if kind == reference.PINHOLE:
        lens, around = (0.6 * width, 0.7 * width, 0.5 * width + 3, 0.45 * height), False
    else:
        around = bool(rng.random() < 0.7)
        lens = (width / (2 * np.pi) if around else width / 4, height / 2.5, width / 2, height / 2)
    pose = np.eye(4)
    level = Rotation.from_matrix(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]]) if kind == reference.PINHOLE
                                 else np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0]]))
    pose[:3, :3] = (Rotation.from_euler("xyz", rng.normal(0, 0.2, 3)) * level).as_matrix()
    pose[:3, 3] = rng.normal(0, 0.5, 3)
    nearest = rng.uniform(3.0, 6.0, (int(rng.integers(5, 30)), int(rng.integers(5, 30)))).astype(np.float32)
    gains = rng.uniform(0.7, 1.3, 3)
    return picture, valid, kind, lens, around, pose, nearest, gains


def random_surface(rng):
    """A camera, the depth of two noisy planes with an edge between them and some holes, filled colours, measured pixels."""
    width, height = SIZE
    camera = Camera(width, height, 75.0, 78.0, 44.0, 36.0, np.eye(4), "here")
    y, x = np.mgrid[:height, :width]
    depth = (1 / (0.25 + 0.0008 * x * rng.uniform(-1, 1) + 0.0008 * y * rng.uniform(-1, 1))).astype(np.float32)
    depth[:, 60:] *= 0.7  # an edge
    depth += rng.normal(0, 0.002, depth.shape).astype(np.float32)
    depth[rng.random(depth.shape) < 0.002] = 0
    filled = rng.integers(0, 256, (height, width, 4), dtype=np.uint8)
    filled[40:, :40, :3] //= 3  # photographs show something else here
    measured = np.where(rng.random(depth.shape) < 0.25, 255, 0).astype(np.uint8)
    return camera, depth, filled, measured


def test_each_place_votes_for_the_photographs_that_show_it_best(seed):
    """The choice among many, against a plain projection and a sort."""
    rng = np.random.default_rng(seed)
    places, eye = rng.uniform(-3, 3, (40, 3)), rng.normal(0, 0.5, 3)
    view = (places - eye) / np.linalg.norm(places - eye, axis=1, keepdims=True)
    photos = []
    for k in range(60):
        picture, _, kind, lens, around, pose, _, _ = random_photo(rng, k % 3)
        pose[:3, 3] *= 4
        height, width = picture.shape[:2]
        decode = any_typed(partial(np.asarray, picture))
        photos.append(PosedPhotograph("", KINDS[kind], width, height, lens, around, pose, decode))
    worth = np.zeros((len(photos), len(places)))
    for k, photo in enumerate(photos):
        ray = places - photo.position
        far = np.linalg.norm(ray, axis=1)
        apart = 1 - (ray * view).sum(axis=1) / far
        worth[k] = np.where(projected(photo, places)[1], photo.lens[0] / ((reference.LEAST_ANGLE + apart) * far), 0)
    expected = np.zeros(len(photos))
    for p in range(len(places)):
        for rank, k in enumerate(np.argsort(-worth[:, p], kind="stable")[:VOTES]):
            expected[k] += (worth[k, p] > 0) / (rank + 1)
    turns = np.stack([photo.camera_to_world[:3, :3].T for photo in photos])
    votes = np.zeros(len(photos))
    count_votes(places, view, votes, turns, np.stack([-turn @ photo.position for turn, photo in zip(turns, photos)]),
                np.array([KINDS.index(photo.kind) for photo in photos]),
                np.array([photo.lens for photo in photos]),
                np.array([photo.around for photo in photos]),
                np.array([(photo.width, photo.height) for photo in photos], np.float64))  # fmt: skip
    assert np.allclose(votes, expected)


@pytest.mark.parametrize("kind", [reference.PINHOLE, reference.SPHERICAL, reference.CYLINDRICAL])
def test_the_loops_colour_as_the_reference_does(kind, seed):
    rng = np.random.default_rng(seed)
    camera, depth, filled, measured = random_surface(rng)
    given = [random_photo(rng, kind if k else reference.PINHOLE) for k in range(12)]
    prepared = [prepared_photo(*photo) for photo in given]
    pool = PhotoPool(len(given), max(len(photo.words) for photo in prepared))
    for number, photo in enumerate(prepared):
        pool.put(number, photo)
    pool.presence = {0: 0.4, 5: 0.7}  # they fade in
    told = photographed(filled, depth, measured, camera, pool, list(range(len(given))))
    made, share, colours, grid = told.made, told.share, told.colours, told.grid
    photos = []
    for number, (picture, valid, which, lens, around, pose, nearest, gains) in enumerate(given):
        turn = pose[:3, :3].T @ camera.view_rotation.T
        shift = pose[:3, :3].T @ (camera.position - pose[:3, 3])
        photos.append(reference.ReferencePhoto(mip_levels(picture, valid), which, lens, around, turn, shift, nearest, gains,
                                               pool.presence.get(number, 1.0)))
    lens = camera.fx, camera.fy, camera.cx, camera.cy
    mean, part = reference.photographed(filled, depth, measured > 127, lens, photos)
    wanted, counts = reference.over_filled(filled[..., :3].astype(float), colours[..., :3].astype(float), colours[..., 3] / 255)
    assert 0.1 < np.mean(part > 0.1) < 0.99 and 0.02 < np.mean(counts[part > 0.1] < 0.05) < 0.98  # the case decides something
    assert np.mean(np.abs(colours[..., 3] / 255 - part) > 0.01) < 0.004
    assert np.mean(np.abs(colours[..., :3] - mean)[part > 0.01].max(-1) > 1.5) < 0.004
    assert np.abs(share / 255 - counts).max() < 0.01 and np.abs(made[..., :3] - wanted).max() < 1.5
    assert np.array_equal(made[..., 3], filled[..., 3]) and np.array_equal(made[counts == 0], filled[counts == 0])
    blocks = reference.spacing_in_pixels(measured > 127)[4::8, 4::8]  # half a pixel beside their middles
    assert np.abs(grid[: len(blocks), : blocks.shape[1]] - blocks).max() < 0.5


def test_a_pool_keeps_what_is_used_and_lets_go_of_what_was_used_longest_ago(seed):
    rng = np.random.default_rng(seed)
    camera = Camera(8, 8, 8.0, 8.0, 4.0, 4.0, np.eye(4), "here")
    prepared = [prepared_photo(*random_photo(rng, reference.PINHOLE)) for _ in range(4)]
    pool = PhotoPool(3, max(len(photo.words) for photo in prepared))
    for number in range(3):
        pool.put(number, prepared[number])
    pool.records([0], camera)
    pool.put(3, prepared[3], keep=frozenset([1]))
    assert [number in pool for number in range(4)] == [True, True, False, True]
    _, places = pool.records([3, 0], camera)
    for row, number in enumerate((3, 0)):
        begin = places[row, LEVEL]
        first = prepared[number].words[: int(prepared[number].places[LEVEL + 1])]
        assert places[row, LEVELS] > 2 and np.array_equal(pool.words[begin : begin + len(first)], first)
