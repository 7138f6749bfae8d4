"""Orthographic pictures: each rasteriser and pass against its reference implementation, and picks to the point."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from clouds import room, scanned

from pointglass.model.network.network_layout import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE
from pointglass.model.reference.depth_filter import keep_mask
from pointglass.model.reference.hole_test import coverage
from pointglass.model.reference.parallel_depth import pinhole_depth
from pointglass.model.reference.projection import SoftZ, pixels, rasterise, unpack_points, view_points
from pointglass.model.reference.pull_push import pull_push
from pointglass.model.reference.ray_march import march, parallel_rays_of, sparse_depth
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import Camera, from_fov, look_at
from pointglass.viewer.picture.clip import Box
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.render.culling.cull import Culler
from pointglass.viewer.render.culling.enclosed_directions import Enclosure
from pointglass.viewer.render.device.context import describe_device
from pointglass.viewer.render.passes.depth_ratios import middle_depth
from pointglass.viewer.render.passes.fill import footprint_feature
from pointglass.viewer.work.places.pick import pick
from pointglass.viewer.work.selecting.select_points import by_outline, inside_outline, not_covered

pytestmark = pytest.mark.gl
ALL = ("raw", "filtered", "filled")


def orthographic_camera(scene, seed: int, size=(256, 100), *, inside: bool = False) -> Camera:
    """Looking anywhere, from outside the scene or ``inside``, at a scale that shows a part of it or all of it."""
    rng = np.random.default_rng(seed)
    low, high = scene.bounds
    diagonal = float(np.linalg.norm(high - low))
    target, ahead = rng.uniform(low, high), rng.normal(size=3)
    eye = rng.uniform(low, high) if inside else target - ahead / np.linalg.norm(ahead) * diagonal
    made = from_fov(*size, rng.uniform(30, 110), look_at(eye, target))
    return replace(made, orthographic=diagonal * rng.uniform(0.15, 1.5))


def drawn_of(scene, camera, settings):
    """The raster of the reference implementation in float32."""
    draw = Culler(scene).select(camera, settings.lod)
    take = np.repeat(draw.first - np.concatenate([[0], np.cumsum(draw.count)[:-1]]), draw.count) + np.arange(draw.points)
    cells = torch.from_numpy(np.repeat(draw.slot, draw.count))
    steps, rgb, _ = unpack_points(torch.from_numpy(np.asarray(scene.points[take], np.int64)))
    x, y, z = view_points(steps, cells, torch.from_numpy(draw.cell_view), torch.from_numpy(draw.axes))
    preset = SoftZ.preset(settings.soft_z, scene.spacing, 1.0)
    soft = replace(preset, relative=0.0, absolute=max(preset.relative * camera.orthographic, preset.absolute))
    index, inside = pixels(x, y, z, camera)
    return rasterise(index, z[inside], rgb[inside], camera.width, camera.height, soft)


@pytest.mark.parametrize("raster", ["cpu", "points", "compute"])
@pytest.mark.parametrize("inside", [False, True])
def test_every_rasteriser_draws_what_the_reference_draws(renderer_of, raster, inside, seed):
    scene = scanned(seed, scale=10.0 ** np.random.default_rng(seed).uniform(-2, 2), origin=(4e5, -3e4, 10.0))
    renderer = renderer_of(scene)
    if raster == "cpu" and not describe_device(renderer.context).software:
        pytest.skip("the processor's rasteriser reads OpenGL's memory, which a GPU's cannot be")
    for number in range(3):
        camera, settings = orthographic_camera(scene, seed + number, inside=inside), Settings(raster=raster)
        wanted, frame = drawn_of(scene, camera, settings), renderer.render(camera, settings, views=("raw",))
        wrong = frame.depth() != wanted.depth.numpy()
        wrong |= (frame.image("raw")[..., :3] != wanted.colour.permute(1, 2, 0).numpy()).any(-1)
        assert wrong.sum() <= (0 if describe_device(renderer.context).software else 5e-4 * wrong.size)


def test_culling_drops_no_point_of_the_picture(seed):
    """Against the projection in float64 of all points; with level of detail a cell keeps some of its points."""
    scene = room(seed, scale=3.0, origin=(-2e5, 7e4, 50.0))
    culler, (xyz, *_) = Culler(scene, block=4), unpack(scene, slice(0, scene.count))
    cells = scene.cell_of_points(0, scene.count)
    left_out = 0
    for number in range(20):
        camera = orthographic_camera(scene, seed + number, inside=bool(number % 2))
        at, depth = camera.project(xyz)
        seen = (depth > 0) & (at >= 0).all(1) & (at < (camera.width, camera.height)).all(1)
        for lod in (None, 0.5):
            drawn = culler.select(camera, lod)
            assert np.isin(cells[seen], drawn.cells).all() and (lod or drawn.points >= seen.sum())
        left_out += len(scene.cell_coords) - len(drawn.cells)
    assert left_out > 0


def test_filter_and_fill_equal_their_references(renderer_of, seed):
    scene = room(seed, scale=2.0)
    renderer = renderer_of(scene)
    for number in range(4):
        camera, settings = orthographic_camera(scene, seed + number, inside=bool(number % 2)), Settings()
        raster, frame = drawn_of(scene, camera, settings), renderer.render(camera, settings, views=ALL)
        if not describe_device(renderer.context).software and (frame.depth() != raster.depth.numpy()).any():
            continue  # a point beside its pixel: the reference starts from another picture
        middle = middle_depth(camera, scene)
        made = np.frombuffer(frame.ratio_depth.read(alignment=1), np.float32).reshape(camera.height, camera.width)
        assert np.allclose(made, pinhole_depth(raster.depth.double().numpy(), camera.orthographic, middle), rtol=1e-5)
        depth = torch.from_numpy(made.copy())
        mask = keep_mask(depth) & (raster.count > 0)
        assert np.array_equal(frame.mask(), mask.numpy()) and 0 < mask.sum() < (raster.count > 0).sum()
        feature = (torch.log2(depth / (camera.fx * scene.spacing)) * DEPTH_FEATURE_SCALE).clamp(-DEPTH_FEATURE_LIMIT,
                                                                                                DEPTH_FEATURE_LIMIT)
        image = torch.cat([raster.colour / 255.0, torch.where(torch.isfinite(depth), feature, 0.0)[None]]) * mask
        filled = pull_push(image, mask, footprint_feature(camera, scene.spacing))[:3]
        lattice = Enclosure(scene).occupancy
        eye = (camera.position - lattice.origin) / lattice.side
        begins, rays, sizes = parallel_rays_of(camera, camera.view_rotation.T, eye, lattice.side)
        met = torch.from_numpy(march(lattice.codes, begins, rays, sizes, sparse_depth(camera, lattice.spacing) / lattice.side))
        alpha = coverage(mask, met).numpy() * bool(mask.any())
        got = frame.image("filled")
        same = np.abs(got[..., 3] / 255 - alpha) < 0.51 / 255
        assert (~same).sum() <= 5e-3 * same.size + 2  # float32 rays on the border of a block
        wanted = filled.clamp(0, 1).permute(1, 2, 0).numpy() * 255 * alpha[..., None]
        assert (np.abs(got[..., :3] - wanted)[same].max(-1) > 0.51).sum() <= 1e-3 * same.size


def test_a_wall_hides_what_is_behind_it_at_every_depth(renderer_of):
    """Two planes an eighth of the picture's height apart, dense in front: nothing behind is kept, however far away both are."""
    from pointglass.viewer.grid.open_scene import scene_from_arrays

    rng = np.random.default_rng(4)
    front, back = rng.uniform(-1, 1, (40_000, 3)), rng.uniform(-1, 1, (60_000, 3))
    front[:, 1], back[:, 1] = 0.3 * front[:, 0], 0.3 * back[:, 0] + 0.25
    rgb = np.repeat(np.array([[255, 0, 0], [0, 0, 255]], np.uint8), (len(front), len(back)), axis=0)
    renderer, kept = renderer_of(scene_from_arrays(np.concatenate([front, back]), rgb)), []
    for away in (3.0, 300.0):
        camera = replace(from_fov(360, 360, 60.0, look_at((0.0, -away, 0.0), (0.0, 0.0, 0.0))), orthographic=1.7)
        image = renderer.render(camera, Settings(), views=("filtered",)).image("filtered")
        kept.append(image[..., 3] > 0)
        behind = kept[-1] & (image[..., 2] > image[..., 0])
        assert behind.sum() < 2e-3 * kept[-1].sum() and kept[-1].sum() > 0.2 * kept[-1].size
    assert (kept[0] != kept[1]).mean() < 2e-3  # rounding of float32 moves a point to the next pixel


def test_picks_and_selections_are_exact(renderer_of, seed):
    scene = room(seed, scale=2.0, origin=(5e5, 4e6, 100.0))
    renderer, rng = renderer_of(scene), np.random.default_rng(seed)
    xyz, *_ = unpack(scene, slice(0, scene.count))
    for number in range(3):
        camera = orthographic_camera(scene, seed + number, size=(320, 240), inside=number == 2)
        frame = renderer.render(camera, Settings(), views=("filtered",))
        mask, depth = frame.mask(), frame.depth()
        at, away = camera.project(xyz)
        rows, columns = np.nonzero(mask)
        for row, column in rng.permutation(np.column_stack([rows, columns]))[:20]:
            picked = pick(scene, camera, mask, depth, (column + 0.5, row + 0.5), radius=2.0)
            assert picked is not None and picked.pixel == (column, row)
            assert np.abs(at[picked.index] - (column + 0.5, row + 0.5)).max() <= 0.53
            front = depth[row, column]
            assert picked.distance == pytest.approx(away[picked.index], rel=1e-9), "along the parallel ray"
            assert abs(away[picked.index] - front) <= max(0.011 * camera.orthographic, 1.1 * scene.spacing)
        corners = np.array([(0, 0), (319, 20), (200, 130), (300, 239), (20, 200)]) + rng.uniform(0, 20, (5, 2))
        hits = by_outline(scene, camera, corners)
        assert np.array_equal(hits, (away > 0) & inside_outline(np.nan_to_num(at, nan=-1e9), corners))
        shown = not_covered(scene, camera, hits.copy(), depth, mask)
        inside = inside_outline(np.argwhere(mask)[:, ::-1] + 0.5, corners)
        assert 0.9 * inside.sum() <= shown.sum() <= hits.sum() and inside.any()


def test_a_clip_removes_the_same_points_as_from_a_pinhole(renderer_of, seed):
    scene = room(seed)
    low, high = scene.bounds
    box = Box(tuple(((low + high) / 2).tolist()), tuple(((high - low) * 0.3).tolist()))
    camera = orthographic_camera(scene, seed, size=(300, 200))
    camera = replace(camera, orthographic=3 * float(np.linalg.norm(high - low)))  # all of it is in view
    depth = renderer_of(scene).render(camera, Settings(), views=("raw",), edits=Edits(clips=(box,))).depth()
    places = camera.unproject(np.argwhere(np.isfinite(depth))[:, ::-1] + 0.5, depth[np.isfinite(depth)])
    pixel = camera.orthographic / camera.fx
    assert len(places) > 0 and (np.abs(places - box.centre) <= np.array(box.half) + pixel).all()


def test_a_description_keeps_the_camera_to_the_bit(seed):
    camera = orthographic_camera(room(seed), seed)
    spec = PictureSpec(camera, Settings())
    again = PictureSpec.from_json(spec.to_json(), "a picture")
    assert again == spec and again.camera.orthographic == camera.orthographic
    assert spec != replace(spec, camera=replace(camera, orthographic=None))
    found, depth = camera.project(camera.unproject([(3.0, 4.0), (200.5, 77.0)], [2.0, 5.0]))
    assert np.allclose(found, [(3.0, 4.0), (200.5, 77.0)]) and np.allclose(depth, [2.0, 5.0])
