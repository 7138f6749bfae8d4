"""``import pointglass``: what it loads, what it promises, what it refuses.  Its pictures: tests/gl/test_python_pictures.py."""

import inspect
import json
import subprocess
import sys
from dataclasses import fields, replace

import laspy
import numpy as np
import pytest
from cloud_files import write_ply
from e57_photo_files import pinhole, room_points, write_photos
from untyped import any_typed

import pointglass
from pointglass.viewer.commands.convert import convert
from pointglass.viewer.commands.demo import demo_scan
from pointglass.viewer.commands.info import facts
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.records.file_records import FileRecords
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.settings import Memory, Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary
from pointglass.viewer.readers.e57.e57_images import read_photographs

HEAVY = ("torch", "moderngl", "glcontext", "OpenGL", "numba", "imgui_bundle", "laspy", "pye57", "open3d")


def scan_of(seed: int, points: int = 5_000) -> pointglass.Scan:
    rng = np.random.default_rng(seed)
    scene = scene_from_arrays(
        rng.uniform(-3, 3, (points, 3)) + (4.5e5, 5.2e6, 300), rng.integers(0, 256, (points, 3)).astype(np.uint8),
        intensity=rng.integers(0, 65536, points).astype(np.uint16), scan=rng.integers(0, 3, points).astype(np.uint8),
        meta=ScanDescription(scans=tuple(ScanSummary(f"s{n}", 1, p) for n, p in
                                         enumerate([(4.5e5, 5.2e6, 300.0), None, (4.5e5 + 1, 5.2e6, 301.0)]))),
    )  # fmt: skip
    return pointglass.Scan(scene, "made.laz", Memory())


def test_importing_it_loads_neither_torch_nor_opengl():
    code = f"import sys, pointglass; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.strip() == "[]"


def test_its_keywords_are_the_fields_of_the_settings():
    assert set(pointglass.RenderSettings.__annotations__) == {field.name for field in fields(Settings)} - {"view"}
    assert inspect.signature(pointglass.Scan.render).parameters["view"].default == Settings().view


def test_everything_it_offers_is_documented():
    assert all(inspect.getdoc(getattr(pointglass, name)) for name in pointglass.__all__ if callable(getattr(pointglass, name)))


def test_a_scan_says_what_its_scene_and_the_info_command_say(seed):
    scan = scan_of(seed)
    scene = scan._open
    assert scan.count == len(scan.points) == scene.count
    assert np.array_equal(scan.bounds, scene.bounds) and scan.bounds.shape == (2, 3)
    assert np.array_equal(scan.stations, scene.station_places, equal_nan=True) and scan.stations.shape == (3, 3)
    assert np.isnan(scan.stations[1]).all() and np.isfinite(scan.stations[[0, 2]]).all()
    assert json.dumps(scan.info) == json.dumps(facts(scene))
    scan.bounds[:] = 0  # a copy
    assert np.array_equal(scan.bounds, scene.bounds)


def chosen(rng, count):
    """Every kind of index, and the numbers that NumPy finds behind it."""
    some = rng.integers(-count, count, 50)
    low, high = sorted(rng.integers(0, count, 2).tolist())
    slices = [slice(None), slice(low, high), slice(None, None, 7), slice(high, low, -3), slice(None, None, -1)]
    return [*slices, some, some.tolist(), rng.random(count) < 0.1, -1, [], np.zeros(count, bool)]


def test_chosen_points_are_those_numpy_would_choose(seed):
    rng = np.random.default_rng(seed)
    scan = scan_of(seed)
    values = FileRecords(scan._open).of(slice(None))  # tests/unit/grid/test_file_records.py compares these with the files
    everything = values.xyz, unpack(scan._open)[1], values.columns["intensity"], values.station
    all_points = np.arange(scan.count)
    for first in chosen(rng, scan.count):
        points = scan.points[first]
        numbers = np.atleast_1d(all_points[np.zeros(0, int) if isinstance(first, list) and not first else first])
        assert len(points) == len(numbers)
        for array, name in zip(everything, ("xyz", "rgb", "intensity", "station"), strict=True):
            found = getattr(points, name)
            assert found.dtype == array.dtype and np.array_equal(found, array[numbers]), (first, name)
        if len(numbers) > 4:
            assert np.array_equal(points[1:-1:2].xyz, everything[0][numbers[1:-1:2]])
            assert np.array_equal(np.asarray(points[[2, -1]]), everything[0][numbers[[2, -1]]])


@pytest.mark.parametrize("index", [[10**9], -5_001, [[1, 2], [3, 4]], [0.5], np.ones(3, bool), "a"])
def test_points_that_are_not_there_are_refused(index):
    with pytest.raises((IndexError, pointglass.InputError), match=r"^points\["):
        _ = scan_of(1).points[index]


def test_a_loop_over_single_points_is_refused():
    with pytest.raises(TypeError, match="not iterable"):
        list(scan_of(1).points)  # pyright: ignore


def test_a_camera_looks_where_it_was_told():
    eye, target = np.array([4.5e5, 5.2e6, 301.0]), np.array([4.5e5 + 2, 5.2e6 + 1, 300.0])
    camera = pointglass.look_at(eye, target, fov=50, size=(320, 200), name="a")
    assert (camera.width, camera.height, camera.name) == (320, 200, "a") and abs(camera.vertical_fov - 50) < 1e-9
    assert np.array_equal(camera.position, eye) and camera.up[2] > 0.8
    assert np.allclose(camera.forward, (target - eye) / np.linalg.norm(target - eye))


@pytest.mark.parametrize("given, said", [
    ({"eye": (1, 2)}, r"^eye \(1, 2\): expected three finite numbers"),
    ({"target": (0, float("nan"), 0)}, "^target"), ({"target": "here"}, "^target 'here'"),
    ({"target": (0, 0, 0)}, r"^eye and target are both \[0.0, 0.0, 0.0\]"), ({"up": (0, 0, 0)}, "^up"),
    ({"fov": 180}, "^fov 180"), ({"fov": "wide"}, "^fov 'wide'"),
    ({"size": 640}, "^size 640"), ({"size": (0, 480)}, "width 0"), ({"size": (640, 480.5)}, "height 480.5"),
])  # fmt: skip
def test_a_camera_that_cannot_be_is_refused_in_one_line(given, said):
    with pytest.raises(pointglass.InputError, match=said) as caught:
        pointglass.look_at(**{"eye": (0, 0, 0), "target": (1, 0, 0), **given})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("given, said", [
    ({"view": "pretty"}, "^view 'pretty': expected one of raw"), ({"qualty": "best"}, "no setting 'qualty'; .* mean quality"),
    ({"xxxx": 1}, "no setting 'xxxx'; expected one of raster"), ({"detail": 3}, "^detail 3"),
    ({"filter_levels": 2.5}, r"^filter_levels 2\.5"), ({"lod": "many"}, "lod='many'.*wrong kind"),
    ({"quality": ["best"]}, "wrong kind"), ({"weights": 3}, "^3: expected the path"),
])  # fmt: skip
def test_settings_that_cannot_be_are_refused_before_anything_is_drawn(given, said):
    with scan_of(1) as scan:
        with pytest.raises(pointglass.InputError, match=said):
            scan.render(pointglass.look_at((0, 0, 0), (1, 0, 0)), **given)
        assert scan._drawing is None


def test_what_is_no_camera_is_refused():
    good = pointglass.look_at((0, 0, 0), (1, 0, 0))
    for wrong in (np.eye(4), None, "a", [good, 3]):
        with pytest.raises(pointglass.InputError, match=r"expected a pointglass\.Camera, as look_at makes one, or a list"):
            scan_of(1).render(wrong)  # pyright: ignore


def test_a_closed_scan_says_so_and_closes_again():
    with scan_of(1) as scan:
        points = scan.points
    scan.close()
    for use in (lambda: scan.count, lambda: scan.points, lambda: scan.render(pointglass.look_at((0, 0, 0), (1, 0, 0)))):
        with pytest.raises(pointglass.InputError, match=r"^made\.laz: this scan was closed; open it again$"):
            use()
    assert "closed" in repr(scan) and points.xyz.shape == (5_000, 3)  # what was taken from it stays


@pytest.mark.parametrize("paths, given, said", [
    ((), {}, "no scan given"), (("nowhere.laz",), {}, "^nowhere.laz"), ((["a.laz", "b.laz"],), {}, r"open\(a, b\)"),
    (("a.laz",), {"exposures": "none"}, "^exposures 'none'"), (("a.laz",), {"gpu_memory": "4G"}, "^gpu_memory '4G'"),
])  # fmt: skip
def test_what_cannot_be_opened_is_refused_in_one_line(paths, given, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(pointglass.InputError, match=said) as caught:
        pointglass.open(*paths, **given)
    assert "\n" not in str(caught.value)


def test_several_files_and_converted_folders_open_like_one(tmp_path):
    rng = np.random.default_rng(1)
    first = rng.uniform(0, 2, (500, 3))
    for name, xyz in (("a", first), ("b", rng.uniform(0, 2, (500, 3)))):
        write_ply(tmp_path / f"{name}.ply", xyz, rng.integers(0, 256, (500, 3)).astype(np.uint8))
    with pointglass.open(tmp_path / "a.ply", str(tmp_path / "b.ply"), cache=False) as both:
        assert both.count == 1_000 and repr(both) == "<pointglass.Scan a.ply and 1 more: 1,000 points>"
    convert([tmp_path / "a.ply"], tmp_path / "grid")
    with pointglass.open(tmp_path / "grid") as folder:
        assert folder.count == 500 and np.array_equal(np.sort(folder.points.xyz, axis=0), np.sort(first, axis=0))


@pytest.mark.parametrize("ending", ["las", "laz"])
def test_an_export_holds_the_points_of_boxes_and_stations(seed, tmp_path, ending):
    rng = np.random.default_rng(seed)
    xyz, station = rng.uniform(0, 4, (4_000, 3)).round(3), rng.integers(0, 3, 4_000)
    boxes = np.array([[[0, 0, 0], [2, 2, 4]], [[3, 3, 3], [4, 4, 4]]])
    inside = np.any([((xyz >= low) & (xyz <= high)).all(axis=1) for low, high in boxes], axis=0) & (station != 1)
    given = {"intensity": rng.integers(0, 65536, 4_000), "classification": rng.integers(0, 20, 4_000)}
    with pointglass.from_points(xyz, rng.random((4_000, 3)), station=station, **any_typed(given)) as scan:
        out = tmp_path / f"part.{ending}"
        assert scan.export(out, clip=boxes, stations=[2, 0]) == inside.sum()
        assert scan.export(tmp_path / "all.ply") == 4_000
    written = laspy.read(out)
    order = np.lexsort(xyz[inside].T), np.lexsort(written.xyz.T)
    assert np.allclose(xyz[inside][order[0]], written.xyz[order[1]], rtol=0, atol=1e-9)
    for name, values in given.items():
        assert np.array_equal(values[inside][order[0]], np.asarray(written[name])[order[1]]), name


@pytest.mark.parametrize("given, said", [
    ({"path": "a.txt"}, r"^path a\.txt: expected a name ending in \.las"), ({"path": "no/a.las"}, "^path no/a.las: its folder"),
    ({"clip": [1, 2]}, r"^clip \[1, 2\]: expected"), ({"clip": "all"}, "^clip 'all'"), ({"clip": np.zeros((0, 2, 3))}, "^clip"),
    ({"clip": [[1, 1, 1], [0, 2, 2]]}, "^clip .*each maximum"), ({"clip": [[9, 9, 9], [10, 10, 10]]}, "leave no point"),
    ({"stations": [3]}, "^stations: row 3; the scan has 3 stations"), ({"stations": []}, "^stations: names no station"),
    ({"stations": ["a"]}, r"^stations \['a'\]"), ({"stations": [0.7]}, r"^stations \[0\.7\]"),
    ({"stations": [True, False, True]}, "^stations "), ({"classes": [2.5]}, "^classes "),
    ({"exposures": "none"}, "^exposures 'none'"),
])  # fmt: skip
def test_an_export_that_cannot_be_is_refused_and_leaves_nothing(given, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(pointglass.InputError, match=said) as caught:
        scan_of(1).export(**{"path": "a.las", **given})
    assert "\n" not in str(caught.value) and "--" not in str(caught.value) and list(tmp_path.iterdir()) == []


def test_a_surface_is_fitted_at_the_measured_point_nearest_to_a_place(seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    across = np.linalg.svd(normal[None])[2][1:]
    shift = rng.uniform(-1e5, 1e5, 3)
    xyz = shift + rng.random((4000, 2)) @ across + 0.001 * rng.normal(size=(4000, 1)) * normal
    with pointglass.from_points(xyz, np.full((4000, 3), 0.5)) as scan:
        fit = scan.fit(shift + across.sum(axis=0) / 2 + 0.02 * normal)
        assert isinstance(fit, pointglass.Fit) and fit.kind == "plane" and fit.count > 3000
        assert abs(np.dot(fit.direction, normal)) > 0.99999
        assert abs(np.dot(np.array(fit.place) - shift, normal)) < 2 * fit.offset_uncertainty + 1e-4 < 1e-3
        with pytest.raises(pointglass.PointglassError, match=r"^nothing round here"):
            scan.fit(shift + across.sum(axis=0) / 2, "pipe")
        with pytest.raises(pointglass.InputError, match=r"no measured point lies within .* scan\.points\.xyz"):
            scan.fit(shift + 5 * normal)
        with pytest.raises(pointglass.InputError, match="kind"):
            scan.fit(shift, "cone")  # type: ignore[arg-type]
        with pytest.raises(pointglass.InputError, match="position"):
            scan.fit((0.0, float("nan"), 1.0))


def test_photographs_are_listed_and_decoded_when_asked_for(tmp_path):
    given = [pinhole((0.3, -0.4, 0.2), 0.7, name="placed", coding="jpeg"),
             pinhole((0, 0, 0), 0.0, name="loose", kind="visualReference")]  # fmt: skip
    write_photos(tmp_path / "a.e57", given, *room_points(2000))
    with pointglass.open(tmp_path / "a.e57", cache=False) as scan:
        placed, loose = scan.photographs
        assert (placed.name, placed.kind, placed.file) == ("placed", "pinhole", tmp_path / "a.e57")
        assert placed.size == (96, 72) and placed.image.shape == (72, 96, 3) and placed.image.std() > 5
        assert (placed._repr_png_() or b"")[:4] == b"\x89PNG" and "_stored" not in repr(placed)
        assert placed.camera is not None
        assert (placed.camera.width, placed.camera.height, placed.camera.name) == (96, 72, "placed")
        [read], _ = read_photographs(tmp_path / "a.e57")
        assert np.allclose(placed.camera.camera_to_world, read.camera_to_world)
        assert np.allclose((placed.camera.fx, placed.camera.cx, placed.camera.cy), (read.fl, read.cx, read.cy))
        assert loose.camera is None and loose.kind == "visualReference" and loose.image.shape == (72, 96, 3)
    assert pointglass.from_points(np.eye(3), np.eye(3)).photographs == []


def test_cameras_come_back_from_a_file_as_they_were_written(seed, tmp_path):
    rng = np.random.default_rng(seed)
    cameras = []
    for number in range(5):
        width, height = rng.integers(20, 4000, 2).tolist()
        placed = pointglass.look_at(rng.normal(size=3) + (4.5e5, 5.2e6, 300), (4.5e5, 5.2e6, 300), size=(width, height))
        lens = {"fx": placed.fx * rng.uniform(0.5, 2), "cx": width * rng.uniform(0.4, 0.6)}
        cameras.append(replace(placed, **lens, name=f"view {number}"))
    pointglass.write_cameras(tmp_path / "transforms.json", cameras)
    for made, read in zip(cameras, pointglass.read_cameras(tmp_path / "transforms.json"), strict=True):
        assert (read.width, read.height, read.fx, read.fy, read.cx, read.cy) == (
            made.width, made.height, made.fx, made.fy, made.cx, made.cy)
        assert np.array_equal(read.camera_to_world, made.camera_to_world) and read.name == made.name.replace(" ", "_")
    with pytest.raises(pointglass.InputError, match=r"camera_path\.json: frame \d"):
        pointglass.write_cameras(tmp_path / "camera_path.json", cameras)
    assert not (tmp_path / "camera_path.json").exists()
    film = [pointglass.look_at((n, 0, 0), (n, 5, 0), size=(320, 200), name=f"k{n}") for n in range(3)]
    pointglass.write_cameras(tmp_path / "camera_path.json", film)
    for made, read in zip(film, pointglass.read_cameras(tmp_path / "camera_path.json"), strict=True):
        assert read.name == made.name and np.array_equal(read.camera_to_world, made.camera_to_world)
        assert read.fx == pytest.approx(made.fx, rel=1e-12) and (read.width, read.cx) == (320, 160)


@pytest.mark.parametrize("given, said", [
    (([],), "no cameras to write"), (([1],), "^cameras: 1: expected a pointglass.Camera"),
])  # fmt: skip
def test_cameras_that_cannot_be_written_are_refused(given, said, tmp_path):
    with pytest.raises(pointglass.InputError, match=said):
        pointglass.write_cameras(tmp_path / "a.json", *given)
    with pytest.raises(pointglass.InputError, match=r"^format 'colmap'"):
        pointglass.write_cameras(tmp_path / "a.json", [], format="colmap")  # type: ignore[arg-type]
    with pytest.raises(pointglass.InputError, match="cannot be written"):
        pointglass.write_cameras(tmp_path / "no" / "a.json", pointglass.look_at((0, 0, 0), (1, 0, 0)))
    assert list(tmp_path.iterdir()) == []


def test_cameras_are_read_as_the_render_command_reads_them():
    cameras = pointglass.read_cameras(demo_scan().with_name("demo_cameras.json"), size=(96, 72))
    assert cameras[0].name == "01-living-room" and {(c.width, c.height) for c in cameras} == {(96, 72)}
    assert replace(cameras[0], name="x").name == "x"


def test_an_orthographic_camera_has_one_scale_and_is_refused_by_files_of_pinholes(tmp_path, seed):
    random = np.random.default_rng(seed)
    target, ahead = random.normal(size=3) + (4.5e5, 5.2e6, 300), random.normal(size=3)
    camera = pointglass.orthographic(target, direction=ahead, height=7.0, size=(400, 350))
    aside = camera.right * 2.0 + camera.up * -1.5
    pixels, depth = camera.project([target + aside + camera.forward * away for away in (-60.0, 0.0, 900.0)])
    assert np.allclose(pixels, (200 + 2.0 * 50, 175 + 1.5 * 50), atol=1e-4) and np.allclose(np.diff(depth), (60.0, 900.0))
    plan = pointglass.orthographic(target, height=7.0, back=3.0)
    assert np.allclose(plan.up, (0, 1, 0)) and np.allclose(plan.forward, (0, 0, -1)) and plan.position[2] == target[2] + 3.0
    for given in ({"height": 0.0}, {"height": 5.0, "direction": (0, 0, 0)}, {"height": 5.0, "up": (0, 0, 2)}, {"height": "5"}):
        with pytest.raises(pointglass.InputError):
            pointglass.orthographic(target, **any_typed(given))
    for name in ("transforms.json", "camera_path.json"):
        with pytest.raises(pointglass.InputError, match="is orthographic; this format holds pinholes only"):
            pointglass.write_cameras(tmp_path / name, plan)
    assert not list(tmp_path.iterdir())
