"""SPZ of every version opens as points with their own colours, said to be splats; what it claims to hold is checked first."""

import gzip
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest

from pointglass.viewer.cli import main
from pointglass.viewer.commands.exporting.command import export
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.edits import NO_EDITS
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.work.selection import Selection

SH0 = 0.28209479177387814


def read(path):
    """(xyz, sRGB 0..255) of a source."""
    chunks = list(open_source(path).chunks())
    return np.concatenate([chunk.xyz for chunk in chunks]), np.concatenate([chunk.rgb for chunk in chunks])


def written(path, rng, version, degree, count=5000):
    """A file as gsply writes it, of another library: (centres, sRGB 0..255, opacity)."""
    gsply = pytest.importorskip("gsply")
    means = rng.uniform(-40, 40, (count, 3)).astype(np.float32)
    sh0, logits = rng.normal(size=(count, 3)).astype(np.float32), rng.normal(size=count).astype(np.float32)
    quats = rng.normal(size=(count, 4)).astype(np.float32)
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    sh = rng.normal(0, 0.2, (count, (degree + 1) ** 2 - 1, 3)).astype(np.float32)
    data = gsply.GSData(means=means, scales=rng.normal(-4, 1, (count, 3)).astype(np.float32), quats=quats, opacities=logits,
                        sh0=sh0, shN=sh)
    gsply.write_spz(path, data, version=version)
    return means, np.clip(0.5 + SH0 * sh0, 0, 1) * 255, 1 / (1 + np.exp(-logits.astype(float)))


@pytest.mark.parametrize(("version", "degree"), [(3, 0), (3, 3), (4, 0), (4, 2)])
def test_files_of_another_library_are_their_centres_in_base_colours(tmp_path, seed, capsys, version, degree):
    path = tmp_path / "room.spz"
    xyz, rgb, opacity = written(path, np.random.default_rng(seed), version, degree)
    found, colours = read(path)
    codes = np.rint(opacity * 255)
    shown = codes >= 0.1 * 255
    assert np.abs(found - xyz[shown]).max() <= 2.0**-13 + 1e-5
    assert np.abs(colours - rgb[shown]).max() <= 0.5 + 0.5 * SH0 / 0.15 + 1e-3  # half a code of the file and half of ours
    source = open_source(path)
    assert source.count == len(xyz) and np.isclose(source.precision_within(np.array([[-40.0] * 3, [40] * 3])), 2.0**-13 / 40)
    assert main(["info", str(path), "--no-cache"]) == 0
    said = capsys.readouterr().out
    assert "SPZ of Gaussian splats" in said and "shown as points" in said
    assert f"{(~shown).sum():,} splats of opacity below 0.1 left out" in said


@pytest.mark.parametrize("version", [1, 2])
def test_old_versions_are_read(tmp_path, seed, version):
    """Half-precision floats (1), and rotations of three bytes (1, 2); as the format's own reader has it."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-9, 9, (300, 3))
    packed = xyz.astype("<f2").tobytes()
    if version == 2:
        words = np.rint(xyz * 2**10).astype("<i4")
        xyz, packed = words / 2**10, words.view(np.uint8).reshape(300, 3, 4)[:, :, :3].tobytes()
    codes = rng.integers(0, 256, (300, 3), np.uint8)
    head = struct.pack("<4sIIBBBB", b"NGSP", version, 300, 1, 10, 0, 0)
    body = packed + bytes([255]) * 300 + codes.tobytes() + bytes((3 + 3 + 9) * 300)
    (tmp_path / "a.spz").write_bytes(gzip.compress(head + body))
    found, rgb = read(tmp_path / "a.spz")
    assert np.abs(found - xyz).max() <= (0.004 if version == 1 else 0)
    expected = np.clip(0.5 + SH0 * (codes / 255 - 0.5) / 0.15, 0, 1) * 255
    assert np.abs(rgb - expected).max() <= 0.501


def test_our_export_comes_back(tmp_path, seed):
    rng = np.random.default_rng(seed)
    xyz = np.c_[rng.random((20_000, 2)) * [6, 4], np.full(20_000, 1.5)]
    rgb = np.where(xyz[:, :1] > 3, [220, 30, 60], [40, 190, 80]).astype(np.uint8)
    scan = scene_from_arrays(xyz, rgb)
    count = export(Selection.in_sight(scan, NO_EDITS), tmp_path / "b.spz", budget=4000)
    scene = open_scene(tmp_path / "b.spz", cache=False)
    found, colours, *_ = unpack(scene)
    assert len(found) == count and np.abs(found[:, 2] - 1.5).max() < 0.01  # y is up in the file, z was in the scan
    assert np.abs(np.concatenate([found.min(axis=0), found.max(axis=0)]) - [0, 0, 1.5, 6, 4, 1.5]).max() < 0.2
    clear = np.abs(found[:, 0] - 3) > 0.2
    expected = np.where(found[clear, :1] > 3, [220, 30, 60], [40, 190, 80])
    assert np.abs(colours[clear] - expected).max() <= 2
    assert export(Selection.in_sight(scene, NO_EDITS), tmp_path / "c.laz") == len(found)


def head(version=3, count=100, degree=0, bits=12, streams=0):
    return struct.pack("<4sIIBBBB", b"NGSP", version, count, degree, bits, 0, streams)


NOISE = gzip.compress(head() + bytes(np.random.default_rng(0).integers(0, 100, 2000, np.uint8)))
BODY = bytes([200]) * (100 * 20)
TABLE = b"".join(struct.pack("<QQ", 10, 100 * width) for width in (9, 1, 3, 3, 4))
FRAMES = head(4, streams=5) + struct.pack("<I12x", 32) + struct.pack("<QQ", 9, 900) + bytes(64)
HOSTILE = {
    "version": (gzip.compress(head(7) + BODY), "SPZ version 7, compressed with gzip, is not read"),
    "four in gzip": (gzip.compress(head(4) + BODY), "SPZ version 4, compressed with gzip, is not read"),
    "none": (gzip.compress(head(count=0)), "holds no splats"),
    "many": (gzip.compress(head(count=2**32 - 1) + BODY), "4,294,967,295 splats, 20,648,881 are read at most"),
    "more than it can hold": (gzip.compress(head(count=9_000_000) + BODY), "bytes cannot hold the 9,000,000 splats"),
    "degree": (gzip.compress(head(degree=9) + BODY), "spherical harmonics of degree 9"),
    "bits": (gzip.compress(head(bits=30) + BODY), "30 bits behind the point"),
    "short": (gzip.compress(head() + BODY[:-1]), "truncated: 2,015 of 2,016 bytes of its splats could be unpacked"),
    "cut": (gzip.compress(head() + np.random.default_rng(0).bytes(2000))[:1500], "truncated: "),
    "broken": (NOISE[:900] + b"\xff" * 60 + NOISE[960:], "damaged: its compressed splats"),
    "checksum": (NOISE[:-8] + bytes(4) + NOISE[-4:], "damaged: its compressed splats"),
    "other": (gzip.compress(b"ply" * 50), "its gzip data does not begin like SPZ"),
    "begin": (NOISE[:10] + b"\xff" * 9 + NOISE[19:], "its gzip data does not begin like SPZ"),
    "header": (gzip.compress(head()[:9]), "truncated: its header ends after 9 bytes"),
    "columns": (head(4, streams=2) + bytes(16) + BODY, "2 columns for spherical harmonics of degree 0"),
    "table": (FRAMES[:60], "the columns do not lie in its 60 bytes"),
    "column": (FRAMES + bytes(9), "column 2 has 0 bytes"),
    "frames": (head(4, streams=5) + struct.pack("<I12x", 32) + TABLE + bytes(90),
               "damaged: its compressed splats cannot be unpacked"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_damaged_files_are_refused_in_one_line(tmp_path, capsys, name):
    data, said = HOSTILE[name]
    (tmp_path / "a.spz").write_bytes(data)
    assert main(["info", str(tmp_path / "a.spz"), "--no-cache"]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and said in lines[0] and "a.spz" in lines[0], lines


def test_a_gzip_bomb_takes_neither_memory_nor_time(tmp_path):
    """A gigabyte of zeros behind the splats of a file of a megabyte is not unpacked."""
    packer = zlib.compressobj(1, zlib.DEFLATED, 31)
    splats = packer.compress(head() + BODY) + packer.flush(zlib.Z_FULL_FLUSH)
    zeros = packer.compress(bytes(1 << 24)) + packer.flush(zlib.Z_FULL_FLUSH)
    (tmp_path / "a.spz").write_bytes(splats + 64 * zeros)
    text = ("import resource, sys; from pointglass.viewer.readers.formats import open_source; from pathlib import Path\n"
            "start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
            "n = sum(len(c.xyz) for c in open_source(Path(sys.argv[1])).chunks())\n"
            "print(n, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - start)")
    done = subprocess.run([sys.executable, "-c", text, str(tmp_path / "a.spz")], capture_output=True, text=True, timeout=100)
    count, grown = map(int, done.stdout.split())
    assert count == 100 and grown < 60_000


def test_other_gzip_files_are_refused_as_before_and_other_names_are_told(tmp_path, seed):
    (tmp_path / "a.ply").write_bytes(gzip.compress(b"ply\nformat ascii 1.0\n" * 50))
    with pytest.raises(InputError, match="is gzip-compressed, unpack it first"):
        open_source(tmp_path / "a.ply")
    (tmp_path / "b.gz").write_bytes(gzip.compress(head() + BODY))
    assert "named .gz but holds SPZ" in open_source(tmp_path / "b.gz").warnings[0]
