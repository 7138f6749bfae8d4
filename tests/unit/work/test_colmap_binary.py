"""COLMAP's binary model says the same as the text model, and damaged files are refused in one line."""

import struct

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.work.cameras.camera_files import read_cameras


def models(folder, rng, images=7):
    """Random text and binary models of the same cameras, in folder/text and folder/binary."""
    text, binary = folder / "text", folder / "binary"
    text.mkdir()
    binary.mkdir()
    lenses = {3: ("PINHOLE", 1, (640, 480), (500.25, 510.5, 320.0, 241.5)),
              8: ("SIMPLE_RADIAL", 2, (800, 600), (600.0, 400.0, 300.0, 0.0))}
    (text / "cameras.txt").write_text("".join(
        f"{i} {name} {w} {h} {' '.join(map(repr, p))}\n" for i, (name, _, (w, h), p) in lenses.items()))
    (binary / "cameras.bin").write_bytes(struct.pack("<Q", len(lenses)) + b"".join(
        struct.pack(f"<iiQQ{len(p)}d", i, kind, w, h, *p) for i, (_, kind, (w, h), p) in lenses.items()))
    lines, blob = [], struct.pack("<Q", images)
    for index in range(images):
        pose = rng.normal(size=7)
        pose[:4] /= np.linalg.norm(pose[:4])
        lens, name, points = (3, 8)[index % 2], f"rig/shot {index}.jpg", int(rng.integers(0, 4))
        lines += [f"{index + 1} {' '.join(map(repr, pose.tolist()))} {lens} {name}", " ".join(["1.5 2.5 -1"] * points)]
        blob += struct.pack("<I7dI", index + 1, *pose, lens) + name.encode() + b"\0"
        blob += struct.pack("<Q", points) + struct.pack("<ddq", 1.5, 2.5, -1) * points
    (text / "images.txt").write_text("\n".join(lines) + "\n")
    (binary / "images.bin").write_bytes(blob)
    return text, binary


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("given", ["", "images.bin", "cameras.bin"])
def test_the_binary_model_is_the_text_model(tmp_path, seed, given):
    text, binary = models(tmp_path, np.random.default_rng(seed))
    for a, b in zip(read_cameras(text), read_cameras(binary / given), strict=True):
        assert a.name == b.name and (a.width, a.height, a.fx, a.fy, a.cx, a.cy) == (b.width, b.height, b.fx, b.fy, b.cx, b.cy)
        assert np.array_equal(a.camera_to_world, b.camera_to_world)


def test_a_cut_or_longer_file_is_refused_wherever_it_is_cut(tmp_path):
    _, binary = models(tmp_path, np.random.default_rng(5), images=3)
    rng = np.random.default_rng(6)
    for name in ("cameras.bin", "images.bin"):
        whole = (binary / name).read_bytes()
        for cut in {0, 1, 8, len(whole) - 1, *rng.integers(0, len(whole), 40).tolist()}:
            (binary / name).write_bytes(whole[:cut])
            with pytest.raises(InputError, match=name):
                read_cameras(binary)
        (binary / name).write_bytes(whole + b"\0")
        with pytest.raises(InputError, match="follow its last entry"):
            read_cameras(binary)
        (binary / name).write_bytes(whole)


def test_distortion_and_foreign_models_are_refused(tmp_path):
    _, binary = models(tmp_path, np.random.default_rng(7))
    (binary / "cameras.bin").write_bytes(struct.pack("<QiiQQ4d", 1, 3, 2, 640, 480, 500.0, 320.0, 240.0, 0.1))
    with pytest.raises(InputError, match=r"distortion \[0.1\]"):
        read_cameras(binary)
    for kind, said in ((5, "OPENCV_FISHEYE"), (99, "number 99")):
        (binary / "cameras.bin").write_bytes(struct.pack("<QiiQQ8d", 1, 3, kind, 640, 480, *[1.0] * 8))
        with pytest.raises(InputError, match=said):
            read_cameras(binary)


def test_huge_counts_are_refused_before_memory_is_taken(tmp_path):
    _, binary = models(tmp_path, np.random.default_rng(8))
    for name in ("cameras.bin", "images.bin"):
        whole = (binary / name).read_bytes()
        (binary / name).write_bytes(struct.pack("<Q", 2**60) + whole[8:])
        with pytest.raises(InputError, match=name):
            read_cameras(binary)
        (binary / name).write_bytes(whole)
