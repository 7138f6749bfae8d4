"""Photographs, ScanNet++ and RGB-D folders as places to learn from, and the paper's table over them.

Every folder is made here: cameras inside a box whose walls have a colour at every place, cast ray by ray through lenses
written out again in this file, so a pose or lens read wrongly puts points on the wrong colours.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.spatial.transform import Rotation

from model.data.lens import Lens
from model.data.pairs import build, place_pairs, project_scan, raster_of
from model.data.photo_place import BRIGHTNESS, CONTRAST, PhotoPlace
from model.data.photos import Photograph
from model.data.rgbd import load_rgbd
from model.data.scannetpp import load_scannetpp, scenes
from model.data.truth import DataError, MemoryPicture, Scan
from model.metrics import ssim
from model.paper_table import NO_NETWORK, format_paper_table, known_ssim, paper_table, scaled
from model.unet import make_network
from model.weights import save_weights

SIZE = np.array([4.0, 3.0, 2.5])
OPENCV = np.diag((1.0, -1.0, -1.0, 1.0))

pytestmark = pytest.mark.usefixtures("one_thread")


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
    return Scan(xyz, colour_at(xyz), np.zeros(count, np.uint8))


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
        bx, by = bend(model or lens.model, lens.bend if k is None else k, x, y)
        x, y = x + 0.5 * (goal_x - bx), y + 0.5 * (goal_y - by)
    return np.stack([x, y, np.ones_like(x)], -1)


LENSES = [
    Lens("SIMPLE_RADIAL", 120, 90, 80, 80, 61.0, 44.0, (-0.08,)),
    Lens("OPENCV", 120, 90, 82, 80, 58.0, 46.0, (0.06, -0.02, 0.003, -0.002)),
    Lens("OPENCV_FISHEYE", 120, 80, 50, 50.5, 60.5, 39.0, (0.02, -0.01, 0.003, -0.001)),
    Lens("PINHOLE", 120, 90, 90, 80, 55.0, 47.0),
]
FISHEYE = LENSES[2]


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.model)
def test_a_straightened_photograph_is_what_a_pinhole_sees(lens, tmp_path):
    colour, _ = cast(rays_of(lens), look(2))
    Image.fromarray(colour).save(tmp_path / "bent.png")
    photograph = Photograph(tmp_path / "bent.png", lens, look(2))
    straight = Lens("PINHOLE", photograph.width, photograph.height, photograph.fl, photograph.fl, photograph.cx, photograph.cy)
    expected, _ = cast(rays_of(straight), look(2))
    apart = np.abs(photograph.rgb().astype(int) - expected)
    assert apart.mean() < 0.8 and np.quantile(apart, 0.99) < 5
    as_it_was = np.abs(colour.astype(int) - expected)
    assert as_it_was.mean() > 2  # the picture did need straightening


def test_the_straightened_pinhole_is_the_widest_the_lens_covers():
    for lens in LENSES:
        photograph = Photograph(Path("none"), lens, np.eye(4))
        corner = []
        for focal in (photograph.fl, photograph.fl * 0.99):
            v, u = np.mgrid[0 : lens.height, 0 : lens.width] + 0.5
            x, y = bend(lens.model, lens.bend, (u - lens.width / 2) / focal, (v - lens.height / 2) / focal)
            column, row = lens.fx * x + lens.cx, lens.fy * y + lens.cy
            corner.append(((column >= 0) & (column <= lens.width) & (row >= 0) & (row <= lens.height)).all())
        assert corner == [True, False], lens.model


def test_a_lens_that_folds_back_shows_no_pixel_twice():
    lens = Lens("SIMPLE_RADIAL", 100, 80, 60, 60, 50, 40, (-0.3,))  # r (1 - 0.3 r^2) turns round at r = 1.054
    u, _ = lens.pixel(np.array([0.5, 1.05, 1.06, 3.0]), np.zeros(4))
    assert np.isfinite(u[:2]).all() and np.isnan(u[2:]).all()


def test_a_square_pinhole_is_left_as_it_is(tmp_path):
    picture = np.random.default_rng(0).integers(0, 256, (30, 40, 3), np.uint8)
    Image.fromarray(picture).save(tmp_path / "a.png")
    photograph = Photograph(tmp_path / "a.png", Lens("PINHOLE", 40, 30, 33, 33, 18, 16.5), np.eye(4))
    assert np.array_equal(photograph.rgb(), picture) and (photograph.fl, photograph.cx, photograph.cy) == (33, 18, 16.5)


def registered(place, view, most=6.0):
    """Points of the place's own scan fall on their colours in the view, and from a camera turned by 8 degrees they do not."""
    scan = place.unspoiled()
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


# ---- ScanNet++


def write_ply(path, xyz, rgb, faces=None):
    kinds = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")]
    rows = np.zeros(len(xyz), kinds)
    for k, axis in enumerate("xyz"):
        rows[axis] = xyz[:, k]
    for k, name in enumerate(("red", "green", "blue")):
        rows[name] = rgb[:, k]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(xyz)}"]
    head += [f"property {'float' if kind == '<f4' else 'uchar'} {name}" for name, kind in kinds]
    data = rows.tobytes()
    if faces is not None:
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        table = np.zeros(len(faces), [("n", "u1"), ("v", "<i4", 3)])
        table["n"], table["v"] = 3, faces
        data += table.tobytes()
    path.write_bytes("\n".join([*head, "end_header\n"]).encode() + data)


def colmap_text(folder, lens, poses):
    """poses: name -> camera_to_world, OpenGL axes."""
    folder.mkdir(parents=True)
    numbers = " ".join(str(v) for v in (lens.fx, lens.fy, lens.cx, lens.cy, *lens.bend))
    (folder / "cameras.txt").write_text(f"# cameras\n1 {lens.model} {lens.width} {lens.height} {numbers}\n")
    lines = ["# images"]
    for number, (name, matrix) in enumerate(poses.items(), 1):
        world_to_camera = np.linalg.inv(matrix @ OPENCV)
        x, y, z, w = Rotation.from_matrix(world_to_camera[:3, :3]).as_quat()
        numbers = " ".join(repr(float(v)) for v in (w, x, y, z, *world_to_camera[:3, 3]))
        lines += [f"{number} {numbers} 1 {name}", "10.5 12.25 -1"]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")


def nerfstudio_world(matrix):
    """What ScanNet++ does on the way from COLMAP to transforms.json, from OpenCV camera_to_world."""
    turned = (matrix @ OPENCV).copy()
    turned[0:3, 1:3] *= -1
    turned = turned[np.array([1, 0, 2, 3]), :]
    turned[2, :] *= -1
    return turned


@pytest.fixture
def scannetpp(tmp_path):
    """A root with one scene of 14 fisheye photographs, two of them test pictures, and its iPhone frames."""
    root, home = tmp_path / "root", tmp_path / "root" / "data" / "aa11bb22cc"
    (root / "splits").mkdir(parents=True)
    (root / "splits" / "nvs_sem_train.txt").write_text("aa11bb22cc\n")
    (root / "splits" / "nvs_sem_val.txt").write_text("\n")
    (home / "scans").mkdir(parents=True)
    xyz = wall_points(60_000)
    write_ply(home / "scans" / "pc_aligned.ply", xyz, colour_at(xyz))
    names = [f"DSC{number:05d}.JPG" for number in range(14)]
    poses = {name: look(number) for number, name in enumerate(names)}
    (home / "dslr" / "resized_images").mkdir(parents=True)
    rays = rays_of(FISHEYE)
    for name, matrix in poses.items():
        Image.fromarray(cast(rays, matrix)[0]).save(home / "dslr" / "resized_images" / name, quality=97, subsampling=0)
    colmap_text(home / "dslr" / "colmap", FISHEYE, poses)
    (home / "dslr" / "train_test_lists.json").write_text(
        json.dumps({"train": names[:12], "test": names[12:], "has_masks": False})
    )
    facts = {"fl_x": FISHEYE.fx, "fl_y": FISHEYE.fy, "cx": FISHEYE.cx, "cy": FISHEYE.cy,
             "w": FISHEYE.width, "h": FISHEYE.height, "camera_model": FISHEYE.model,
             **{f"k{n + 1}": k for n, k in enumerate(FISHEYE.bend)}}
    frames = [{"file_path": n, "mask_path": f"{n[:-4]}.png", "is_bad": n == names[3],
               "transform_matrix": nerfstudio_world(poses[n]).tolist()} for n in names]
    (home / "dslr" / "nerfstudio").mkdir()
    (home / "dslr" / "nerfstudio" / "transforms.json").write_text(
        json.dumps({**facts, "has_mask": False, "frames": frames[:12], "test_frames": frames[12:]})
    )
    phone = LENSES[1]
    shots = {f"frame_{10 * number:06d}.jpg": look(number + 20) for number in range(3)}
    (home / "iphone" / "rgb").mkdir(parents=True)
    rays = rays_of(phone)
    for name, matrix in shots.items():
        Image.fromarray(cast(rays, matrix)[0]).save(home / "iphone" / "rgb" / name, quality=97, subsampling=0)
    colmap_text(home / "iphone" / "colmap", phone, shots)
    return root


def test_scannetpp_photographs_lie_on_the_scan(scannetpp):
    place = load_scannetpp(scannetpp, "aa11bb22cc")
    assert scenes(scannetpp, "train") == scenes(scannetpp, "nvs_sem_train") == ["aa11bb22cc"]
    assert place.name == "aa11bb22cc/dslr" and len(place.views) == 13  # one is bad
    for view in (place.views[0], place.views[7]):
        registered(place, view)
    assert place.views[0].known().mean() > 0.99
    phone = load_scannetpp(scannetpp, "aa11bb22cc", "iphone")
    assert len(phone.views) == 3 and (phone.views[0].width, phone.views[0].height) == (120, 90)
    registered(phone, phone.views[1])


def test_scannetpp_poses_are_the_same_from_colmap_and_from_nerfstudio(scannetpp):
    colmap = load_scannetpp(scannetpp, "aa11bb22cc")
    folder = scannetpp / "data" / "aa11bb22cc" / "dslr" / "colmap"
    folder.rename(folder.with_name("elsewhere"))
    other = load_scannetpp(scannetpp, "aa11bb22cc")
    assert len(other.views) == 13 and other.views[0].fl == colmap.views[0].fl
    for a, b in zip(colmap.views, other.views, strict=True):
        assert np.allclose(a.camera_to_world, b.camera_to_world, atol=1e-9)


def test_scannetpp_parts_masks_and_anonymised_points(scannetpp):
    home = scannetpp / "data" / "aa11bb22cc"
    assert len(load_scannetpp(scannetpp, "aa11bb22cc", part="test").views) == 2
    assert len(load_scannetpp(scannetpp, "aa11bb22cc", part="train").views) == 11
    assert len(load_scannetpp(scannetpp, "aa11bb22cc", part="train", every=4).views) == 3
    (home / "scans" / "pc_aligned_mask.txt").write_text("0 5 59999")
    assert len(load_scannetpp(scannetpp, "aa11bb22cc").unspoiled().xyz) == 59_997
    masks = home / "dslr" / "resized_anon_masks"
    masks.mkdir()
    half = np.full((FISHEYE.height, FISHEYE.width), 255, np.uint8)
    half[:, :60] = 0
    for number in range(14):
        Image.fromarray(half).save(masks / f"DSC{number:05d}.png")
    lists = home / "dslr" / "train_test_lists.json"
    lists.write_text(lists.read_text().replace("false", "true"))
    known = load_scannetpp(scannetpp, "aa11bb22cc").views[0].known()
    assert not known[:, :55].any() and known[:, 65:].mean() > 0.99
    for name in ("DSC00012.JPG", "DSC00013.JPG"):  # as in the benchmark's test scenes
        (home / "dslr" / "resized_images" / name).unlink()
    assert len(load_scannetpp(scannetpp, "aa11bb22cc").views) == 11


def test_scannetpp_mesh_is_scattered_with_its_colours(scannetpp):
    scans = scannetpp / "data" / "aa11bb22cc" / "scans"
    (scans / "pc_aligned.ply").unlink()
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]], float)
    colours = np.array([[0, 0, 0], [200, 0, 0], [200, 100, 0], [0, 100, 0]], np.uint8)  # 50 a metre along x, 33.3 along y
    write_ply(scans / "mesh_aligned_0.05.ply", corners, colours, np.array([[0, 1, 2], [0, 2, 3]]))
    with pytest.raises(DataError, match=r"pc_aligned\.ply: missing.*surface='mesh'"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    scan = load_scannetpp(scannetpp, "aa11bb22cc", surface="mesh", mesh_points=20_000).unspoiled()
    assert np.allclose(scan.rgb[:, 0], scan.xyz[:, 0] * 50, atol=0.6)
    assert np.allclose(scan.rgb[:, 1], scan.xyz[:, 1] * 100 / 3, atol=0.6)
    cells, _, _ = np.histogram2d(scan.xyz[:, 0], scan.xyz[:, 1], bins=(4, 3))
    assert cells.min() > 1500 and cells.max() < 1850  # 1667 each


def test_scannetpp_refuses_before_anything_starts(scannetpp):
    home = scannetpp / "data" / "aa11bb22cc"
    with pytest.raises(DataError, match="there are: nvs_sem_train, nvs_sem_val"):
        scenes(scannetpp, "nvs_test")
    with pytest.raises(DataError, match="no such scene"):
        load_scannetpp(scannetpp, "nowhere")
    pictures = home / "dslr" / "resized_images"
    torn = (pictures / "DSC00000.JPG").read_bytes()
    (pictures / "DSC00000.JPG").write_bytes(torn[: len(torn) // 2])
    Image.new("RGB", (64, 48)).save(pictures / "DSC00001.JPG")
    for number in range(4, 14):
        (pictures / f"DSC{number:05d}.JPG").unlink()
    with pytest.raises(DataError) as refused:
        load_scannetpp(scannetpp, "aa11bb22cc", part="train")
    text = str(refused.value)
    assert text.startswith(f"{home}: 10 of 11 files cannot be used")
    assert "DSC00000.JPG cannot be read" in text and "DSC00001.JPG has 64x48 pixels, not 120x80" in text
    assert text.count("is missing") == 8 and "DSC00004.JPG is missing" in text
    for number in (0, 1, 2):
        (pictures / f"DSC{number:05d}.JPG").unlink()
    (home / "dslr" / "train_test_lists.json").unlink()
    (home / "dslr" / "nerfstudio" / "transforms.json").unlink()
    (pictures / "DSC00003.JPG").unlink()
    with pytest.raises(DataError) as refused:
        load_scannetpp(scannetpp, "aa11bb22cc")
    assert str(refused.value).count("is missing") == 10 and "and 4 more" in str(refused.value)


def test_scannetpp_refuses_torn_scans_and_poses(scannetpp):
    home = scannetpp / "data" / "aa11bb22cc"
    cloud = home / "scans" / "pc_aligned.ply"
    data = cloud.read_bytes()
    cloud.write_bytes(data[:-1])
    with pytest.raises(DataError, match=r"pc_aligned\.ply: truncated"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    cloud.write_bytes(b"no ply")
    with pytest.raises(DataError, match=r"pc_aligned\.ply: not a PLY"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    cloud.write_bytes(data)
    images = home / "dslr" / "colmap" / "images.txt"
    text = images.read_text()
    images.write_text(text.replace("10.5 12.25 -1\n", "", 1))
    with pytest.raises(DataError, match=r"images\.txt: line 2: the line below"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    images.write_text(text.replace(" 1 DSC00002", " 7 DSC00002"))
    with pytest.raises(DataError, match=r"line 6: camera '7' is not in cameras\.txt"):
        load_scannetpp(scannetpp, "aa11bb22cc")
    cameras = home / "dslr" / "colmap" / "cameras.txt"
    cameras.write_text(cameras.read_text().replace("OPENCV_FISHEYE", "FOV"))
    with pytest.raises(DataError, match=r"cameras\.txt: line 2: camera model 'FOV' is not supported"):
        load_scannetpp(scannetpp, "aa11bb22cc")


# ---- photographs of a scan


def straight_view(number, width=96, height=72, focal=60.0):
    lens = Lens("PINHOLE", width, height, focal, focal, width / 2, height / 2)
    return MemoryPicture(cast(rays_of(lens), look(number))[0], focal, look(number))


def test_pictures_are_known_where_the_scan_covers_them():
    view = straight_view(1, focal=30.0)
    assert PhotoPlace("full", wall_scan(), [view]).views[0].known().mean() > 0.99
    rays = (rays_of(Lens("PINHOLE", 96, 72, 30, 30, 48, 36)) * (1, -1, -1)) @ look(1)[:3, :3].T
    with np.errstate(divide="ignore"):
        reach = np.where(rays > 0, (SIZE - look(1)[:3, 3]) / rays, -look(1)[:3, 3] / rays)
    axis = reach.argmin(-1)
    far_side = np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0
    tried = 0
    for wall in {(int(a), int(s)) for a, s in zip(axis.ravel(), far_side.ravel())}:
        gone = (axis == wall[0]) & (far_side == wall[1])
        known = PhotoPlace("open", wall_scan(without=(wall,)), [view]).views[0].known()
        assert (known == ~gone).mean() > 0.97
        tried += 0.02 < gone.mean() < 0.98
    assert tried >= 2


def test_scans_are_spoiled_by_the_seed_as_the_paper_does():
    place = PhotoPlace("box", wall_scan(20_000), [straight_view(0)])
    counts = set()
    for seed in range(12):
        scan, again = place.scan(seed), place.scan(seed)
        assert np.array_equal(scan.rgb, again.rgb) and np.array_equal(scan.station, again.station)
        assert np.array_equal(scan.xyz, place.unspoiled().xyz)
        counts.add(int(scan.station.max()) + 1)
        before = place.unspoiled().rgb.astype(float)
        brightness, contrast = [], []
        for station in range(int(scan.station.max()) + 1):
            mine = (scan.station == station)[:, None] & (scan.rgb > 0) & (scan.rgb < 255)
            slope, shift = np.polyfit(before[mine], scan.rgb[mine], 1)
            brightness.append(shift)
            contrast.append(slope)
        assert np.ptp(contrast) <= 2.1 * CONTRAST and np.ptp(brightness) <= 2.1 * BRIGHTNESS
        assert abs(np.mean(contrast) - 1) < 0.01 and abs(np.mean(brightness)) < 1  # no change that nothing could tell
    assert counts == {2, 3, 4, 5}
    assert not np.array_equal(place.scan(1).rgb, place.scan(2).rgb)
    stations = np.arange(20_000) % 3
    own = PhotoPlace("own", replace(place.unspoiled(), station=stations.astype(np.uint8)), [straight_view(0)])
    assert np.array_equal(own.scan(4).station, stations)


def two_walls():
    """A sparse red wall at 2 m before a dense blue one at 4 m, and an all-green photograph of them."""
    rng = np.random.default_rng(3)
    near, far = rng.uniform(-1.2, 1.2, (5000, 3)), rng.uniform(-3, 3, (30_000, 3))
    near[:, 2], far[:, 2] = -2, -4
    rgb = np.zeros((35_000, 3), np.uint8)
    rgb[:5000, 0], rgb[5000:, 2] = 200, 200
    picture = np.zeros((48, 64, 3), np.uint8)
    picture[..., 1] = 150
    picture[:, :, 0] = np.arange(64)  # each column its own green
    view = MemoryPicture(picture, 60.0, np.eye(4))
    return Scan(np.concatenate([near, far]), rgb, np.zeros(35_000, np.uint8)), view


def test_points_in_front_take_the_photographs_colours_and_others_keep_the_scans():
    scan, view = two_walls()
    place = PhotoPlace("walls", scan, [view])
    shown = place.views[0]
    seen = project_scan(scan, shown)
    made = place.photographed(seen, shown, 5, toned=False)
    near = seen.z < 3
    column = seen.index % 64
    assert near.sum() > 1000
    expected = torch.stack([column, torch.full_like(column, 150), torch.zeros_like(column)], 1)[near]
    assert (made.rgb[near] == expected).all(1).float().mean() > 0.97
    behind = (~near) & (column > 16) & (column < 48) & (seen.index // 64 > 12) & (seen.index // 64 < 36)
    hit = torch.bincount(seen.index[near], minlength=48 * 64)[seen.index] > 0
    assert (made.rgb[behind & hit] == seen.rgb[behind & hit]).all()  # behind a point of the same pixel
    leaked = behind & ~hit
    assert leaked.any() and (made.rgb[leaked] == seen.rgb[leaked]).all(1).float().mean() > 0.85
    raster = raster_of(made, torch.ones(len(made.z), dtype=torch.bool), place.spacing)
    assert raster.depth.shape == (48, 64)
    toned = place.photographed(seen, shown, 5)
    assert not torch.equal(toned.rgb, made.rgb) or len(set(seen.station.tolist())) == 1
    halved = place.photographed(project_scan(scan, shown, reduce=2), shown, 5, toned=False)
    assert (halved.rgb[halved.z < 3][:, 1] == 150).float().mean() > 0.95


def test_points_on_unusable_pixels_keep_the_scans_colours():
    scan, view = two_walls()
    usable = np.ones((48, 64), bool)
    usable[:, 32:] = False
    place = PhotoPlace("walls", scan, [replace(view, trusted=usable)])
    seen = project_scan(scan, place.views[0])
    made = place.photographed(seen, place.views[0], 0, toned=False)
    hidden = seen.index % 64 >= 32
    assert (made.rgb[hidden] == seen.rgb[hidden]).all() and not (made.rgb[~hidden] == seen.rgb[~hidden]).all()
    assert not place.views[0].known()[:, 32:].any() and place.views[0].known()[:, :32].all()


def test_only_the_place_used_last_holds_its_scan():
    loads = []

    def load(name):
        loads.append(name)
        return wall_scan(2000)

    first, second = (PhotoPlace(name, lambda name=name: load(name), [straight_view(0)]) for name in "ab")
    for place in (first, first, second, second, first):
        place.unspoiled()
    assert loads == ["a", "b", "a"]


def test_photographs_make_training_pairs():
    place = PhotoPlace("box", wall_scan(), [straight_view(1)])
    pairs = list(place_pairs(place, seed=2, scans=1, variants=2, preset="auto"))
    assert len(pairs) == 2
    for pair in pairs:
        assert pair.input.shape == pair.truth.shape == (5, 72, 96)
        assert np.array_equal(pair.truth[:3].transpose(1, 2, 0), place.views[0].rgb()) and (pair.truth[4] == 255).mean() > 0.99
    dense = max(pairs, key=lambda pair: pair.where["density"])
    measured = dense.input[3] > 0
    assert np.abs(dense.input[:3] * 255 - dense.truth[:3])[:, measured].mean() < 25  # tones aside, the same picture


# ---- RGB-D


PLAIN = Lens("PINHOLE", 80, 60, 55.0, 55.0, 41.5, 29.5)
FRAMES = 18


def frames_of(lens, depth_step=1):
    rays, coarse = rays_of(lens), rays_of(lens, step=depth_step)
    return [(look(n / 3), cast(rays, look(n / 3))[0], cast(coarse, look(n / 3))[1]) for n in range(FRAMES)]


def depth_png(path, depth, unit):
    Image.fromarray(np.rint(depth / unit).astype(np.uint16)).save(path)


def write_nerfstudio(folder, lens, depth_step=1, unit=0.001, **facts):
    (folder / "images").mkdir(parents=True)
    (folder / "depth").mkdir()
    entries = []
    for n, (pose, colour, depth) in enumerate(frames_of(lens, depth_step)):
        Image.fromarray(colour).save(folder / "images" / f"{n:03d}.png")
        depth_png(folder / "depth" / f"{n:03d}.png", depth, unit)
        entries.append({"file_path": f"images/{n:03d}.png", "depth_file_path": f"depth/{n:03d}.png",
                        "transform_matrix": pose.tolist()})
    model = "OPENCV" if lens.model == "PINHOLE" else lens.model
    names = {"OPENCV": ("k1", "k2", "p1", "p2"), "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4")}[model]
    (folder / "transforms.json").write_text(json.dumps({
        "fl_x": lens.fx, "fl_y": lens.fy, "cx": lens.cx, "cy": lens.cy, "w": lens.width, "h": lens.height,
        "camera_model": model, **dict(zip(names, lens.bend)), "frames": entries, **facts,
    }))


def write_tum(folder):
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    lines = {"rgb": ["# color images"], "depth": ["# depth maps"], "groundtruth": ["# timestamp tx ty tz qx qy qz qw"]}
    for n, (pose, colour, depth) in enumerate(frames_of(PLAIN)):
        time = 1305031102.175 + n / 30
        Image.fromarray(colour).save(folder / "rgb" / f"{n}.png")
        depth_png(folder / "depth" / f"{n}.png", depth, 1 / 5000)
        lines["rgb"].append(f"{time:.6f} rgb/{n}.png")
        lines["depth"].append(f"{time + 0.008:.6f} depth/{n}.png")
        for shift in (-0.005, 0.005):  # the pose lies half-way between two
            matrix = pose @ OPENCV
            numbers = [*(matrix[:3, 3] + shift), *Rotation.from_matrix(matrix[:3, :3]).as_quat()]
            lines["groundtruth"].append(f"{time + shift:.6f} " + " ".join(repr(float(v)) for v in numbers))
    for name, text in lines.items():
        (folder / f"{name}.txt").write_text("\n".join(text) + "\n")
    (folder / "calibration.txt").write_text(f"{PLAIN.fx} {PLAIN.fy} {PLAIN.cx - 0.5} {PLAIN.cy - 0.5}\n")


def write_scannet(folder):
    for name in ("color", "depth", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    own = Lens("PINHOLE", 40, 30, 24.0, 24.5, 20.2, 14.9)  # a depth camera that sees wider
    rays = rays_of(own)
    for n, (pose, colour, _) in enumerate(frames_of(PLAIN)):
        Image.fromarray(colour).save(folder / "color" / f"{n}.jpg", quality=97, subsampling=0)
        depth_png(folder / "depth" / f"{n}.png", cast(rays, pose)[1], 0.001)
        np.savetxt(folder / "pose" / f"{n}.txt", pose @ OPENCV)
    for name, lens in (("color", PLAIN), ("depth", own)):
        matrix = np.eye(4)
        matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2] = lens.fx, lens.fy, lens.cx - 0.5, lens.cy - 0.5
        np.savetxt(folder / "intrinsic" / f"intrinsic_{name}.txt", matrix)
    np.savetxt(folder / "pose" / "5.txt", np.full((4, 4), -np.inf))  # tracking lost


def write_seven_scenes(folder):
    folder.mkdir(parents=True)
    for n, (pose, colour, depth) in enumerate(frames_of(PLAIN)):
        stem = folder / f"frame-{n:06d}"
        Image.fromarray(colour).save(f"{stem}.color.png")
        depth = depth.copy()
        depth[0, :] = 65.535  # no depth
        depth_png(f"{stem}.depth.png", depth, 0.001)
        np.savetxt(f"{stem}.pose.txt", pose @ OPENCV)
    (folder / "camera-intrinsics.txt").write_text(f"55 0 {PLAIN.cx - 0.5}\n0 55 {PLAIN.cy - 0.5}\n0 0 1\n")


FORMS = {
    "nerfstudio": lambda folder: write_nerfstudio(folder, PLAIN),
    "nerfstudio-coarse-depth": lambda folder: write_nerfstudio(folder, PLAIN, 2),
    "nerfstudio-bent": lambda folder: write_nerfstudio(folder, LENSES[1]),
    "nerfstudio-fisheye-scale": lambda folder: write_nerfstudio(folder, FISHEYE, unit=0.0005, depth_unit_scale_factor=0.0005),
    "tum": write_tum, "scannet": write_scannet, "7-scenes": write_seven_scenes,
}


@pytest.mark.parametrize("form", FORMS)
def test_rgbd_frames_make_a_scan_that_lies_on_the_walls_and_on_the_held_out_views(form, tmp_path):
    folder = tmp_path / "room"
    FORMS[form](folder)
    place = load_rgbd(folder, held_out=6)
    lost = form == "scannet"
    expected = [look(n / 3) for n in range(FRAMES) if not (lost and n == 5)][3::6]
    assert len(place.views) == len(expected) == 3
    for view, pose in zip(place.views, expected, strict=True):
        assert np.allclose(view.camera_to_world, pose, atol=2e-4)
    scan = place.unspoiled()
    assert len(scan.xyz) > 1500
    to_wall = np.minimum(np.abs(scan.xyz), np.abs(SIZE - scan.xyz)).min(1)
    assert np.quantile(to_wall, 0.95) < 0.004
    assert (scan.xyz > -0.05).all() and (scan.xyz < SIZE + 0.05).all()
    apart = np.abs(scan.rgb.astype(int) - colour_at(np.clip(scan.xyz, 0, SIZE)))
    assert apart.mean() < 4
    registered(place, place.views[1])
    view = place.views[1]
    lens = Lens("PINHOLE", view.width, view.height, view.fl, view.fl, view.cx, view.cy)
    truth = cast(rays_of(lens), view.camera_to_world)[1]
    depth = view.depth()
    finite = np.isfinite(depth)
    assert finite.mean() > 0.85 and np.quantile(np.abs(depth - truth)[finite] / truth[finite], 0.95) < 0.03


def test_rgbd_scan_holds_one_point_a_voxel_and_no_held_out_frame(tmp_path):
    write_nerfstudio(tmp_path / "room", PLAIN)
    thin = load_rgbd(tmp_path / "room", held_out=6, voxel=0.2).unspoiled()
    full = load_rgbd(tmp_path / "room", held_out=6, voxel=1e-6).unspoiled()
    voxels, there = (np.floor((scan.xyz - full.xyz.min(0)) / 0.2) for scan in (thin, full))
    assert len(np.unique(voxels, axis=0)) == len(thin.xyz) == len(np.unique(there, axis=0)) < len(full.xyz) / 5
    spare = load_rgbd(tmp_path / "room", held_out=6, voxel=1e-6, step=2).unspoiled()
    assert 3.8 < len(full.xyz) / len(spare.xyz) < 4.2
    for number in (3, 9, 15):  # the held-out frames: black, they must leave the scan as it is
        Image.new("RGB", (80, 60)).save(tmp_path / "room" / "images" / f"{number:03d}.png")
    assert np.array_equal(load_rgbd(tmp_path / "room", held_out=6, voxel=1e-6).unspoiled().rgb, full.rgb)


def test_rgbd_refuses_what_it_cannot_use_by_name(tmp_path):
    room = tmp_path / "room"
    room.mkdir()
    with pytest.raises(DataError, match=r"neither transforms\.json"):
        load_rgbd(room)
    write_nerfstudio(room, PLAIN)
    with pytest.raises(DataError, match=r"18 frames.*40 are needed"):
        load_rgbd(room, held_out=20)
    for number in range(12):
        (room / "depth" / f"{number:03d}.png").unlink()
    (room / "images" / "017.png").write_bytes(b"")
    with pytest.raises(DataError) as refused:
        load_rgbd(room, held_out=6)
    text = str(refused.value)
    assert "13 of 36 files" in text and "017.png cannot be read" in text and text.count("is missing") == 9
    assert "and 3 more" in text
    data = json.loads((room / "transforms.json").read_text())
    del data["frames"][4]["depth_file_path"]
    (room / "transforms.json").write_text(json.dumps(data))
    with pytest.raises(DataError, match=r"1 of 18 frames have no depth_file_path: images/004\.png"):
        load_rgbd(room)
    (room / "transforms.json").write_text("{}")
    with pytest.raises(DataError, match="not a nerfstudio description"):
        load_rgbd(room)


def test_tum_and_posed_folders_say_what_they_lack(tmp_path):
    write_tum(tmp_path / "tum")
    (tmp_path / "tum" / "calibration.txt").unlink()
    with pytest.raises(DataError, match="not 640x480"):
        load_rgbd(tmp_path / "tum", held_out=6)
    poses = tmp_path / "tum" / "groundtruth.txt"
    poses.write_text(poses.read_text().replace("13050311", "23050311"))
    with pytest.raises(DataError, match="of one clock"):
        load_rgbd(tmp_path / "tum", held_out=6)
    write_seven_scenes(tmp_path / "seven")
    (tmp_path / "seven" / "camera-intrinsics.txt").unlink()
    with pytest.raises(DataError, match=r"no intrinsics.*intrinsic_color\.txt"):
        load_rgbd(tmp_path / "seven", held_out=6)
    (tmp_path / "seven" / "intrinsics.txt").write_text("55 55 40 30")
    np.savetxt(tmp_path / "seven" / "frame-000002.pose.txt", 2 * np.eye(4))
    with pytest.raises(DataError, match=r"frame-000002\.pose\.txt: its pose is no rotation"):
        load_rgbd(tmp_path / "seven", held_out=6)


# ---- the paper's table


def test_scaled_views_keep_every_pixel_on_its_ray():
    lens = Lens("PINHOLE", 150, 80, 70, 70, 77.0, 41.0)
    view = MemoryPicture(cast(rays_of(lens), look(4))[0], 70.0, look(4), centre=(77.0, 41.0))
    for width, height in ((80, 60), (160, 120)):
        made = scaled(view, width, height)
        same = Lens("PINHOLE", width, height, made.fl, made.fl, made.cx, made.cy)
        expected, _ = cast(rays_of(same), look(4))
        assert made.rgb().shape == (height, width, 3) and made.fl == 70 * height / 80
        assert np.abs(made.rgb().astype(int) - expected).mean() < 1


def test_known_ssim_is_the_mean_over_windows_that_hold_a_known_pixel():
    rng = np.random.default_rng(5)
    truth = torch.from_numpy(rng.random((3, 40, 50))).float()
    made = (truth + 0.1 * torch.from_numpy(rng.normal(size=truth.shape)).float()).clamp(0, 1)
    known = torch.zeros(40, 50, dtype=torch.bool)
    known[5:12, 30:44] = True
    mixed = torch.where(known, made, truth)
    windows = [ssim(mixed[:, r : r + 11, c : c + 11], truth[:, r : r + 11, c : c + 11])
               for r in range(30) for c in range(40) if known[r : r + 11, c : c + 11].any()]
    assert known_ssim(made, truth, known) == pytest.approx(np.mean(windows), abs=1e-6)
    assert known_ssim(made, truth, torch.ones_like(known)) == pytest.approx(ssim(made, truth), abs=1e-9)
    assert np.isnan(known_ssim(made, truth, torch.zeros_like(known)))


@pytest.fixture
def small_weights(tmp_path):
    torch.manual_seed(0)
    files = {}
    for name, filtered in (("fast", True), ("fast-unfiltered", False)):
        files[name] = tmp_path / f"{name}.safetensors"
        save_weights(files[name], make_network("fast"), "fast", filtered=filtered)
    return files


def test_the_papers_table_has_its_columns_and_sane_figures(small_weights, monkeypatch):
    monkeypatch.setitem(sys.modules, "lpips", None)
    monkeypatch.setitem(sys.modules, "torchmetrics", None)
    place = PhotoPlace("box", wall_scan(80_000), [straight_view(n, 128, 96, 80.0) for n in (0, 3)])
    result = paper_table([place], small_weights, sizes=((96, 72), (48, 36)), precision="fp32", repeats=1)
    rows = {(r["method"], r["width"], r["density"]): r for r in result["rows"]}
    assert set(rows) == {(m, w, d) for m in (NO_NETWORK, "fast", "fast-unfiltered") for w in (96, 48) for d in (1.0, 0.1)}
    for (method, width, density), row in rows.items():
        assert row["views"] == 2 and 20 < row["psnr"] < 60 and 0.2 < row["ssim"] < 1 and row["known"] > 0.95
        assert row["frame_s"] > 0 and row["network_s"] >= 0 and (row["network_s"] > 0) == (method != NO_NETWORK)
        assert np.isnan(row["lpips"]) and np.isnan(row["squeeze"])
        if method == "fast":  # untrained, it returns the filled picture
            assert row["psnr"] == pytest.approx(rows[NO_NETWORK, width, density]["psnr"], abs=0.01)
    assert rows[NO_NETWORK, 96, 1.0]["ssim"] > rows[NO_NETWORK, 96, 0.1]["ssim"]
    text = format_paper_table(result)
    for word in ("PSNR", "LPIPS[0,1]", "LPIPS[-1,1]", "SSIM", "frames/s", "network/s", "96x72", "48x36", "10%", "not available",
                 "only pixels the scan covers", "threads", "16.10", "RTX 4090"):
        assert word in text
    json.dumps(result)


def test_only_known_pixels_count_in_the_papers_table(monkeypatch):
    monkeypatch.setitem(sys.modules, "lpips", None)
    monkeypatch.setitem(sys.modules, "torchmetrics", None)
    view = straight_view(2)
    usable = np.ones((72, 96), bool)
    usable[:, 48:] = False
    spoiled = view.colour.copy()
    spoiled[:, 48:] = 255 - spoiled[:, 48:]
    tables = []
    for colour, trusted in ((view.colour, usable), (spoiled, usable), (spoiled, None)):
        place = PhotoPlace("box", wall_scan(), [replace(view, colour=colour, trusted=trusted)])
        result = paper_table([place], {}, sizes=((96, 72),), densities=(1.0,), repeats=1)
        tables.append(result["rows"][0])
    assert tables[0]["psnr"] > 22 and tables[0]["known"] == pytest.approx(0.5, abs=0.02)
    assert tables[0]["psnr"] == tables[1]["psnr"] and tables[1]["psnr"] > tables[2]["psnr"] + 5
    assert tables[1]["ssim"] > tables[2]["ssim"]
    nothing = PhotoPlace("box", wall_scan(), [replace(view, trusted=np.zeros((72, 96), bool))])
    empty = paper_table([nothing], {}, sizes=((96, 72),), densities=(1.0,), repeats=1)
    assert empty["skipped"] == 1 and empty["rows"] == [] and "1 pictures left out" in format_paper_table(empty)
    with pytest.raises(DataError, match="at least one true picture"):
        paper_table([], {})


def test_lpips_is_given_in_both_forms(monkeypatch):
    class Fake(torch.nn.Module):
        def __init__(self, net, verbose):
            super().__init__()
            assert net == "alex" and not verbose

        def forward(self, a, b, normalize):
            assert a.min() >= 0 and a.max() <= 1  # the pictures come as 0..1; normalize turns them into -1..1
            return (a - b).abs().mean() * (2 if normalize else 1)

    monkeypatch.setitem(sys.modules, "lpips", SimpleNamespace(LPIPS=Fake))
    place = PhotoPlace("box", wall_scan(), [straight_view(2)])
    result = paper_table([place], {}, sizes=((96, 72),), densities=(1.0,), repeats=1, backbone="alex")
    row = result["rows"][0]
    assert row["lpips"] == pytest.approx(2 * row["lpips_published"], rel=1e-6) and row["lpips"] > 0
    text = format_paper_table(result)
    assert "LPIPS (alex)" in text and f"{row['lpips']:.3f}" in text and f"{row['lpips_published']:.3f}" in text


def test_the_squeezenet_distance_stands_under_its_own_name(shared_data):
    place = PhotoPlace("box", wall_scan(), [straight_view(2)])
    result = paper_table([place], {}, sizes=((96, 72),), densities=(1.0, 0.1), repeats=1,
                         distance_path=shared_data / "perceptual")
    dense, sparse = (row["squeeze"] for row in result["rows"])
    assert 0 < dense < sparse and f"{dense:.3f}" in format_paper_table(result) and "SqueezeNet" in format_paper_table(result)


def test_one_command_gives_the_papers_table(scannetpp, tmp_path, capsys, monkeypatch):
    import model.paper_table as table
    from viewer.cli import main

    (scannetpp / "splits" / "nvs_sem_val.txt").write_text("aa11bb22cc\n")
    small = {**table.paper_table.__kwdefaults__, "sizes": ((96, 72),), "repeats": 1}
    monkeypatch.setattr(table.paper_table, "__kwdefaults__", small)
    assert main(["evaluate", str(scannetpp), "--paper-table", "--views", "1", "--json", str(tmp_path / "t.json")]) == 0
    said = capsys.readouterr().out
    assert "balanced-filtered" in said and "pull-push" in said and "16.10" in said  # ours above, the published below
    assert (tmp_path / "t.json").is_file()
    assert main(["evaluate", str(scannetpp), "--paper-table", "--split", "nowhere"]) == 2


@pytest.mark.parametrize("preset", ["auto", "off"])
def test_training_pairs_take_the_photographs_colours(scannetpp, tmp_path, preset):
    """The paper's recipe: where a point in front is measured, input and truth agree far better than with the scan's colours."""
    place = load_scannetpp(scannetpp, "aa11bb22cc", every=6)
    gaps = []
    for recipe in (True, False):
        out = tmp_path / f"pairs-{recipe}"
        bare = SimpleNamespace(name="bare", views=place.views, scan=place.scan)
        build([place if recipe else bare], out, scans=1, variants=1, preset=preset, seed=3)
        x, truth = np.load(out / "inputs.npy").astype(np.float32), np.load(out / "truth.npy").astype(np.float32) / 255
        measured = (x[:, 3] > 0) & (truth[:, 4] > 0)
        gaps.append(np.median(np.abs(x[:, :3] - truth[:, :3]).mean(1)[measured]))
    assert gaps[0] <= gaps[1]
