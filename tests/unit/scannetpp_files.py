"""A root in ScanNet++'s layout, its scene the coloured box of walls.py."""

import json

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation
from walls import FISHEYE, LENSES, OPENCV, cast, colour_at, look, rays_of, wall_points


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
    numbers = " ".join(str(v) for v in (lens.fx, lens.fy, lens.cx, lens.cy, *lens.distortion))
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


def write_scannetpp(root):
    """One scene of 14 fisheye photographs, two of them test pictures, and its iPhone frames.  Returns the root."""
    home = root / "data" / "aa11bb22cc"
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
             **{f"k{n + 1}": k for n, k in enumerate(FISHEYE.distortion)}}
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
