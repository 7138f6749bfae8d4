"""LZF in steps: the same bytes whatever the steps, no step beyond the file's end, and compressed PCD files of every layout."""

import struct

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.pcd.lzf import MOST, DamagedLzf, LzfReader
from pointglass.viewer.readers.pcd.pcd_source import PcdSource


def _packed(rng: np.random.Generator, size: int) -> tuple[bytes, bytes]:
    """Compressed bytes of random runs and copies, near and far, and what they mean, by a plain decoder."""
    packed, whole = bytearray(), bytearray()
    while len(whole) < size:
        if not whole or rng.random() < 0.3:
            run = rng.integers(0, 256, rng.integers(1, 33)).astype(np.uint8).tobytes()
            packed += bytes([len(run) - 1]) + run
            whole += run
            continue
        back, length = int(rng.integers(1, min(len(whole), 8192) + 1)), int(rng.integers(3, 265))
        far, short = (back - 1) >> 8, length - 2
        packed += bytes([short << 5 | far] if short < 7 else [7 << 5 | far, short - 7]) + bytes([(back - 1) & 255])
        for _ in range(length):
            whole.append(whole[-back])
    return bytes(packed), bytes(whole)


def test_any_steps_give_the_same_bytes(seed):
    rng = np.random.default_rng(seed)
    packed, whole = _packed(rng, 100_000)
    reader, found = LzfReader(np.frombuffer(packed, np.uint8)), b""
    while len(found) < len(whole):
        step = min(int(rng.choice([1, 7, 300, 9000, 40_000])), len(whole) - len(found))
        again = reader.copy()
        if rng.random() < 0.5:
            reader.skip(step)
            found += again.read(step).tobytes()
        else:
            found += reader.read(step).tobytes()
    assert found == whole
    with pytest.raises(DamagedLzf):
        reader.read(1)


def test_copies_from_before_the_beginning_and_torn_bytes_are_refused():
    for packed in (b"\x20\x00", b"\x00a\x3f\xff", b"\x05abc", b"\x00a\xe0", b"\x00a\xe0\x05", b"\x20"):
        with pytest.raises(DamagedLzf):
            LzfReader(np.frombuffer(packed, np.uint8)).read(200)


def _compressed(path, fields, arrays, packed=None, whole=None):
    """A compressed PCD of (name, SIZE, TYPE, COUNT) fields and their columns."""
    raw = b"".join(array.tobytes() for array in arrays)
    if packed is None:
        packed = b"".join(bytes([len(raw[k : k + 32]) - 1]) + raw[k : k + 32] for k in range(0, len(raw), 32))
    names, sizes, kinds, counts = (" ".join(map(str, column)) for column in zip(*fields, strict=True))
    n = len(arrays[0])
    head = f"VERSION 0.7\nFIELDS {names}\nSIZE {sizes}\nTYPE {kinds}\nCOUNT {counts}\nWIDTH {n}\nHEIGHT 1\nPOINTS {n}\n"
    body = struct.pack("<II", len(packed), len(raw) if whole is None else whole) + packed
    path.write_bytes(f"{head}DATA binary_compressed\n".encode() + body)
    return path


@pytest.mark.parametrize("kind", ["<f4", "<f8", "mixed"])
def test_columns_of_every_kind_between_padding(tmp_path, seed, kind):
    """Names in capitals, padding in front, between and behind, fields without bytes, coordinates of different types."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-9, 9, (3, 300))
    types = ["<f4", "<f8", "<f8"] if kind == "mixed" else [kind] * 3
    columns = [values.astype(t) for values, t in zip(xyz, types, strict=True)]
    pad = rng.integers(0, 255, (300, 7)).astype(np.uint8)
    intensity, label = rng.integers(0, 60_000, 300).astype("<u2"), rng.integers(0, 20, 300).astype("<u1")
    size = [int(t[2]) for t in types]
    fields = [("_", 1, "U", 7), ("X", size[0], "F", 1), ("Y", size[1], "F", 1), ("_", 1, "U", 7), ("Z", size[2], "F", 1),
              ("range", 4, "F", 0), ("Intensity", 2, "U", 1), ("label", 1, "U", 1), ("_", 1, "U", 7)]
    path = _compressed(tmp_path / "a.pcd", fields, [pad, *columns[:2], pad, columns[2], intensity, label, pad])
    (chunk,) = PcdSource(path).chunks()
    assert np.array_equal(chunk.xyz.T, [values.astype(np.float64) for values in columns])
    assert np.array_equal(chunk.intensity, intensity) and np.array_equal(chunk.classification, label)
    sampled = np.concatenate([part.xyz for part in PcdSource(path).sample(300, 64) or ()])
    assert len(sampled) >= 200 and set(sampled[:, 0]) <= set(chunk.xyz[:, 0])


def test_sizes_that_the_compressed_bytes_cannot_hold_are_refused_before_memory_is_taken(tmp_path):
    fields = [(name, 4, "F", 1) for name in "xyz"]
    path = tmp_path / "a.pcd"
    packed = b"\x00a" + b"\xff\xff\xff" * 3
    n = (len(packed) * MOST + 12) // 12 + 1
    path.write_bytes(_compressed(path, fields, [np.zeros((1, 3), "<f4")], packed, n * 12).read_bytes()
                     .replace(b"WIDTH 1\n", f"WIDTH {n}\n".encode()).replace(b"POINTS 1\n", f"POINTS {n}\n".encode()))
    with pytest.raises(InputError, match="compressed bytes cannot hold"):
        PcdSource(path)
    n = 30
    torn = _compressed(path, fields, [np.zeros((n, 3), "<f4")], b"\x20\x00" * 40)
    with pytest.raises(InputError, match="cannot be unpacked"):
        list(PcdSource(torn).chunks())
