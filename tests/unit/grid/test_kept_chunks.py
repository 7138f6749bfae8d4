"""Files are decoded once: the second pass repeats the chunks of the first, from memory or from a file, and where there is room
for neither it decodes again.  The grid is the same to the byte."""

import shutil

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las

from pointglass.viewer.commands.convert import convert
from pointglass.viewer.grid.building import kept_chunks
from pointglass.viewer.grid.building import two_passes as grid_module
from pointglass.viewer.grid.building.kept_chunks import KeptChunks
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.e57 import e57_source
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.las import las_source, laz_points

COLUMNS = ("xyz", "rgb", "intensity", "scan", "station", "classification", "invalid")


@pytest.fixture
def files(tmp_path, seed, monkeypatch):
    """A LAZ with stations, classes and intensities, and an E57 of two scans, each of several chunks."""
    for module in (las_source, e57_source):
        monkeypatch.setattr(module, "CHUNK" if module is las_source else "BLOCK", 1500)
    rng = np.random.default_rng(seed)
    xyz, rgb = surface(6000, seed)
    laz = write_las(tmp_path / "a.laz", xyz, rgb.astype(np.uint16) * 257, rng.integers(0, 60000, 6000),
                    source=np.arange(6000) // 2500, classes=rng.integers(0, 9, 6000))  # fmt: skip
    scans = [E57Scan(xyz[:2500], rgb=rgb[:2500], name="one"), E57Scan(xyz[2500:], rgb=rgb[2500:], name="two")]
    return [laz, write_e57(tmp_path / "b.e57", scans)]


def counted_decodings(monkeypatch) -> list[str]:
    """Names of the formats whose points are decoded from now on."""
    decoded, blocks, columns = [], laz_points.LazPoints.blocks, e57_source.E57Source._columns
    monkeypatch.setattr(laz_points.LazPoints, "blocks",
                        lambda *given, **more: decoded.append("LAZ") or blocks(*given, **more))  # fmt: skip
    monkeypatch.setattr(e57_source.E57Source, "_columns",
                        lambda *given, **more: decoded.append("E57") or columns(*given, **more))  # fmt: skip
    return decoded


def arrays_of(folder) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.npy")}


@pytest.mark.parametrize(("memory", "room", "readings"), [
    (1 << 30, True, 1), (100_000, True, 1), (0, True, 1), (0, False, 2),
])  # fmt: skip
def test_files_are_decoded_once_where_there_is_room(tmp_path, files, monkeypatch, memory, room, readings):
    expected = arrays_of(tmp_path / "known") if convert(files, tmp_path / "known") else {}
    monkeypatch.setattr(kept_chunks, "MEMORY", memory)
    if not room:
        usage = shutil.disk_usage(tmp_path)
        monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=200 << 20))
    decoded = counted_decodings(monkeypatch)
    convert(files, tmp_path / "grid")
    assert decoded.count("LAZ") == readings
    assert decoded.count("E57") == 2 * readings  # of two scans
    assert arrays_of(tmp_path / "grid") == expected
    assert {path.name for path in tmp_path.iterdir()} == {"a.laz", "b.e57", "known", "grid"}


@pytest.mark.parametrize("memory", [1 << 30, 70_000, 0])
def test_a_later_walk_yields_what_the_first_did(tmp_path, files, monkeypatch, memory):
    monkeypatch.setattr(kept_chunks, "MEMORY", memory)
    with KeptChunks([open_source(file) for file in files], tmp_path) as kept:
        first, second = list(kept.walk("reading")), list(kept.walk("reading"))
        assert kept.drop_file() == (memory < 1 << 30)
        third = list(kept.walk("reading"))  # what was in the file is decoded again
    assert len(first) > 6
    for other in (second, third):
        for (number, chunk), (repeated, again) in zip(first, other, strict=True):
            assert number == repeated
            for name in COLUMNS:
                np.testing.assert_array_equal(getattr(chunk, name), getattr(again, name), strict=True)


def test_kept_chunks_make_room_for_the_points(tmp_path, files, monkeypatch):
    """Where the points fit only without what is kept, they are given its place."""
    scene, held = open_scene(files, cache=False), []

    class Counted(KeptChunks):
        def drop_file(self):
            held.append(self._file is not None)
            return super().drop_file()

    def allocate(name, shape, dtype):
        if held != [True]:
            raise OSError(28, "No space left on device")
        return np.empty(shape, dtype)

    monkeypatch.setattr(kept_chunks, "MEMORY", 0)
    monkeypatch.setattr(grid_module, "KeptChunks", Counted)
    known = scene.meta
    again = grid_module.build_grid([open_source(file) for file in files], colours=None, allocate=allocate, known=known)
    assert again.count == scene.count
    assert held == [True, False]
