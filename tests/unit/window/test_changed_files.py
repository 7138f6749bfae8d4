"""Files added to and removed from an open scene: a step of the document, which the scene follows; work and camera stay."""

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cloud_files import surface, write_ply
from window_session import until_idle

from pointglass.viewer.commands.convert import convert
from pointglass.viewer.grid.place import many_files
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.readers.remote.local_copies import local_file
from pointglass.viewer.window.interaction.measuring.listed_measurements import measurement_group
from pointglass.viewer.window.interaction.registering.align_tool import Align
from pointglass.viewer.window.interaction.tool import ToolContext
from pointglass.viewer.window.session.session import Session
from pointglass.viewer.window.shell.actions import WindowActions
from pointglass.viewer.work.changed_files import with_files, without_file
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.scan_files import FilePart, files_of


class Window:
    """A session with two files of a place open, and what makes its scene follow the document."""

    def __init__(self, folder):
        self.paths = [write_ply(folder / f"part{k}.ply", *surface(5000 + 10 * k, k, (3.0 * k, 0.0, 0.0))) for k in range(3)]
        self.session = Session(Settings(view="filled"), (640, 400), load_network=lambda settings: None)
        self.context = ToolContext(self.session, SimpleNamespace(frame=None), SimpleNamespace(scale=1.0))  # type: ignore[arg-type]
        self.tool = Align()
        self.session.open(self.paths[:2])
        self.turn()

    def turn(self) -> None:
        until_idle(self.session, lambda: self.tool.follow(self.context), lambda: self.tool.worker is not None)

    def names(self) -> list[str]:
        return [os.path.basename(source) for source in self.session.scene.meta.sources]  # type: ignore[union-attr]

    def remove(self, number: int) -> None:
        actions = SimpleNamespace(_session=self.session)
        WindowActions.remove_file(actions, files_of(self.session.scene)[number])  # type: ignore[arg-type]
        self.turn()


@pytest.fixture
def window(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(many_files, "BYTES_AS_ONE", 0)
    made = Window(tmp_path)
    yield made
    made.tool.close()


def test_files_come_and_go_while_work_and_camera_stay(window, tmp_path):
    session = window.session
    cache = tmp_path / "cache"

    def written() -> dict:
        return {grid.parent.name: grid.stat().st_mtime_ns for grid in cache.glob("*/points.npy")}

    first, camera = written(), np.array(session.camera.camera_to_world)
    points = [MeasuredPoint((k, 0.0, 0.0), scan=name) for k, name in enumerate(("part0", "part1", "model tank", "scan 9"))]
    session.work.edit("Measure", measurements=(Measurement("polyline", tuple(points), "wall"),))
    session.work.edit("Hide part1", hidden_stations=(1,))
    found = with_files(session.document, [window.paths[2], window.paths[0]])
    session.work.edit("Add 1 scan", scans=found.scans)
    window.turn()
    assert window.names() == ["part0.ply", "part1.ply", "part2.ply"]
    assert first.items() <= written().items() and len(written()) == 3
    assert measurement_group(window.tool, window.context).row(0).value == "3.000 units"
    window.remove(0)
    assert window.names() == ["part1.ply", "part2.ply"]
    row = measurement_group(window.tool, window.context).row(0)
    assert row.value == "3.000 units; not open" and row.about.endswith("\nIts scan is not open: part0")
    assert session.document.hidden_stations == (0,)  # part1 still
    assert [scan.count for scan in session.scene.meta.scans] == [5010, 5020]
    np.testing.assert_array_equal(session.camera.camera_to_world, camera)
    for names in (["part0.ply", "part1.ply", "part2.ply"], ["part0.ply", "part1.ply"]):
        assert session.work.undo()
        window.turn()
        assert window.names() == names
        assert session.document.hidden_stations == (1,)
    assert len(written()) == 3


def test_a_file_that_cannot_be_read_is_named_and_the_scene_stays(window, tmp_path):
    bad = tmp_path / "bad.ply"
    bad.write_bytes(b"ply\nformat ascii 1.0\nend_header\n")
    found = with_files(window.session.document, [bad])
    window.session.work.edit("Add 1 scan", scans=found.scans)
    window.turn()
    assert window.names() == ["part0.ply", "part1.ply"]
    assert "bad.ply" in window.session.notices.message.text


def test_a_folder_made_by_convert_is_added_and_removed_like_a_file(window, tmp_path):
    convert(window.paths[2:], tmp_path / "grid")
    edit = window.session.work.edit
    edit("Add a folder", scans=with_files(window.session.document, [tmp_path / "grid"]).scans)
    window.turn()
    assert window.names() == ["part0.ply", "part1.ply", "part2.ply"]
    window.remove(2)
    assert window.names() == ["part0.ply", "part1.ply"] and len(window.session.document.scans) == 2
    window.session.work.undo()
    window.turn()
    window.remove(0)
    assert window.names() == ["part1.ply", "part2.ply"]


def test_a_scan_at_an_address_is_removed_like_a_file(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path))
    paths = ["/here/near.laz", "https://there/far.laz"]
    document = Document(tuple(map(ScanFile, paths)))
    parts = [FilePart(str(local_file(Path(path), fetch=False)), range(k, k + 1)) for k, path in enumerate(paths)]
    assert [[scan.path for scan in without_file(document, parts, k).scans] for k in range(2)] == [paths[1:], paths[:1]]
