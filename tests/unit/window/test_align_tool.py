"""The Align tool without a window: clicks make pairs, each step moves the scan in the document, and the scene follows it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from cloud_files import write_ply
from swept_room import PLACES, ROOM, sweep
from window_session import until_idle

from pointglass.viewer.common.rigid_transform import IDENTITY, Rows, inverse, moved_points, rigid, rotation_about
from pointglass.viewer.grid.records.file_records import FileRecords
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.interaction.meshes.mesh_tool import Meshes
from pointglass.viewer.window.interaction.registering.align_tool import Align
from pointglass.viewer.window.interaction.tool import KeyEvent, PointerEvent, ToolContext
from pointglass.viewer.window.session.session import Session
from pointglass.viewer.work.document import ScanFile
from pointglass.viewer.work.fits.fit import Fit
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.meshes.pick_mesh import ON_MODEL
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.places.pick import Picked
from pointglass.viewer.work.project import moves_of, read_project
from pointglass.viewer.work.registration.moved_files import transforms_of, with_transform
from pointglass.viewer.work.viewpoint import Viewpoint

CORNERS = np.array([[2.9, 2.4, 1.3], [-2.9, 2.4, -1.3], [2.9, -2.4, 0.0], [-2.9, -2.4, 1.3]])


class Window:
    """A session with two scans of a room open, the second in a frame of its own, and the tool."""

    def __init__(self, folder, seed: int, monkeypatch):
        random = np.random.default_rng(seed)
        rotation = rotation_about(random.normal(size=3), random.uniform(-20, 20))
        self.truth: Rows = rigid(rotation, random.uniform(-2, 2, 3))
        self.random = random
        first, second = (sweep(place, seed + number, columns=220, rows=220, noise=0.002)
                         for number, place in enumerate(PLACES[:2]))
        grey = np.full((len(first), 3), 128, np.uint8)
        self.paths = [write_ply(folder / "fixed.ply", first, grey),
                      write_ply(folder / "moving.ply", moved_points(inverse(self.truth), second), grey)]
        self.second = second
        self.session = Session(Settings(view="filled"), (640, 400), load_network=lambda settings: None)
        self.context = ToolContext(self.session, SimpleNamespace(frame=None), SimpleNamespace(scale=1.0))  # type: ignore[arg-type]
        self.tool = Align()
        self.clicked: Picked | None = None
        for pointing in (self.tool._pointing, self.tool._on_meshes):
            monkeypatch.setattr(pointing, "at", lambda *_, **__: self.clicked)
        self.session.open(self.paths)
        self.turn()

    def turn(self) -> None:
        """Turns the loop until nothing goes on."""
        until_idle(self.session, lambda: self.tool.follow(self.context), lambda: self.tool.worker is not None)

    def click(self, place: np.ndarray, scan: int, button: Any = "left") -> None:
        x, y, z = place.tolist()
        self.clicked = Picked(0, (x, y, z), 1.0, (0, 0, 0), None, scan, "", (0, 0), exact=True)
        self.tool.pointer(PointerEvent("release", (1.0, 1.0), button=button, clicks=1), self.context)

    def pair(self, corner: np.ndarray, noise: float = 0.0) -> None:
        self.click(moved_points(inverse(self.truth), corner[None])[0] + noise * self.random.normal(size=3), 1)
        self.click(corner, 0)

    @property
    def transform(self) -> Rows | None:
        return transforms_of(self.session.document.scans, self.session.scene.meta.sources)[1]  # type: ignore[union-attr]

    def shown(self) -> np.ndarray:
        """(n, 3) points of the moving scan as they are shown."""
        values = FileRecords(self.session.scene).of(slice(None))  # type: ignore[arg-type]
        return values.xyz[values.source == 1]

    def is_at_its_place(self, within: float) -> bool:
        low, high = self.second.min(axis=0), self.second.max(axis=0)
        found = self.shown()
        return bool(np.abs([found.min(axis=0) - low, found.max(axis=0) - high]).max() < within)


@pytest.fixture(name="window")
def align_window(tmp_path, seed, monkeypatch):
    made = Window(tmp_path, seed, monkeypatch)
    yield made
    made.tool.close()
    made.session.close()


def test_three_pairs_move_the_scan_the_scene_follows_and_undo_puts_it_back(window):
    before = window.shown()
    for corner in CORNERS[:3]:
        window.pair(corner)
    found = window.tool.pairs.fit()
    assert window.tool.pairs.count == 3 and found.rms < 1e-6
    window.tool.apply_pairs(window.context)
    window.turn()
    np.testing.assert_allclose(np.array(window.transform), np.array(window.truth), atol=1e-6)
    assert window.is_at_its_place(0.02) and window.session.scene.meta.records.moves[0] is None
    assert window.session.work.undo() == "Align moving.ply by pairs"
    window.turn()
    assert window.transform is None and np.array_equal(np.sort(window.shown(), axis=0), np.sort(before, axis=0))
    window.session.work.redo()
    window.turn()
    assert window.is_at_its_place(0.02)


def test_surfaces_refine_what_careless_pairs_began(window):
    for corner in CORNERS:
        window.pair(corner, noise=0.03)
    window.tool.refine(window.context)
    window.turn()
    own = moved_points(inverse(window.truth), window.second)
    assert np.linalg.norm(moved_points(window.transform, own) - window.second, axis=1).max() < 0.004
    assert "% of it overlap" in window.tool.result and window.is_at_its_place(0.02)
    assert window.session.work.undo() == "Refine the place of moving.ply"


def test_either_scan_may_be_clicked_first_and_the_other_is_shown_alone_then(window):
    window.tool.selected(window.context)
    work = window.session.work
    for first, second in ((0, 1), (1, 0)):
        window.click(CORNERS[0], first)
        window.tool.follow(window.context)
        assert work.set_aside == (first,) and work.shown_edits.hidden_stations == (first,)
        assert window.session.spec.edits.hidden_stations == (first,) and work.document.hidden_stations == ()
        window.click(CORNERS[1], first)
        assert window.tool.pairs.begun is not None and "Click the same place in" in window.session.notices.toasts[-1].text
        window.click(CORNERS[0], second)
        window.tool.follow(window.context)
        assert window.tool.pairs.begun is None and work.set_aside == ()
    assert window.tool.pairs.count == 2
    back = [window.tool.key_event(KeyEvent("BACKSPACE", "press"), window.context) for _ in range(5)]
    assert back == [True, True, True, True, False] and window.tool.pairs.count == 0
    window.click(CORNERS[0], 1)
    window.tool.left(window.context)
    assert work.set_aside == ()


def test_points_stay_on_their_scan_when_it_is_moved_by_numbers(window):
    for corner in CORNERS[:3]:
        window.pair(corner)
    window.tool.shift, window.tool.degrees = [1.0, -2.0, 0.5], 12.0
    middle = window.shown().mean(axis=0)
    window.tool.move_by_numbers(window.context)
    window.turn()
    np.testing.assert_allclose(window.shown().mean(axis=0), middle + [1.0, -2.0, 0.5], atol=0.4)  # about an even sample's
    window.tool.apply_pairs(window.context)
    window.turn()
    np.testing.assert_allclose(np.array(window.transform), np.array(window.truth), atol=1e-6)
    window.tool.put_back(window.context)
    window.turn()
    assert window.transform is None


def test_a_click_on_its_floor_levels_it(window):
    window.tool.levelling = True
    floor = moved_points(inverse(window.truth), np.array([[-1.0, -0.5, -1.4]]))[0]
    window.click(floor, 1)
    window.turn()
    own = moved_points(inverse(window.truth), np.array([[0.0, 0.0, -1.4], [2.0, 1.0, -1.4], [-1.0, 2.0, -1.4]]))
    assert np.ptp(moved_points(window.transform, own)[:, 2]) < 0.004
    assert window.session.work.undo() == "Level moving.ply"


def test_surfaces_that_are_far_apart_are_refused_and_the_scan_stays(window):
    window.tool.shift = [100.0, 0.0, 0.0]
    window.tool.move_by_numbers(window.context)
    window.turn()
    there = window.transform
    window.tool.refine(window.context)
    window.turn()
    assert window.session.notices.message is not None and window.transform == there


def test_refining_can_be_given_up(window):
    window.tool.refine(window.context)
    window.tool.worker.cancel()
    window.turn()
    assert window.transform is None and window.session.notices.toasts[-1].text == "Aligning cancelled"


def test_a_load_that_fails_is_not_begun_again(window):
    window.paths[1].unlink()
    window.paths[0].unlink()
    window.tool.shift = [1.0, 0.0, 0.0]
    window.tool.move_by_numbers(window.context)
    window.turn()
    assert window.session.notices.message is not None
    window.tool.follow(window.context)
    assert window.session.loads.current is None


def test_one_file_of_a_folder_of_scans_is_moved_alone(tmp_path):
    folder = tmp_path / "tiles"
    folder.mkdir()
    sources = [str(folder / "a.laz"), str(folder / "b.laz"), str(tmp_path / "c.laz")]
    moved = rigid(np.eye(3), np.array([1.0, 2.0, 3.0]))
    scans = (ScanFile(str(folder), crs="EPSG:25832"), ScanFile(sources[2]))
    found = with_transform(scans, sources, 1, moved)
    assert [scan.path for scan in found] == sources and found[1].crs == "EPSG:25832"
    assert transforms_of(found, sources) == (None, moved, None)
    assert moves_of(with_transform(found, sources, 1, None)) == {}
    assert with_transform(scans, sources, 2, moved)[0] == scans[0]


def test_a_model_is_moved_by_pairs_and_by_the_points_on_its_triangles_undone_and_kept(window, tmp_path):
    low, high = -ROOM, ROOM
    box = trimesh.creation.box(high - low)
    box.export(tmp_path / "room.obj")
    start = rigid(rotation_about(np.array((0.0, 0.0, 1.0)), 15.0), np.array((0.4, -0.3, 0.2)))
    context, tool = window.context, window.tool
    context.session.open(window.paths[:1])
    window.turn()
    context.session.work.edit("Lay a model", meshes=(MeshLayer(str(tmp_path / "room.obj"), transform=start),))
    window.turn()
    assert tool.names(context) == ["fixed.ply", "model room.obj"] and tool.moving == 1, "what can be moved"
    for corner in CORNERS[:3]:
        shift = 0.02 * window.random.normal(size=3)
        x, y, z = (moved_points(start, corner[None])[0] + shift).tolist()
        window.clicked = Picked(ON_MODEL, (x, y, z), 1.0, (0, 0, 0), None, ON_MODEL, "model room.obj", (0, 0), exact=True)
        tool.pointer(PointerEvent("release", (1.0, 1.0), button="left", clicks=1), context)
        window.click(corner, 0)
    assert tool.pairs.count == 3
    tool.apply_pairs(context)

    def off() -> float:
        (layer,) = context.document.meshes
        return float(np.abs(moved_points(layer.transform, CORNERS) - CORNERS).max())

    assert 0.001 < off() < 0.1 and "3 pairs agree" in tool.result
    tool.refine(context)
    window.turn()
    assert off() < 0.001 and "points lie 0.00" in tool.result
    project = tmp_path / "p.pointglass"
    window.session.work.save_project(project, window.session.camera, Settings(view="filled"), "plain")
    assert read_project(project).meshes[0].transform == context.document.meshes[0].transform
    meshes = Meshes()
    context.files = SimpleNamespace(save=lambda purpose, title, name, kinds, done: done(tmp_path / name))  # type: ignore
    meshes.ask_export(context)
    until_idle(window.session, lambda: meshes.follow(context), lambda: meshes.exporting is not None)
    assert [path.name for path in window.session.notices.saved] == ["fixed meshes.glb"]
    x, y, z = trimesh.load_scene(tmp_path / "fixed meshes.glb").to_geometry().vertices.T
    assert np.abs(np.abs(np.column_stack([x, -z, y])) - ROOM).max() < 0.001, "the room at its place"
    assert context.session.work.undo() == "Refine the place of room.obj" and off() > 0.001
    assert context.session.work.undo() == "Align model room.obj by pairs" and off() > 0.2
    context.session.work.undo()
    window.turn()
    assert tool.moving == 0 and tool.names(context) == ["fixed.ply"]


def test_a_line_gets_the_bearing_that_is_typed_and_what_was_picked_on_the_scan_follows_it(window):
    session, tool, context = window.session, window.tool, window.context
    own, other = (session.scene.meta.scans[number].name for number in (1, 0))
    assert own != other
    ends = moved_points(inverse(window.truth), CORNERS[:2])
    fit = Fit("plane", tuple(ends[0].tolist()), (0.0, 0.0, 1.0), 0.0, -1.0, 1.0, 0.0, 0.001, 99, 0.0, 0.1)
    points = tuple(MeasuredPoint(tuple(place.tolist()), scan=scan) for place, scan in zip(ends, (own, other), strict=True))
    view = Viewpoint.of(from_fov(16, 9, 60.0, look_at(ends[0] + (2.0, 0.0, 0.3), ends[0])), "")
    work = {"measurements": (Measurement("distance", points), Measurement("plane", (replace(points[0], fit=fit),))),
            "annotations": (Annotation("on it", points[0].position, view=view, scan=own), Annotation("?", points[1].position))}
    session.work.edit("work", **work)
    tool.line.toggle()
    assert tool.hint(context).startswith("Click the beginning")
    window.click(ends[0], 0)
    assert not tool.line.places, "a click on the other scan is no end"
    window.click(ends[0], 1)
    window.click(ends[1], 1)
    assert tool.line.complete and not tool.line.asks and not tool.pairs.count
    x, y, _ = ends[1] - ends[0]
    assert abs((tool.line.bearing - np.degrees(np.arctan2(x, y)) + 180) % 360 - 180) < 1e-9
    tool.line.bearing = 37.5
    tool.turn_to_bearing(context)
    window.turn()
    document = session.document
    x, y, z = np.subtract(*moved_points(window.transform, ends)[::-1])
    assert abs(np.degrees(np.arctan2(x, y)) - 37.5) < 1e-9 and abs(z - (ends[1] - ends[0])[2]) < 1e-12, "level stays level"
    there = moved_points(window.transform, ends[:1])[0]
    distance, plane = document.measurements
    assert np.allclose(distance.points[0].position, there, atol=1e-9) and distance.points[1] == points[1]
    assert np.allclose(plane.points[0].fit.place, there, atol=1e-9)
    on_it, unknown = document.annotations
    assert np.allclose(on_it.position, there, atol=1e-9) and unknown == work["annotations"][1]
    pixel, depth = on_it.view.camera(16, 9).project(there[None])
    assert np.allclose(pixel, (8.0, 4.5), atol=1e-6) and abs(depth[0] - np.hypot(2.0, 0.3)) < 1e-6
    said = [toast.text for toast in session.notices.toasts]
    assert any("notes 3 moved with the scan; 1 stay" in text for text in said), said
    session.work.undo()
    window.turn()
    assert session.document.measurements == work["measurements"] and session.document.annotations == work["annotations"]
    assert window.transform is None or window.transform == IDENTITY
