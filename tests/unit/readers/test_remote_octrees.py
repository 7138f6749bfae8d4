"""Potree and EPT octrees at addresses: the same scan as in a folder, level by level, with faults of the network in one line."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from copc_files import write_copc
from format_files import some, write_ept, write_potree1, write_potree2
from range_server import served

from pointglass.viewer.cli import main
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.formats import entry_of, open_source
from pointglass.viewer.readers.remote.address import address_in
from pointglass.viewer.readers.remote.copy_folders import home
from pointglass.viewer.readers.remote.fetch import coarse, fetched
from pointglass.viewer.readers.remote.octree_view import octree_view

MAKERS = {
    "potree 1.4": lambda folder: write_potree1(folder, some(3000), version="1.4"),
    "potree 1.7": lambda folder: write_potree1(folder, some(60), version="1.7", form="laz"),
    "potree 1.8": lambda folder: write_potree1(folder, some(3000)),
    "potree 2": lambda folder: write_potree2(folder, some(3000)),
    "potree 2 brotli": lambda folder: write_potree2(folder, some(3000), encoding="BROTLI"),
    "ept": lambda folder: write_ept(folder, some(200)),
    "ept gzip": lambda folder: write_ept(folder, some(3000), data="binary", hierarchy="gzip"),
}
ENTRY = {"potree 1": "cloud.js", "potree 2": "metadata.json", "ept": "ept.json"}


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))


def files_of(folder: Path) -> dict[str, bytes]:
    return {f"a b/{folder.name}/{file.relative_to(folder)}": file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("kind", MAKERS)
def test_an_octree_at_an_address_is_the_octree(tmp_path, kind, capsys):
    here = open_scene(folder := MAKERS[kind](tmp_path / "house"))
    files = files_of(folder)
    with served(files) as server:
        server.cuts = server.busy = 1
        address = f"{server.address}/a%20b/house?sig=secret"
        assert main(["info", address, "--json"]) == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["points"] == here.count and "secret" not in str(facts)
        assert np.all(np.array(facts["bounds"]["min"]) <= here.bounds[0] + 1e-3)
        blocks = kind.startswith("potree 2")  # larger than this octree
        assert blocks or server.sent < 0.9 * sum(map(len, files.values())), "the root and the hierarchy"
        there = open_scene(address)
        assert np.array_equal(here.points, there.points) and np.array_equal(here.origin, there.origin)
        assert set(server.queries) == {"sig=secret"}
        server.sent = 0
        entry = next(name for start, name in ENTRY.items() if kind.startswith(start))
        assert np.array_equal(open_scene(f"{server.address}/a%20b/house/{entry}").points, here.points)
        assert server.sent < 0.3 * sum(map(len, files.values())) + 8192, "compared only"
        assert main(["info", address]) == 0 and f"{server.address}/a%20b/house" in capsys.readouterr().out
    without = open_scene(address)
    assert without.count == here.count and "the copy read earlier is used" in without.meta.warning_texts[-1]
    assert "secret" not in str(without.meta.warning_texts)


@pytest.mark.parametrize("kind", ["potree 1.8", "potree 2", "ept gzip"])
def test_the_upper_levels_come_alone_and_are_an_octree(tmp_path, kind, monkeypatch):
    from pointglass.viewer.readers.remote import upper_levels

    monkeypatch.setattr(upper_levels, "_LEAST", 1)
    files = files_of(MAKERS[kind](tmp_path / "house"))
    with served(files) as server:
        address, counts = address_in(f"{server.address}/a%20b/house"), []
        for points, before in ((700, 0), (700, 700), (2000, 700)):
            found = coarse(address, points, before)
            sample = open_source(found.path).sample(found.points, 256)
            assert sum(len(chunk.xyz) for chunk in sample) == found.points
            counts.append((found.points, found.finer))
        assert counts[0] == (600, True) and counts[1] == (600, False) and counts[2][0] > 600 and counts[2][1]
        held = sum(len(data) for data in files.values())
        assert server.sent < 0.8 * held if kind != "potree 2" else True, "blocks of octree.bin are larger than this octree"
        path = fetched(address)
        assert open_scene(path, cache=False).count == 3000


@pytest.mark.parametrize("kind", ["potree 1.8", "potree 2", "potree 2 brotli", "ept", "ept gzip", "copc"])
def test_nodes_read_one_by_one_lie_in_their_cubes_and_are_the_scan(tmp_path, kind):
    if kind == "copc":
        points = some(9000)
        folder = write_copc(tmp_path / "house.copc.laz", points.xyz, points.rgb.astype(np.uint16) * 257, leaf=500)
        files = {f"a b/{folder.name}": folder.read_bytes()}
    else:
        files = files_of(folder := MAKERS[kind](tmp_path / "house"))
    whole = [*open_source(entry_of(folder)).chunks()]
    with served(files) as server:
        octree = octree_view(address_in(f"{server.address}/a%20b/{folder.name}"), 0)
        nodes, found = octree.nodes, []
        for node in range(len(nodes.levels)):
            octree.fetch(np.array([node]))
            found.append(octree.chunk(np.array([node])))
            xyz, high = found[-1].xyz, nodes.low[node] + nodes.sides[node]
            assert len(xyz) == nodes.points[node]
            assert (xyz >= nodes.low[node] - 2e-3).all() and (xyz <= high + 2e-3).all()
    assert nodes.levels[nodes.leaves].min() > 0 or len(nodes.levels) == 1

    def rows(parts):
        both = [np.column_stack([part.xyz, part.rgb, part.intensity]) for part in parts]
        return np.unique(np.concatenate(both), axis=0, return_counts=True)

    assert all(np.array_equal(one, other) for one, other in zip(rows(found), rows(whole), strict=True))


@pytest.mark.parametrize("kind", ["potree 1.8", "ept gzip", "potree 2"])
def test_a_file_of_the_octree_that_is_not_there_is_one_line(tmp_path, kind, capsys):
    files = files_of(MAKERS[kind](tmp_path / "house"))
    lost = sorted(name for name in files if name.endswith(".bin"))[-1]
    del files[lost]
    with served(files) as server:
        assert main(["convert", f"{server.address}/a%20b/house", "--out", str(tmp_path / "grid")]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert lost.rpartition("/")[2] in line and "404" in line and "not complete" in line and not (tmp_path / "grid").exists()


@pytest.mark.parametrize("name, words", [("house", "404"), ("house/cloud.js", "404"),
                                         ("photos/metadata.json", "does not describe")])  # fmt: skip
def test_an_address_without_an_octree_is_one_line(capsys, name, words):
    with served({"photos/metadata.json": b'{"title": 1}'}) as server:
        assert main(["info", f"{server.address}/{name}?sig=secret"]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and words in line and "secret" not in line


def test_what_came_before_kill_minus_9_is_not_read_again(tmp_path):
    files = files_of(MAKERS["potree 1.8"](tmp_path / "house"))
    with served(files) as server:
        server.delay = 0.1
        process = subprocess.Popen([sys.executable, "-c", FETCH, f"{server.address}/a%20b/house"])
        while len([*home().glob("*/house/data/**/*.bin")]) < 8 and process.poll() is None:
            time.sleep(0.01)
        process.kill()
        process.wait()
        server.delay = 0.0
        there = {str(file.relative_to(next(home().glob("*/house")))) for file in home().glob("*/house/data/**/*.bin")}
        server.requests.clear()
        fetched(address_in(f"{server.address}/a%20b/house"))
        again = {name.removeprefix("a b/house/") for name, _, _ in server.requests}
        assert len(there) >= 8 and not there & again
        assert {str(file.relative_to(tmp_path)) for file in (tmp_path / "house").rglob("*.bin")} == {
            str(file.relative_to(file.parents[[p.name for p in file.parents].index("house")].parent))
            for file in home().glob("*/house/data/**/*.bin")}


FETCH = ("import sys; from pointglass.viewer.readers.remote.address import address_in; "
         "from pointglass.viewer.readers.remote.fetch import fetched; fetched(address_in(sys.argv[1]))")


@pytest.mark.parametrize("when", ["after", "meanwhile", "hierarchy alone"])
def test_an_octree_that_changes_is_read_anew_and_never_mixed(tmp_path, when):
    first = write_ept(tmp_path / "one" / "house", some(3000), data="binary")
    second = write_ept(tmp_path / "two" / "house", some(2500, seed=3), data="binary")
    files, later = files_of(first), files_of(second)
    if when == "hierarchy alone":
        entry = "a b/house/ept.json"
        later[entry] = files[entry] = later[entry].replace(b'"points": 2500', b'"points": 3000')
    with served(files) as server:
        server.later, address = later, address_in(f"{server.address}/a%20b/house")
        server.changes_after = 8 if when == "meanwhile" else None
        if when != "meanwhile":
            assert open_scene(fetched(address), cache=False).count == 3000
            server.files = later
        path = fetched(address)
        assert np.array_equal(open_scene(path, cache=False).points, open_scene(second, cache=False).points)


def test_a_server_of_untrue_names_writes_nothing_elsewhere(tmp_path):
    folder = write_potree1(tmp_path / "house", some(500), version="1.4")
    meta = json.loads((folder / "cloud.js").read_text())
    for change in ({"octreeDir": "../../other"}, {"hierarchy": [["r", 5], ["../../r0", 7]]}):
        files = files_of(folder) | {"a b/house/cloud.js": json.dumps(meta | change).encode()}
        with served(files) as server, pytest.raises(InputError):
            fetched(address_in(f"{server.address}/a%20b/house"))
    assert not any("other" in str(file) for file in tmp_path.rglob("*"))
