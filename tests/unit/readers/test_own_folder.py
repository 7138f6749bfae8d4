"""A folder of many files reads itself only, and what is compressed unpacks no further than it may."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zstandard
from format_files import some, write_ept, write_potree1, write_potree2

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.own_folder import may_unpack, own_path

FOLDERS = {
    "potree 1": lambda path: write_potree1(path, some()),
    "potree 1 laz": lambda path: write_potree1(path, some(), form="laz"),
    "potree 2": lambda path: write_potree2(path, some()),
    "brotli": lambda path: write_potree2(path, some(), encoding="BROTLI"),
    "ept laz": lambda path: write_ept(path, some()),
    "ept bin": lambda path: write_ept(path, some(), data="binary"),
    "ept zst": lambda path: write_ept(path, some(), data="zstandard"),
}
"""Each writes a folder and returns it, or the file in it that describes it."""
ROOT = Path(__file__).resolve().parents[3]


def _all_points(path: Path) -> int:
    return sum(len(chunk.xyz) for chunk in open_source(path).chunks())


@pytest.mark.parametrize("name", ["/", "..", "../..", "data/../../x", "C:\\", "\\x", "a\0b"])
def test_names_that_lead_out_are_refused(tmp_path, name):
    with pytest.raises(InputError, match="leads out of this folder"):
        own_path(tmp_path, name)


def _folder(kind: str, path: Path) -> Path:
    made = FOLDERS[kind](path)
    return made if made.is_dir() else made.parent


def test_an_octree_dir_that_leads_out_is_refused(tmp_path):
    folder = _folder("potree 1", tmp_path / "scan")
    entry = folder / "cloud.js"
    meta = json.loads(entry.read_text())
    for name in ("/", "../..", str(tmp_path)):
        entry.write_text(json.dumps({**meta, "octreeDir": name}))
        with pytest.raises(InputError, match="leads out of this folder"):
            open_source(folder)


def test_a_node_that_is_a_link_out_of_the_folder_is_refused_and_one_inside_is_read(tmp_path):
    for kind in FOLDERS:
        folder = _folder(kind, tmp_path / kind.replace(" ", "-"))
        expected = _all_points(folder)
        nodes = [path for path in folder.rglob("*") if path.is_file() and path.suffix in (".bin", ".las", ".laz", ".zst")]
        node = max(nodes, key=lambda path: path.stat().st_size)
        inside = node.with_name(f"moved-{node.name}.kept")
        node.rename(inside)
        node.symlink_to(inside)
        assert _all_points(folder) == expected, kind
        outside = tmp_path / f"outside-{kind.replace(' ', '-')}-{node.name}"
        inside.rename(outside)
        node.unlink()
        node.symlink_to(outside)
        with pytest.raises(InputError, match=r"leads? out of (its|this) folder"):
            _all_points(folder)


def test_how_far_data_may_unpack():
    assert may_unpack(100, 1 << 20) and may_unpack(1 << 20, 1000 << 20) and not may_unpack(100_000, 1 << 30)


LIMITED = """
import resource, sys
from pathlib import Path
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.formats import open_source
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    print(sum(len(chunk.xyz) for chunk in open_source(Path(sys.argv[1])).chunks()))
except InputError as error:
    print(error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_a_node_that_unpacks_to_gigabytes_takes_little_memory(tmp_path):
    """As many bytes as the hierarchy says, so that only reading in steps helps; and more than it says."""
    folder = _folder("ept zst", tmp_path / "scan")
    node = next((folder / "ept-data").iterdir())
    schema = json.loads((folder / "ept.json").read_text())["schema"]
    size = sum(entry["size"] for entry in schema)
    count = (200 << 20) // size
    head = np.zeros(1 << 20, np.uint8).tobytes()
    with node.open("wb") as file, zstandard.ZstdCompressor(3).stream_writer(file) as packed:
        for _ in range(count * size // len(head)):
            packed.write(head)
        packed.write(head[: count * size % len(head)])
        packed.write(os.urandom(400_000))  # the ratio is allowed: the rest is more than the hierarchy says
    hierarchy = folder / "ept-hierarchy" / "0-0-0-0.json"
    hierarchy.write_text(json.dumps({node.stem: count}))
    done = subprocess.run([sys.executable, "-c", LIMITED, str(folder)], cwd=ROOT, capture_output=True, text=True, timeout=120)
    said, grown = done.stdout.splitlines()
    assert "does not hold" in said and int(grown) * 1024 < 700 << 20, done.stderr
    hierarchy.write_text(json.dumps({node.stem: 10**9}))
    with pytest.raises(InputError, match="cannot hold"):
        open_source(folder)


def test_a_brotli_node_that_states_gigabytes_is_refused_before_it_is_unpacked(tmp_path):
    folder = _folder("brotli", tmp_path / "scan")
    data = bytearray((folder / "hierarchy.bin").read_bytes())
    kind = [("type", "u1"), ("children", "u1"), ("points", "<u4"), ("place", "<i8"), ("bytes", "<i8")]
    nodes = np.frombuffer(data, np.dtype(kind))
    nodes["points"] = 60_000_000
    (folder / "hierarchy.bin").write_bytes(nodes.tobytes())
    with pytest.raises(InputError, match="a node of 60,000,000 points"):
        open_source(folder)
