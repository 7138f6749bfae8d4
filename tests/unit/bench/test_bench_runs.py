"""Each kind of bench runs whole, and what it reckons from what it measured.  No speed is asserted anywhere."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bench_run import COMMON, SIZE, four_rooms, made_by, run
from untyped import any_typed

from pointglass.viewer.bench import approximations
from pointglass.viewer.bench import memory_headroom as room
from pointglass.viewer.bench.cases import approximation_errors as errors
from pointglass.viewer.bench.cases import culling, photograph_times, scaling
from pointglass.viewer.bench.cases import frame_times as frames
from pointglass.viewer.bench.cases.stability import ROOM, walls
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.paths import cache_dir
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary
from pointglass.viewer.work.places import viewpoints as views


@pytest.fixture(scope="module")
def small():
    return four_rooms()


def test_percentiles_and_one_percent_low():
    known = [float(v) for v in range(1, 401)]  # 1 to 400 ms
    rng = np.random.default_rng(0)
    rng.shuffle(known)
    assert frames.summary(known) == pytest.approx({"p50": 200.5, "p95": 380.05, "p99": 396.01}, rel=1e-12)
    assert frames.one_percent_low(known) == pytest.approx(1000.0 / ((400 + 399 + 398 + 397) / 4))
    assert frames.one_percent_low([20.0, 10.0, 50.0]) == pytest.approx(20.0)  # fewer than 100: the slowest one
    values = rng.gamma(2.0, 30.0, 257)
    assert [frames.summary(values.tolist())[f"p{q}"] for q in (50, 95, 99)] == [np.percentile(values, q) for q in (50, 95, 99)]


def test_the_front_holds_what_nothing_beats_by_more_than_noise():
    def row(name, time, psnr, view="filled", group="g"):
        return {"group": group, "name": name, "view": view, "time": time, "psnr": psnr}

    found = [row("a", 0.5, 30.0), row("slower", 0.6, 29.0), row("c", 0.7, 40.0), row("farther, a little faster", 0.69, 35.0),
             row("equal", 0.9, math.inf), row("equal, as fast", 0.91, math.inf), row("equal, as slow as exact", 0.96, math.inf),
             row("near, as slow as exact", 0.96, 60.0), row("slow", 2.0, math.inf), row("x", 1.0, math.inf, group="exact"),
             row("n", 3.0, 10.0, "neural"), row("m", 0.8, 10.0, "neural")]
    assert errors.front(found) == {"filled": ["g: a", "g: c", "g: equal", "g: equal, as fast"], "neural": ["g: m"]}
    alone = [row("equal, as slow as exact", 0.96, math.inf), row("near", 0.96, 60.0), row("far, faster", 0.94, 20.0)]
    assert errors.front(alone[:2]) == {"filled": []} and errors.front(alone[1:]) == {"filled": []}
    assert errors.front(alone[2:]) == {"filled": ["g: far, faster"]}


def test_what_does_not_fit_is_said_and_not_attempted(monkeypatch, capsys, tmp_path):
    gb = 1 << 30
    assert room.problem(1_000_000, room.Room(8 * gb, 8 * gb)) is None
    assert room.problem(10**9, room.Room(8 * gb, 100 * gb)) is None, "memory does not grow with the scan"
    assert "of memory" in (room.problem(10**9, room.Room(4 * gb, 100 * gb)) or "")
    assert "of disk" in (room.problem(10**9, room.Room(100 * gb, 8 * gb)) or "")
    assert room.needed(10**9).memory < 4 * 10**9 and room.needed(10**9).disk > 12 * 10**9
    real = room.available(tmp_path / "not" / "there" / "yet")
    assert real.memory > 0 and real.disk > 0

    monkeypatch.setattr(scaling, "available", lambda folder: room.Room(1 << 20, 1 << 20))
    monkeypatch.setattr(scaling, "procedural_scene", lambda *a: pytest.fail("attempted"))
    assert run("bench", "scale", "--points", "1M,1G", "--size", "64x48", "--json", tmp_path / "s.json") == 0
    made = json.loads((tmp_path / "s.json").read_text())
    assert [row["fits"] for row in made["rows"]] == [False] * 4 and "needs" in made["rows"][0]["why"]
    assert capsys.readouterr().out.count("does not fit") == 4


def test_growth_is_from_ten_million_up():
    def row(points, ms, fits=True):
        times = {view: {"p50": factor * ms} for factor, view in enumerate(scaling.VIEWS, 1)}
        return {"series": "rooms", "points": points, "fits": fits, "milliseconds": times}

    found = [row(10**6, 5.0), row(10**7, 10.0), row(10**8, 12.0), row(10**9, 0.0, False)]
    assert scaling.growth(found) == {"rooms": {"from": 10**7, "to": 10**8, **dict.fromkeys(scaling.VIEWS, 1.2)}}
    assert scaling.growth(found[:1]) == {}
    found[2]["growth"] = {"raw": 1.1, "filled": 1.3, "neural": 1.05}  # taken side by side
    assert scaling.growth(found) == {"rooms": {"from": 10**7, "to": 10**8, **found[2]["growth"]}}


@pytest.mark.gl
def test_bench_frame(tmp_path, capsys):
    made = made_by("frame", tmp_path, "--size", "48x32,33x17", "--along", "views")
    assert made.keys() >= COMMON | {"raster", "network", "approximations", "runs", "sizes", "cameras", "along"}
    assert [run["size"] for run in made["runs"]] == [[64, 48], [48, 32], [33, 17]] == made["sizes"]
    for held in made["runs"]:
        assert list(held["views"]) == ["raw", "filtered", "filled", "neural"] and held["frames"] == 8
        assert set(held["views"]["neural"]) == {"cull", "raster", "filter", "noise", "fill", "network", "present", "total"}
        for stages in held["views"].values():
            assert stages["total"]["low1_fps"] > 0
            assert all({"p50", "p95", "p99", "cold_ms"} <= v.keys() and v["p50"] <= v["p99"] for v in stages.values())
    said = capsys.readouterr().out
    assert "llvmpipe" in said or made["opengl"] in said
    assert "procedural scan, 20,000 points, 1 rooms, seed 1" in said and "1 % low" in said


@pytest.mark.gl
def test_on_a_gpu_frames_are_also_counted_in_a_row(tmp_path, capsys, monkeypatch):
    from pointglass.viewer.render import renderer

    known = renderer.describe_device
    monkeypatch.setattr(renderer, "describe_device", lambda context: replace(known(context), software=False))
    made = made_by("frame", tmp_path, "--along", "views")
    for stages in made["runs"][0]["views"].values():
        assert stages["total"]["in_a_row_fps"] > 0
    assert ", in a row " in capsys.readouterr().out


@pytest.mark.gl
def test_bench_open(tmp_path):
    made = made_by("open", tmp_path)
    assert made.keys() >= COMMON | {"milliseconds", "size", "points"}
    times = made["milliseconds"]
    assert times["cache to first picture"] < times["cache to every point in view"] < times["cache to full quality"]
    assert "made and built" in times and made["first_picture"] == 1  # so few points are there at once


def test_bench_grid(tmp_path):
    assert made_by("grid", tmp_path, "--points", "20k", "--repeats", "1")["points"] == 20_000


@pytest.mark.gl
def test_bench_scale(tmp_path, monkeypatch):
    monkeypatch.setattr(scaling, "YARDSTICK", 20_000)
    monkeypatch.setattr(scaling, "WARM_POINTS", 10_000)
    opened, known = [], scaling.procedural_scene
    monkeypatch.setattr(scaling, "procedural_scene", lambda scan, folder: opened.append(scan.count) or known(scan, folder))
    made = made_by("scale", tmp_path, "--points", "20k,40k,100G", "--repeats", "1")
    assert made.keys() >= COMMON | {"lod", "rows", "growth", "size"}
    assert [(r["series"], r["points"], r["fits"]) for r in made["rows"]] == [
        (series, n, n < 10**11) for series in ("rooms", "density") for n in (20_000, 40_000, 10**11)]
    for row in made["rows"]:
        if row["fits"]:
            assert row["packed_bytes"] == 12 * row["points"] and row["resident_bytes"] > row["packed_bytes"]
            assert row["resident_before_bytes"] > 0 and scaling.added(row) < row["resident_bytes"]
            assert row["open_to_first_picture_s"] > 0 and set(row["milliseconds"]) == set(scaling.VIEWS)
    assert set(made["growth"]) == {"rooms", "density"} and made["lod"] == scaling.LOD
    for first, second in (made["rows"][0:2], made["rows"][3:5]):
        assert first["growth"] is None and all(0.1 < second["growth"][view] < 10 for view in scaling.VIEWS)
        assert made["growth"][first["series"]] == {"from": 20_000, "to": 40_000, **second["growth"]}
    assert not list(cache_dir().glob("pointglass-scale-*"))
    assert opened == [10_000, 20_000, 40_000, 20_000, 40_000], "once before any counts"


@pytest.mark.gl
def test_bench_error(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(errors, "named_views", lambda scene, size: views.named_views(scene, size)[:1])
    made = made_by("error", tmp_path, "--repeats", "1")
    assert made.keys() >= COMMON | {"rows", "front", "cameras"}
    rows = {f"{row['group']}: {row['name']}": row for row in made["rows"]}
    assert {f"packing: {bits} bits" for bits in range(10, 16)} <= rows.keys()
    assert {f"level of detail: {p} points a pixel" for p in ("0.5", "1", "2", "4", "8")} <= rows.keys()
    assert {"soft depth: 1/32 of depth", "filter: npbg++", "precision: fp16", "network: fast"} <= rows.keys()
    reference = rows["exact: against the float64 reference"]
    assert reference["mask"] < 0.02 and (reference["psnr"] is None or reference["psnr"] > 40), reference
    assert rows["filter: off"]["psnr"] < 60 and rows["packing: 10 bits"]["psnr"] < 60
    assert all(row["milliseconds"] > 0 and row["time"] > 0 for row in made["rows"])
    assert set(made["front"]) == {"filled", "neural"} and all(rows.keys() >= set(names) for names in made["front"].values())
    said = capsys.readouterr().out
    assert "float64 reference" in said and errors.UNBEATEN in said


@pytest.mark.gl
def test_leaving_out_void_is_timed_apart_and_changes_no_pixel(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(errors, "named_views", lambda scene, size: views.named_views(scene, size)[-1:])
    made = made_by("error", tmp_path, "--repeats", "1", "--only", "background")
    row = next(row for row in made["rows"] if row["group"] == "background")
    assert row["psnr"] is None and row["largest"] == 0 and len(row["by_view"]) == 1
    scan = ("--procedural", "20k", "--rooms", "1", "--size", "64x48")
    assert run("bench", "error", *scan, "--only", "nothing") == 2 and "packing" in capsys.readouterr().err


def scanned(seed: int, places: np.ndarray | None = None):
    """A room of which each point has the exposure of one of three stations.  places: (3, 3), NaN: unknown."""
    rng = np.random.default_rng(seed)
    xyz, rgb = walls(seed)
    places = rng.uniform(0.1, 0.9, (3, 3)) * ROOM if places is None else places
    scan = rng.integers(0, 3, len(rgb)).astype(np.uint8)
    scans = tuple(ScanSummary(f"station {number}", int((scan == number).sum()), None if np.isnan(place).any() else
                              tuple(place.tolist())) for number, place in enumerate(places))
    rgb = np.rint(rgb * rng.uniform(0.5, 1.0, (3, 3))[scan]).astype(np.uint8)
    return scene_from_arrays(xyz, rgb, scan=scan, meta=ScanDescription(scans=scans))


@pytest.mark.gl
def test_weighing_by_scanners_is_judged_where_the_scan_knows_them(monkeypatch):
    monkeypatch.setattr(errors, "named_views", lambda scene, size: views.named_views(scene, size)[:1])
    weighted = SimpleNamespace(scene=lambda: scanned(3), facts=lambda *_: {})
    row = next(row for row in errors.run_errors(any_typed(weighted), SIZE, 1, "stations")["rows"] if row["group"] == "stations")
    assert 15 < row["psnr"] < 40 and row["mask"] == 0, "all points alike show another light, on the same surfaces"
    nobody = SimpleNamespace(scene=lambda: scanned(3, np.full((3, 3), np.nan)), facts=lambda *_: {})
    with pytest.raises(InputError, match="expected one of"):
        errors.run_errors(any_typed(nobody), SIZE, 1, "stations")


def test_bench_cull(tmp_path, monkeypatch):
    monkeypatch.setattr(culling, "CELLS", 3000)
    monkeypatch.setattr(culling, "_POINTS", 50_000)
    made = made_by("cull", tmp_path, "--repeats", "1")
    assert made["cells"] >= 3000 and set(made["detail"]) == set(culling.DETAIL)
    for held in made["detail"].values():
        assert held["cells_ms"] > 0 and 0 < held["visible"] < made["cells"]
    assert made["detail"]["1 point a pixel"]["runs"] < made["detail"]["every point"]["runs"]


@pytest.mark.parametrize("times", [1, 2, 5])
def test_a_repeated_floor_has_every_cell_so_often_and_none_twice(small, times):
    _, scene = small
    cells = len(scene.cell_coords)
    made, often = culling.repeated(scene, (times - 1) * cells + 1)
    assert often == times and len(made.cell_coords) == times * cells == len(np.unique(made.cell_coords, axis=0))
    assert made.offsets[-1] == times * scene.offsets[-1] and len(made.offsets) == made.layers * times * cells + 1
    runs = np.diff(made.offsets).reshape(made.layers, times, cells)
    assert (runs == np.diff(scene.offsets).reshape(scene.layers, 1, cells)).all()
    eyes = {tuple(camera.position) for camera in culling.views_around(made, SIZE)}
    assert len(eyes) == 1


@pytest.mark.gl
def test_bench_raster(tmp_path):
    made = made_by("raster", tmp_path, "--repeats", "1", "--points", "20k")
    assert made.keys() >= COMMON and made["points"] == 20_000 and made["failed"] is False
    assert made["milliseconds"].keys() == {"compute", "points", "cpu"} and made["ratio"] > 0


@pytest.mark.gl
def test_bench_photographs(tmp_path, monkeypatch):
    monkeypatch.setattr(photograph_times, "PANORAMAS", 2)
    monkeypatch.setattr(photograph_times, "_PANORAMA", (256, 128))
    made = made_by("photographs", tmp_path, "--repeats", "1", "--points", "20k")
    assert made.keys() >= COMMON | {"size", "repeats"} and made["points"] == 20_000
    none, faces, panoramas = made["sets"]
    assert (none["shown"], none["added_clock_ms"], panoramas["shown"]) == (0, 0, 2) and 0 < faces["shown"] <= 18


@pytest.mark.gl
def test_a_tolerance_of_ones_own_is_that_of_the_reference(small):
    """The hook that tries other soft depths reaches the rasteriser: with 1/4 it draws the reference's picture with 1/4, and not
    that with the usual tolerance."""
    from pointglass.model.reference.projection import SoftZ
    from pointglass.viewer.bench import float64_reference
    from pointglass.viewer.render.device.context import create_context

    _, scene = small
    context = create_context()
    renderer = approximations.BenchRenderer(context, scene, device="cpu")

    def drawn(camera, soft=None):
        renderer.soft = soft
        return renderer.render(camera, approximations.EXACT).image("filled").astype(int)

    def change(camera):
        return (np.abs(drawn(camera, 1 / 4) - drawn(camera)) > 1).mean()

    camera = max(views.named_views(scene, SIZE), key=change)  # the view in which the tolerance matters most
    plain, other = drawn(camera), drawn(camera, 1 / 4)
    patch = pytest.MonkeyPatch()
    patch.setattr("pointglass.model.reference.projection.SoftZ.preset",
                  lambda name, spacing, metre, **_: SoftZ(1 / 4, spacing, linear=True))
    try:
        reference = float64_reference.reference_frame(scene, camera, approximations.EXACT, 1.0)[0].astype(int)
    finally:
        patch.undo()
    usual = float64_reference.reference_frame(scene, camera, approximations.EXACT, 1.0)[0].astype(int)
    gap = {(a, b): (np.abs(made[..., :3] - truth) > 1).mean()  # more than rounding
           for a, made in (("1/4", other), ("usual", plain)) for b, truth in (("1/4", reference), ("usual", usual))}
    assert gap["1/4", "1/4"] < 0.01 and gap["usual", "usual"] < 0.01, gap
    assert gap["1/4", "usual"] > 0.02 and gap["usual", "1/4"] > 0.02, gap
    renderer.release()
    context.release()
