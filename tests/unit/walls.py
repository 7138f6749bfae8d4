"""A box whose walls have a colour at every place, cast ray by ray through lenses written out again here: a pose or lens
read wrongly puts points on the wrong colours.  Metres; cameras in OpenGL axes."""

import numpy as np
from scipy.spatial.transform import Rotation

from pointglass.model.data.dataset import MemoryPicture, MergedScan
from pointglass.model.data.images.lens import Lens
from pointglass.model.data.surfaces.projected import project_scan

SIZE = np.array([4.0, 3.0, 2.5])
OPENCV = np.diag((1.0, -1.0, -1.0, 1.0))


def colour_at(xyz):
    """A colour for every place in the box, all three channels different."""
    x, y, z = np.moveaxis(xyz, -1, 0)
    waves = [np.sin(2.1 * x + 0.7 * y) * np.cos(1.9 * z), np.cos(1.7 * y - 1.1 * z + x), np.sin(1.3 * x - 2.3 * y + 1.5 * z)]
    return np.rint(127.5 + 110 * np.stack(waves, -1)).astype(np.uint8)


def wall_points(count, seed=0, without=()):
    """Points on the box's six walls, those of ``without`` (axis, side) left out."""
    rng = np.random.default_rng(seed)
    walls = [(axis, side) for axis in range(3) for side in (0, 1) if (axis, side) not in without]
    xyz = rng.random((count, 3)) * SIZE
    which = rng.integers(len(walls), size=count)
    for number, (axis, side) in enumerate(walls):
        xyz[which == number, axis] = side * SIZE[axis]
    return xyz


def wall_scan(count=60_000, without=()):
    xyz = wall_points(count, without=without)
    return MergedScan(xyz, colour_at(xyz), np.zeros(count, np.uint8))


def look(number):
    """camera_to_world, OpenGL axes, of the camera of this number: inside the box, turned and tilted."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("zxz", (40 * number, 80 + 4 * (number % 5), 3 * number), degrees=True).as_matrix()
    matrix[:3, 3] = SIZE / 2 + 0.35 * np.sin(number * np.array([0.9, 1.7, 0.4]))
    return matrix


def cast(rays, camera_to_world):
    """(..., 3) rays in OpenCV camera axes with z = 1: colours and z-depth of the walls they meet."""
    world = (rays * (1, -1, -1)) @ camera_to_world[:3, :3].T
    start = camera_to_world[:3, 3]
    with np.errstate(divide="ignore"):
        reach = np.where(world > 0, (SIZE - start) / world, np.where(world < 0, -start / world, np.inf)).min(-1)
    return colour_at(start + world * reach[..., None]), reach


def bend(model, k, x, y):
    """Lens models written out as in COLMAP's documentation."""
    r2 = x * x + y * y
    if model == "OPENCV":
        a = 1 + k[0] * r2 + k[1] * r2**2
        return x * a + 2 * k[2] * x * y + k[3] * (r2 + 2 * x**2), y * a + k[2] * (r2 + 2 * y**2) + 2 * k[3] * x * y
    if model == "OPENCV_FISHEYE":
        r = np.sqrt(r2) + 1e-12
        angle = np.arctan(r)
        bent = angle + k[0] * angle**3 + k[1] * angle**5 + k[2] * angle**7 + k[3] * angle**9
        return x * bent / r, y * bent / r
    if model == "SIMPLE_RADIAL":
        return x * (1 + k[0] * r2), y * (1 + k[0] * r2)
    return x, y


def rays_of(lens, model=None, k=None, step=1):
    """Rays of a lens's pixel centres, its distortion undone by iteration."""
    v, u = np.mgrid[0 : lens.height : step, 0 : lens.width : step] + step / 2
    goal_x, goal_y = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy
    x, y = goal_x.copy(), goal_y.copy()
    for _ in range(300):
        bx, by = bend(model or lens.model, lens.distortion if k is None else k, x, y)
        x, y = x + 0.5 * (goal_x - bx), y + 0.5 * (goal_y - by)
    return np.stack([x, y, np.ones_like(x)], -1)


LENSES = [
    Lens("SIMPLE_RADIAL", 120, 90, 80, 80, 61.0, 44.0, (-0.08,)),
    Lens("OPENCV", 120, 90, 82, 80, 58.0, 46.0, (0.06, -0.02, 0.003, -0.002)),
    Lens("OPENCV_FISHEYE", 120, 80, 50, 50.5, 60.5, 39.0, (0.02, -0.01, 0.003, -0.001)),
    Lens("PINHOLE", 120, 90, 90, 80, 55.0, 47.0),
]
FISHEYE = LENSES[2]


def straight_view(number, width=96, height=72, focal=60.0):
    lens = Lens("PINHOLE", width, height, focal, focal, width / 2, height / 2)
    return MemoryPicture(cast(rays_of(lens), look(number))[0], focal, look(number))


def registered(place, view, most=6.0):
    """Points of the place's own scan fall on their colours in the view, and from a camera turned by 8 degrees they do not."""
    scan = place.original_scan()
    picture = view.rgb().reshape(-1, 3).astype(int)

    def apart(matrix):
        seen = project_scan(scan, view, camera_to_world=matrix)
        assert len(seen.z) > 500
        return np.abs(picture[seen.index.numpy()] - seen.rgb.numpy()).mean()

    right = apart(view.camera_to_world)
    assert right < most
    aside = view.camera_to_world.copy()
    aside[:3, :3] = aside[:3, :3] @ Rotation.from_euler("y", 8, degrees=True).as_matrix()
    assert apart(aside) > 3 * right
