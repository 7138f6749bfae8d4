"""Damaged files of every format (truncated, flipped bytes, absurd counts) are read, or refused in one line: without a
traceback, the end of the process, or memory allocated for a damaged header."""

import json
import os
import resource
import struct
import warnings

import numpy as np
import pytest
from format_files import PtxScan, some, text_rows, write_ept, write_pcd, write_potree1, write_potree2, write_ptx

from pointglass.viewer.cli import main
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.formats import open_source

ROOM = 3 << 30
"""Bytes of address space that reading a damaged file may take beyond what the process has."""


@pytest.fixture(scope="module", autouse=True)
def loaded(tmp_path_factory):
    """Libraries are loaded and loops compiled before memory is limited."""
    folder, points = tmp_path_factory.mktemp("warm"), some(40)
    list(open_source(write_pcd(folder / "a.pcd", points, "binary_compressed")).chunks())
    list(open_source(write_pts(folder / "a.pts", points)).chunks())


@pytest.fixture(autouse=True)
def bounded():
    """Limits memory, so that an unbounded allocation fails in the test."""
    with open("/proc/self/statm") as file:
        have = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (have + ROOM, hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def write_pts(path, points):
    path.write_text(f"{len(points.xyz)}\n" + text_rows([points.xyz, points.intensity, points.rgb]))
    return path


def write_csv(path, points):
    path.write_text("x,y,z,r,g,b\n" + text_rows([points.xyz, points.rgb], ","))
    return path


FILES = {
    "a.pcd": lambda path: write_pcd(path, some(60), "ascii"), "b.pcd": lambda path: write_pcd(path, some(60), "binary"),
    "c.pcd": lambda path: write_pcd(path, some(60), "binary_compressed", packed="U"),
    "d.pts": lambda path: write_pts(path, some(60)), "e.csv": lambda path: write_csv(path, some(60)),
    "f.ptx": lambda path: write_ptx(path, [PtxScan(some(30)), PtxScan(some(30, 1), empty=3)]),
}  # fmt: skip
FOLDERS = {
    "potree 1": lambda path: write_potree1(path, some(60), version="1.7"),
    "potree 1.4": lambda path: write_potree1(path, some(60), version="1.4"),
    "potree las": lambda path: write_potree1(path, some(20), version="1.8", form="laz"),
    "potree 2": lambda path: write_potree2(path, some(60)),
    "brotli": lambda path: write_potree2(path, some(60), encoding="BROTLI"),
    "ept": lambda path: write_ept(path, some(60), data="binary"),
    "ept zst": lambda path: write_ept(path, some(60), data="zstandard", hierarchy="gzip"),
    "ept laz": lambda path: write_ept(path, some(20)),
}  # fmt: skip


def outcome(path) -> str | int:
    """The error line for a scan, or its number of points.  Any other error fails."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            count = 0
            for chunk in open_source(path).chunks():
                assert chunk.xyz.dtype == np.float64 and chunk.xyz.shape == (len(chunk.xyz), 3)
                assert chunk.rgb is None or chunk.rgb.shape == chunk.xyz.shape
                assert all(part is None or len(part) == len(chunk.xyz) for part in (chunk.intensity, chunk.classification))
                count += len(chunk.xyz) + chunk.invalid
            return count
    except InputError as error:
        line = str(error)
        assert "\n" not in line and str(path) in line and len(line) < 600, line
        return line


def changes(data: bytes, random: np.random.Generator, number: int):
    """Damaged versions of a file: truncated at several places, bytes and words changed, digits of text changed."""
    for share in (0.0, 0.01, 0.1, 0.3, 0.5, 0.9, 0.99):
        yield data[: int(share * len(data))]
    yield data[:-1]
    for _ in range(number):
        changed, place = bytearray(data), int(random.integers(0, max(len(data) - 8, 1)))
        match random.integers(0, 4):
            case 0:
                changed[place] ^= 1 << int(random.integers(0, 8))
            case 1:
                changed[place : place + 4] = struct.pack("<I", int(random.integers(0, 2**32)))
            case 2:
                digits = [i for i, byte in enumerate(data[:2000]) if 48 <= byte <= 57] or [place]
                at = int(random.choice(digits))
                absurd = [b"99999999999999", b"-1", b"1e400", b"nan", b"0", b"\0", b"[", b"\xff", b""]
                changed[at : at + 1] = absurd[int(random.integers(len(absurd)))]
            case 3:
                other = int(random.integers(0, max(len(data) - 8, 1)))
                changed[place : place + 8] = data[other : other + 8]
        yield bytes(changed)


@pytest.mark.parametrize("name", FILES)
def test_damaged_files_are_read_or_refused_in_one_line(tmp_path, name):
    path = tmp_path / name
    FILES[name](path)
    data, random = path.read_bytes(), np.random.default_rng(ord(name[0]))
    assert isinstance(outcome(path), int)
    refused = 0
    for changed in changes(data, random, 60):
        path.write_bytes(changed)
        refused += isinstance(outcome(path), str)
    assert refused > 8  # the truncated ones, and more


@pytest.mark.parametrize("name", FOLDERS)
def test_damaged_folders_are_read_or_refused_in_one_line(tmp_path, name):
    folder = FOLDERS[name](tmp_path / "scan")
    assert isinstance(outcome(folder), int)
    random, refused = np.random.default_rng(7), 0
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    chosen = {file.suffix: file for file in files} | {file.name: file for file in files if file.parent == folder}
    for file in chosen.values():
        data = file.read_bytes()
        for changed in changes(data, random, 5 if "la" in name else 15):
            file.write_bytes(changed)
            refused += isinstance(outcome(folder), str)
        file.unlink()
        assert isinstance(outcome(folder), str) or file.suffix == ".hrc"
        file.write_bytes(data)
    assert refused > 8 and isinstance(outcome(folder), int)


@pytest.mark.parametrize("name", [name for name in FILES if name != "e.csv"])  # which does not state its number of points
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_truncated_files_are_refused(tmp_path, name, share):
    path = tmp_path / name
    FILES[name](path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    said = outcome(path)
    assert isinstance(said, str) and ("truncated" in said or "damaged" in said)


def pcd(fields="x y z", size="4 4 4", kind="F F F", points="1", data="ascii", more="", body=b"1 2 3\n") -> bytes:
    head = f"VERSION 0.7\nFIELDS {fields}\nSIZE {size}\nTYPE {kind}\nCOUNT {' '.join('1' for _ in fields.split())}\n{more}"
    return f"{head}POINTS {points}\nDATA {data}\n".encode() + body


HEADERS = [
    ("a.pcd", pcd(fields="x y w"), "without z"), ("a.pcd", pcd(size="4 4"), "has no SIZE, TYPE or COUNT"),
    ("a.pcd", pcd(size="4 4 3"), "cannot be of"), ("a.pcd", pcd(kind="F F Q"), "cannot be of"),
    ("a.pcd", pcd(points="0", body=b""), "no points"), ("a.pcd", pcd(points="-5"), "is not a whole number"),
    ("a.pcd", pcd(points="9" * 15, data="binary"), "truncated: 0 of 999,999,999,999,999 points"),
    ("a.pcd", pcd(points="9" * 15), "truncated: 1 of"), ("a.pcd", pcd(points="9" * 30), "is not a whole number"),
    ("a.pcd", pcd(more="WIDTH 7\nHEIGHT 3\n"), "not WIDTH times HEIGHT"), ("a.pcd", pcd(data="zipped"), "is not known"),
    ("a.pcd", pcd(data="binary_compressed", body=struct.pack("<II", 5, 12) + b"123"), "3 of 5 bytes"),
    ("a.pcd", pcd(data="binary_compressed", body=struct.pack("<II", 3, 2**32 - 1) + b"123"), "do not fill"),
    ("a.pcd", pcd(data="binary_compressed", body=struct.pack("<II", 3, 12) + b"\xff\xff\xff"), "cannot be unpacked"),
    ("a.pcd", pcd(body=b"1 2 x\n"), "line 8 holds '1 2 x' where numbers are expected"),
    ("a.pcd", pcd(points="2", body=b"1 2 3\n4 5\n"), "line 9 has 2 values where 3 are expected: '4 5', the file is truncated"),
    ("a.pts", b"1000000000000\n1 2 3\n", "which its 20 bytes cannot"),
    ("a.pts", b"3\n1 2 3\n4.0 5 6\n\n\n\n", "truncated: 2 of 3 points"),
    ("a.pts", b"1\n1 2 3 4 5\n", "5 values, not 3, 4, 6, 7"),
    ("a.pts", b"points\n1 2 3\n", "where a PTS has the number of its points"),
    ("a.pts", b"0\n", "no points"), ("a.pts", b"2\n1 2 3\n4 five 6\n", "line 3 holds '4 five 6'"),
    ("a.pts", b"\0\0\0\0", "does not begin like one"), ("a.ptx", b"1\n1\n0 0 0\n1 0 0\n", "line 1 does not begin a scan"),
    ("a.ptx", b"99999999\n99999999\n" + b"0 0 0\n" * 20, "more than the file can hold"),
    ("a.ptx", b"1\n1\n" + b"0 0 0\n" * 4 + b"1 0 0 0\n" * 4 + b"1 2 3 4 5\n", "line 11 holds"),
    ("a.ptx", b"1\n2\n" + b"0 0 0\n" * 4 + b"1 0 0 0\n" * 4 + b"1 2 3 .5\n", "truncated: 1 of 2 points of scan 1"),
    ("a.pts", b"2\n1 2 3\n1,5 2,5 3,5\n", "decimal comma: '1,5 2,5 3,5'"),
    ("a.csv", b"u,v,w\n1,2,3\n", "names no x, y, z"),
    ("a.txt", b"a letter\nto nobody\n", "holds no rows of numbers"), ("a.xyz", b"1 2\n3 4\n", "holds no rows of numbers"),
    ("a.xyz", b"1 2 3\n4 5 6\n7 8\n", "line 3 has 2 values where 3 are expected: '7 8', the file is truncated"),
    ("a.xyz", b"1 2 3 4 5\n" * 3, "5 columns and no header"), ("a.xyz", b"1 2 3" + b" " * (1 << 17), "not a text file"),
    ("a.xyz", b"PK\x03\x04 1 2 3\n", "zip archive"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "data", "said"), HEADERS)
def test_invalid_headers_are_refused_in_one_line(tmp_path, name, data, said):
    (tmp_path / name).write_bytes(data)
    line = outcome(tmp_path / name)
    assert isinstance(line, str) and said in line, line


META = {
    "potree 1": [
        ("version", "2.0", "Potree 1.0 to 1.8 are read"), ("boundingBox", {"lx": "a"}, "boundingBox and scale"),
        ("scale", 0, "boundingBox and scale"), ("octreeDir", "none", "no such folder"),
        ("pointAttributes", ["A"], "attribute 1"),
        ("pointAttributes", ["RGB"], "no attribute POSITION"),
        ("pointAttributes", ["POSITION_CARTESIAN"] * 2, "not a multiple of its 24 a point"),
    ],
    "potree 2": [
        ("encoding", "ZIP", "'ZIP' is not known"), ("scale", [1, 2], "scale and offset"),
        ("offset", [1, 2, 1e999], "scale and"),
        ("attributes", [], "no attribute position"), ("attributes", [{"name": "position", "type": "int32"}], "attribute 1"),
        ("hierarchy", {"firstChunkSize": 2**40}, "cannot be in"), ("hierarchy", {"firstChunkSize": 21}, "cannot be in"),
        ("hierarchy", None, "cannot be in"),
    ],
    "ept": [
        ("dataType", "zip", "dataType 'zip' is not known"), ("schema", [], "no X, Y and Z"),
        ("hierarchyType", "xml", "'xml' is not"),
        ("schema", [{"name": "X", "type": "signed", "size": 3}], "dimension 1"),
    ],
}  # fmt: skip


@pytest.mark.parametrize(("kind", "key", "value", "said"), [(kind, *row) for kind, rows in META.items() for row in rows])
def test_invalid_descriptions_are_refused_in_one_line(tmp_path, kind, key, value, said):
    folder = FOLDERS[kind](tmp_path / "scan")
    path = next(folder / name for name in ("cloud.js", "metadata.json", "ept.json") if (folder / name).exists())
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    line = outcome(folder)
    assert isinstance(line, str) and said in line, line


def test_a_cyclic_hierarchy_does_not_loop(tmp_path):
    folder = FOLDERS["potree 2"](tmp_path / "a")
    data = bytearray((folder / "hierarchy.bin").read_bytes())
    first = json.loads((folder / "metadata.json").read_text())["hierarchy"]["firstChunkSize"]
    struct.pack_into("<BBIqq", data, 22, 2, 0, 1, 0, first)
    (folder / "hierarchy.bin").write_bytes(data)
    assert "damaged" in str(outcome(folder))
    folder = FOLDERS["ept"](tmp_path / "b")
    (folder / "ept-hierarchy" / "0-0-0-0.json").write_text('{"0-0-0-0": -1}')
    assert "is described by its own file" in str(outcome(folder))
    (folder / "ept-hierarchy" / "0-0-0-0.json").write_text('{"../../0-0-0-0": 5}')
    assert "damaged" in str(outcome(folder))


def test_compressed_nodes_unpack_to_no_more_than_their_points(tmp_path):
    import brotli
    import zstandard

    bomb = bytes(1 << 26)
    folder = FOLDERS["ept zst"](tmp_path / "a")
    for file in (folder / "ept-data").iterdir():
        file.write_bytes(zstandard.compress(bomb))
        break
    assert "does not hold the" in str(outcome(folder))
    folder = FOLDERS["brotli"](tmp_path / "b")
    size = (folder / "octree.bin").stat().st_size
    packed = brotli.compress(bomb, quality=1)
    (folder / "octree.bin").write_bytes(packed[:size].ljust(size, b"\0"))
    assert "does not unpack to its" in str(outcome(folder))


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    import sys

    made = {"brotli": FOLDERS["brotli"](tmp_path / "a"), "zstandard": FOLDERS["ept zst"](tmp_path / "b")}
    for module, path in made.items():
        monkeypatch.setitem(sys.modules, module, None)
        assert f"install {module}" in str(outcome(path))


def test_the_command_ends_with_2_and_leaves_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    path = FILES["a.pcd"](tmp_path / "a.pcd")
    path.write_bytes(path.read_bytes()[:-300])
    assert main(["convert", "--out", str(tmp_path / "out"), str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "truncated" in said and not (tmp_path / "out").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["a.pcd"]
