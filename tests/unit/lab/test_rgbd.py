"""RGB-D folders as training data, in each supported format."""

import json

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation
from walls import FISHEYE, LENSES, OPENCV, SIZE, cast, colour_at, look, rays_of, registered

from pointglass.model.common.errors import DataError
from pointglass.model.data.images.lens import Lens
from pointglass.model.data.images.rgbd import load_rgbd

pytestmark = pytest.mark.usefixtures("one_thread")

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
        "camera_model": model, **dict(zip(names, lens.distortion)), "frames": entries, **facts,
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


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_the_scan_of_rgbd_frames_agrees_with_walls_and_held_out_views(form, tmp_path):
    folder = tmp_path / "room"
    FORMS[form](folder)
    place = load_rgbd(folder, held_out=6)
    lost = form == "scannet"
    expected = [look(n / 3) for n in range(FRAMES) if not (lost and n == 5)][3::6]
    assert len(place.views) == len(expected) == 3
    for view, pose in zip(place.views, expected, strict=True):
        assert np.allclose(view.camera_to_world, pose, atol=2e-4)
    scan = place.original_scan()
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
    assert depth is not None
    finite = np.isfinite(depth)
    assert finite.mean() > 0.85 and np.quantile(np.abs(depth - truth)[finite] / truth[finite], 0.95) < 0.03


def test_the_rgbd_scan_has_one_point_per_voxel_and_no_held_out_frame(tmp_path):
    write_nerfstudio(tmp_path / "room", PLAIN)
    thin = load_rgbd(tmp_path / "room", held_out=6, voxel=0.2).original_scan()
    full = load_rgbd(tmp_path / "room", held_out=6, voxel=1e-6).original_scan()
    voxels, there = (np.floor((scan.xyz - full.xyz.min(0)) / 0.2) for scan in (thin, full))
    assert len(np.unique(voxels, axis=0)) == len(thin.xyz) == len(np.unique(there, axis=0)) < len(full.xyz) / 5
    spare = load_rgbd(tmp_path / "room", held_out=6, voxel=1e-6, step=2).original_scan()
    assert 3.8 < len(full.xyz) / len(spare.xyz) < 4.2
    for number in (3, 9, 15):  # held-out frames: black ones must not change the scan
        Image.new("RGB", (80, 60)).save(tmp_path / "room" / "images" / f"{number:03d}.png")
    assert np.array_equal(load_rgbd(tmp_path / "room", held_out=6, voxel=1e-6).original_scan().rgb, full.rgb)


def test_unusable_rgbd_folders_are_refused_by_name(tmp_path):
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


def test_incomplete_tum_and_posed_folders_are_refused_by_name(tmp_path):
    write_tum(tmp_path / "tum")
    (tmp_path / "tum" / "calibration.txt").unlink()
    with pytest.raises(DataError, match="not 640x480"):
        load_rgbd(tmp_path / "tum", held_out=6)
    poses = tmp_path / "tum" / "groundtruth.txt"
    poses.write_text(poses.read_text().replace("13050311", "23050311"))
    with pytest.raises(DataError, match="use the same clock"):
        load_rgbd(tmp_path / "tum", held_out=6)
    write_seven_scenes(tmp_path / "seven")
    (tmp_path / "seven" / "camera-intrinsics.txt").unlink()
    with pytest.raises(DataError, match=r"no intrinsics.*intrinsic_color\.txt"):
        load_rgbd(tmp_path / "seven", held_out=6)
    (tmp_path / "seven" / "intrinsics.txt").write_text("55 55 40 30")
    np.savetxt(tmp_path / "seven" / "frame-000002.pose.txt", 2 * np.eye(4))
    with pytest.raises(DataError, match=r"frame-000002\.pose\.txt: its pose is not a rotation"):
        load_rgbd(tmp_path / "seven", held_out=6)
