"""A scan at an address of which only what a camera looks at is read: its share, its pictures, and faults of the network."""

import json
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import KDTree

from pointglass import look_at
from pointglass.viewer.cli import main
from pointglass.viewer.grid.open_scene import grids_of, open_scene
from pointglass.viewer.grid.records.file_records import FileRecords
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.readers.remote.address import address_in
from pointglass.viewer.readers.remote.octree_set import OctreeSet
from pointglass.viewer.readers.remote.octree_view import octree_view
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.stream import view_reader
from pointglass.viewer.stream.view_reader import ViewReader

sys.path += [str(Path(__file__).resolve().parents[1] / "unit" / part) for part in ("", "readers")]
from cloud_files import write_las
from copc_files import write_copc
from format_files import Points, write_potree1
from range_server import served

SIZE = (240, 180)
SIDE = 7.9
"""Of the site, file units."""
HERE = look_at((0.4, 0.7, 0.9), (3, 0.1, 0.2), fov=40, size=SIZE)
THERE = look_at((7.5, 7.2, 0.9), (5, 7.8, 0.2), fov=40, size=SIZE)


def site(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a square with walls; colours follow the place."""
    random = np.random.default_rng(4)
    xyz = random.uniform(0, SIDE, (count, 3))
    wall, line = random.random(count) < 0.5, random.integers(0, 6, count)
    xyz[:, 2] = np.where(wall, random.uniform(0, 1.5, count), 0.05 + 0.05 * np.sin(xyz[:, 0]))
    xyz[wall, 1] = (SIDE * line / 5)[wall]
    rgb = np.stack([np.sin(xyz @ along) * 20000 + 32000 for along in ((1, 0, 3), (0, 1, 2), (2, 2, 2))], axis=1)
    return np.round(xyz * 4096) / 4096, rgb.astype(np.uint16)


def octrees_at(*texts: str) -> OctreeSet:
    found = []
    for text in texts:
        address = address_in(text)
        assert address is not None
        octree = octree_view(address, 0)
        assert octree is not None
        found.append(octree)
    return OctreeSet(found)


def scene_for(reader: ViewReader, camera, last=None):
    """The scene in which all that a camera looks at is there."""
    reader.look(camera)
    while reader.state.complete is None or reader.state.complete.key != camera.key:
        assert not reader.state.ended, reader.state.problem
        last = reader.take() or last
        time.sleep(0.01)
    found = reader.take() or last
    assert found is not None
    return found


def difference(context, one, other, camera) -> float:
    """Mean difference of filled pictures, levels."""
    pictures = []
    for scene in (one, other):
        renderer = Renderer(context, scene)
        pictures.append(renderer.render(camera, Settings(view="filled")).image("filled").astype(float))
        renderer.release()
    assert np.ptp(pictures[1][..., :3]) > 100, "the camera sees something"
    return float(np.abs(pictures[0] - pictures[1]).mean())


@pytest.fixture(scope="module")
def copc(tmp_path_factory):
    return write_copc(tmp_path_factory.mktemp("copc") / "site.copc.laz", *site(160_000))


@pytest.mark.parametrize("kind", ["copc", "potree"])
def test_what_is_looked_at_is_read_and_its_picture_is_that_of_the_whole_file(context, copc, tmp_path, monkeypatch, kind):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    if kind == "copc":
        path, name = copc, "site.copc.laz"
        files = {name: path.read_bytes()}
    else:
        xyz, rgb = site(160_000)
        grey = np.zeros(len(xyz), np.uint16)
        points = Points(xyz, (rgb >> 8).astype(np.uint8), grey, grey.astype(np.uint8))
        path, name = write_potree1(tmp_path / "site", points), "site"
        files = {f"site/{file.relative_to(path)}": file.read_bytes() for file in path.rglob("*") if file.is_file()}
    whole, size = open_scene(path, cache=False), sum(map(len, files.values()))
    with served(files) as server:
        octree = octrees_at(f"{server.address}/{name}")
        reader = ViewReader(octree, lambda scene: scene)
        scene = scene_for(reader, HERE)
        before = server.sent
        assert before < 0.6 * size
        assert scene.count < 0.9 * whole.count
        assert difference(context, scene, whole, HERE) < 1
        scene = scene_for(reader, THERE, scene)
        assert server.sent > before + 0.1 * size * (kind == "copc"), "the other end was read"
        assert difference(context, scene, whole, THERE) < 1
        reader.close()
        assert reader.join(20)


def test_of_several_octrees_beside_a_file_only_what_is_in_view_is_read_in_one_picture(context, tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    xyz, rgb = site(240_000)
    side, files = (xyz[:, 0] // 2.7).astype(int), {}
    for part in (0, 1):
        path = write_copc(tmp_path / f"{part}.copc.laz", xyz[side == part], rgb[side == part])
        files[path.name] = path.read_bytes()
    here = write_las(tmp_path / "here.las", xyz[side == 2], rgb[side == 2])
    whole = open_scene([tmp_path / "0.copc.laz", tmp_path / "1.copc.laz", here], cache=False)
    with served(files) as server:
        octrees = octrees_at(*(f"{server.address}/{name}" for name in files))
        reader = ViewReader(octrees, lambda scene: scene, beside=grids_of([here]))
        scene = scene_for(reader, HERE)
        assert server.sent < 0.7 * sum(map(len, files.values()))
        assert [Path(source).name for source in scene.meta.sources] == [*files, here.name]
        assert difference(context, scene, whole, HERE) < 1
        values = FileRecords(scene).of(np.arange(0, scene.count, 997))
        assert values.exact and set(values.source.tolist()) == {0, 1, 2}
        assert KDTree(xyz).query(values.xyz)[0].max() < 0.001, "coordinates are those of the files"
        scene = scene_for(reader, THERE, scene)
        assert difference(context, scene, whole, THERE) < 1
        reader.close()
        assert reader.join(20)


@pytest.mark.parametrize(("fov", "psnr"), [(30.0, 38), (3.0, np.inf)])
def test_render_reads_what_its_cameras_can_show_and_says_how_much(context, copc, tmp_path, monkeypatch, capsys, fov, psnr):
    """Pictures agree to the density of points that a pixel can show, and to the byte where nodes are read to their leaves."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("POINTGLASS_REMOTE_WHOLE_MB", "0.1")
    pose = np.eye(4)
    pose[:3] = np.asarray(HERE.camera_to_world)[:3]
    cameras = tmp_path / "path.json"
    cameras.write_text(json.dumps({"render_width": 160, "render_height": 120,
                                   "camera_path": [{"camera_to_world": pose.reshape(-1).tolist(), "fov": fov}]}))
    data = copc.read_bytes()
    with served({"site.copc.laz": data}) as server:
        for scan, out in ((f"{server.address}/site.copc.laz", "part"), (copc, "all")):
            assert main(["render", str(scan), "--cameras", str(cameras), "--out", str(tmp_path / out), "--view", "raw"]) == 0
        assert 0.02 * len(data) < server.sent < 0.6 * len(data)
    said = capsys.readouterr().err
    assert "which 1 picture can show" in said and said.count("are read") == 1
    part, whole = (np.asarray(Image.open(tmp_path / out / "frame_00000.png").convert("RGB"), float) for out in ("part", "all"))
    assert np.ptp(whole) > 100
    error = float(((part - whole) ** 2).mean())
    assert (np.inf if error == 0 else 10 * np.log10(255**2 / error)) >= psnr


@pytest.mark.parametrize("command", ["video", "publish"])
def test_films_and_publications_read_what_their_cameras_can_show(copc, tmp_path, monkeypatch, capsys, command):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("POINTGLASS_REMOTE_WHOLE_MB", "0.1")
    pose = np.eye(4)
    pose[:3] = np.asarray(look_at((-60, -50, 2), (3, 3, 0), fov=40, size=SIZE).camera_to_world)[:3]
    cameras = tmp_path / "path.json"
    cameras.write_text(json.dumps({"render_width": 160, "render_height": 120,
                                   "camera_path": [{"camera_to_world": pose.reshape(-1).tolist(), "fov": 10.0}]}))
    data = copc.read_bytes()
    more = ["--path", cameras] if command == "video" else ["--at", cameras, "--size", "512", "--second", "none"]
    with served({"site.copc.laz": data}) as server:
        assert main([command, f"{server.address}/site.copc.laz", "--out", str(tmp_path / "out"), "--view", "raw",
                     *map(str, more)]) == 0
        assert 0.02 * len(data) < server.sent < 0.7 * len(data)
    assert "can show" in capsys.readouterr().err and any((tmp_path / "out").iterdir())


def test_a_lost_network_is_told_and_tried_again_and_a_changed_file_is_read_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(view_reader, "_PAUSES_S", (0.1,))
    monkeypatch.setattr("pointglass.viewer.readers.remote.remote_object._FIRST_PAUSE", 0.01)
    xyz, rgb = site(60_000)
    data = write_copc(tmp_path / "site.copc.laz", xyz, rgb).read_bytes()
    other = write_copc(tmp_path / "other.copc.laz", xyz[:50_000], rgb[:50_000]).read_bytes()
    with served({"site.copc.laz": data}) as server:
        octree = octrees_at(f"{server.address}/site.copc.laz")
        server.cuts, server.refuse["site.copc.laz"] = 2, 503
        reader = ViewReader(octree, lambda scene: scene)
        reader.look(HERE)
        while not reader.state.problem:
            time.sleep(0.01)
        assert "trying again" in reader.state.problem and not reader.state.ended
        del server.refuse["site.copc.laz"]
        first = scene_for(reader, HERE)
        assert not reader.state.problem and reader.state.points == 60_000
        server.files["site.copc.laz"] = other
        second = scene_for(reader, THERE)
        assert reader.state.points == 50_000 and second is not first
        reader.close()
        assert reader.join(20)


def test_the_copy_keeps_to_the_limit_of_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("POINTGLASS_REMOTE_GB", "0.0008")
    xyz, rgb = site(100_000)
    data = write_copc(tmp_path / "site.copc.laz", xyz, rgb).read_bytes()
    with served({"site.copc.laz": data}) as server:
        octree = octrees_at(f"{server.address}/site.copc.laz")
        for numbers in np.array_split(np.arange(len(octree.nodes.levels)), 8):
            octree.fetch(numbers)
            assert len(octree.chunks(numbers)[0].xyz) == octree.nodes.points[numbers].sum()
            held = sum(file.stat().st_blocks * 512 for file in (tmp_path / "cache" / "remote").rglob("*"))
            assert held < 0.9e6 < len(data)
