"""The benches: where they look from, what they look at, and that each kind runs whole.  No speed is asserted anywhere."""

import itertools
import json
import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from viewer.bench import KINDS, approximations, errors, frames, opponents, scaling, versus, views
from viewer.bench.procedural_scan import PITCH, ProceduralScan, procedural_scene
from viewer.bench.subject import Subject, described
from viewer.camera import from_fov, look_at
from viewer.cli import main
from viewer.cloud import open_scene
from viewer.cloud.scene import unpack
from viewer.paths import assets_dir
from viewer.tools.camera_files import read_cameras

SIZE = (64, 48)


@pytest.fixture(scope="module")
def seed() -> int:
    return int(np.random.SeedSequence().generate_state(1)[0] % 1_000_000)


@pytest.fixture(scope="module")
def small():
    """A floor of four rooms."""
    scan = ProceduralScan(60_000, 4, seed=3)
    return scan, procedural_scene(scan)


def run(*arguments) -> int:
    return main([str(a) for a in arguments])


# the procedural scan

def test_scan_has_the_points_asked_for_and_lies_in_its_rooms(seed):
    for points, rooms in ((2, 1), (6, 3), (12_345, 3), (50_001, 7)):
        scan = ProceduralScan(points, rooms, seed)
        chunks = list(scan.chunks())
        xyz = np.concatenate([chunk.xyz for chunk in chunks])
        assert xyz.shape == (points, 3), f"seed {seed}"
        corner = np.array([scan.columns, math.ceil(rooms / scan.columns), 1]) * PITCH
        assert (xyz > -0.02).all() and (xyz < corner + 0.02).all(), f"seed {seed}"


def test_scan_depends_on_seed_alone_and_not_on_how_it_is_cut(seed):
    scan, other = ProceduralScan(20_000, 2, seed), ProceduralScan(20_000, 2, seed + 1)
    xyz, rgb = scan.points(0, 20_000)
    again = ProceduralScan(20_000, 2, seed).points(0, 20_000)
    assert np.array_equal(xyz, again[0]) and np.array_equal(rgb, again[1]), f"seed {seed}"
    assert not np.array_equal(xyz, other.points(0, 20_000)[0])
    cuts = [0, 1, 777, 9_999, 10_000, 10_001, 20_000]
    parts = [scan.points(a, b) for a, b in itertools.pairwise(cuts)]
    assert np.array_equal(np.concatenate([p[0] for p in parts]), xyz), f"seed {seed}"
    assert np.array_equal(np.concatenate([p[1] for p in parts]), rgb), f"seed {seed}"


def test_every_ray_stops_at_the_first_thing_in_its_way(seed):
    """Against a plain walk along each ray in small steps through the same boxes and walls."""
    scan = ProceduralScan(3_000, 1, seed)  # one room: no doors
    xyz, _ = scan.points(0, 3_000)
    eye = np.where(np.arange(3_000)[:, None] < 1_500, scan.station(0), scan.station(1))
    away = xyz - eye
    far = np.linalg.norm(away, axis=1, keepdims=True)
    boxes = scan._boxes[0]
    steps = (np.arange(0.0, 1.0, 0.002) * (far - 0.02) / far)[:, :, None] * away[:, None] + eye[:, None]
    within = np.zeros(len(xyz), bool)
    for box in boxes:
        within |= ((steps > box[:3] + 0.01) & (steps < box[3:] - 0.01)).all(axis=2).any(axis=1)
    assert not within.any(), f"seed {seed}: {within.sum()} rays pass through furniture"
    reached = xyz[:, None]
    on_box = ((reached > boxes[:, :3] - 0.02) & (reached < boxes[:, 3:] + 0.02)).all(axis=2).any(axis=1)
    low, high = np.array([0.1, 0.1, 0.0]), PITCH - (0.1, 0.1, 0.0)
    on_wall = ((np.abs(xyz - low) < 0.02) | (np.abs(xyz - high) < 0.02)).any(axis=1)
    assert (on_box | on_wall).all(), f"seed {seed}: {(~(on_box | on_wall)).sum()} points float"
    assert on_box.any() and on_wall.any()


def test_density_falls_with_distance(seed):
    scan = ProceduralScan(100_000, 1, seed)
    xyz, _ = scan.points(0, 50_000)
    ceiling = xyz[xyz[:, 2] > PITCH[2] - 0.01]
    away = np.linalg.norm(ceiling[:, :2] - scan.station(0)[:2], axis=1)
    near, far = ((away > a) & (away < b) for a, b in ((0.4, 0.8), (1.6, 1.7)))
    assert near.sum() / (0.8**2 - 0.4**2) > 2 * far.sum() / (1.7**2 - 1.6**2), f"seed {seed}"


def test_stations_see_through_doors(seed):
    scan = ProceduralScan(40_000, 2, seed)
    xyz, _ = scan.points(0, 20_000)  # the first room's stations
    share = (xyz[:, 0] > PITCH[0] + 0.1).mean()
    assert 0 < share < 0.2, f"seed {seed}"


def test_written_to_a_folder_it_is_the_same_scene_and_opens_like_any_other(tmp_path, small):
    scan, scene = small
    made = procedural_scene(scan, tmp_path / "grid")
    opened = open_scene(tmp_path / "grid")
    assert made.count == opened.count == scene.count == 60_000
    assert np.array_equal(opened.points, scene.points) and np.array_equal(opened.offsets, scene.offsets)
    assert opened.meta["procedural"] == {"points": 60_000, "rooms": 4, "seed": 3}


def test_too_few_points_for_the_rooms_are_refused(capsys):
    assert run("bench", "open", "--procedural", "5", "--rooms", "3") == 2
    assert "5 points in 3 rooms: at least 6" in capsys.readouterr().err


# where the benches look from

def test_eight_views_with_names_see_points_and_the_corner_sees_most(small):
    scan, scene = small
    made = views.named_views(scene, (320, 240))
    names = [camera.name for camera in made]
    assert len(names) == len(set(names)) == 8 and {"corner", "far", "down", "close", "place-ahead"} <= set(names)
    xyz = unpack(scene)[0]
    held = {camera.name: views.in_picture(camera, xyz) for camera in made}
    assert min(held.values()) > 0, held
    assert held["corner"] > 0.7 * scene.count and held["far"] > 0.98 * scene.count, held
    place = next(camera for camera in made if camera.name == "place-ahead").position
    assert np.allclose(place, scan.station(2 * scan.middle_room)), "a scan with a scanner's position is seen from there"


def test_the_demo_has_the_shipped_views(small):
    """Told by its file: here another scene that says it came from there."""
    scene = replace(small[1], meta={"sources": [str((assets_dir() / "demo.laz").absolute())]})
    shipped = read_cameras(assets_dir() / "demo_cameras.json")
    made = views.named_views(scene, (480, 360))
    assert [camera.name for camera in made] == [camera.name for camera in shipped]
    assert all(np.array_equal(a.position, b.position) and (a.width, a.height) == (480, 360)
               for a, b in zip(made, shipped, strict=True))
    assert_smooth(views.camera_path(scene, SIZE), reach=10.0)


def assert_smooth(path, reach: float) -> None:
    """48 different cameras; no step is much longer than those beside it, none turns by more than 30 degrees."""
    assert len(path) == views.PATH_FRAMES and len({camera.name for camera in path}) == len(path)
    places = np.stack([camera.position for camera in path])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert steps.sum() > 0.02 * reach and steps.max() < 0.15 * reach
    assert np.abs(np.diff(steps)).max() < 0.6 * steps.max()
    ahead = np.stack([camera.forward for camera in path])
    turns = np.degrees(np.arccos(np.clip((ahead[1:] * ahead[:-1]).sum(axis=1), -1, 1)))
    assert turns.max() < 30.0 and np.abs(np.diff(turns)).max() < 15.0


def test_the_path_is_smooth_and_fixed(small):
    _, scene = small
    path = views.camera_path(scene, SIZE)
    assert_smooth(path, reach=np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    assert all(np.array_equal(a.camera_to_world, b.camera_to_world)
               for a, b in zip(path, views.camera_path(scene, SIZE), strict=True))
    xyz = unpack(scene)[0]
    assert min(views.in_picture(camera, xyz) for camera in path) > 0


def test_a_thing_in_a_void_is_walked_around():
    from viewer.cloud import scene_from_arrays

    rng = np.random.default_rng(5)
    ball = rng.normal(size=(20_000, 3))
    ball = 0.4 * ball / np.linalg.norm(ball, axis=1, keepdims=True) + (100.0, 200.0, 5.0)
    scene = scene_from_arrays(ball, np.full(ball.shape, 128, np.uint8))
    made = views.named_views(scene, (320, 240))
    assert {"around-ahead", "around-left", "corner"} <= {camera.name for camera in made}
    for camera in [*made, *views.camera_path(scene, SIZE)]:
        assert views.in_picture(camera, ball) > 0, camera.name
    assert_smooth(views.camera_path(scene, SIZE), reach=0.8)


def test_in_picture_counts_what_a_pinhole_shows():
    camera = from_fov(100, 100, 90.0, look_at((0, 0, 0), (0, 1, 0)))
    points = np.array([(0, 1, 0), (0.99, 1, 0), (1.01, 1, 0), (0, -1, 0), (0, 1, 1.01), (0, 5, 4.9)])
    assert views.in_picture(camera, points) == 3


# numbers

def test_percentiles_and_one_percent_low():
    known = [float(v) for v in range(1, 401)]  # 1 to 400 ms
    rng = np.random.default_rng(0)
    rng.shuffle(known)
    assert frames.summary(known) == pytest.approx({"p50": 200.5, "p95": 380.05, "p99": 396.01}, rel=1e-12)
    assert frames.one_percent_low(known) == pytest.approx(1000.0 / ((400 + 399 + 398 + 397) / 4))
    assert frames.one_percent_low([20.0, 10.0, 50.0]) == pytest.approx(20.0)  # fewer than 100: the slowest one
    values = rng.gamma(2.0, 30.0, 257)
    assert [frames.summary(values)[f"p{q}"] for q in (50, 95, 99)] == [np.percentile(values, q) for q in (50, 95, 99)]


def test_the_front_holds_what_nothing_beats():
    def row(name, time, psnr, view="filled", group="g"):
        return {"group": group, "name": name, "view": view, "time": time, "psnr": psnr}

    found = [row("a", 0.5, 30.0), row("b", 0.6, 29.0), row("c", 0.7, 40.0), row("d", 0.7, 35.0), row("e", 0.9, math.inf),
             row("f", 2.0, math.inf), row("x", 1.0, math.inf, group="exact"), row("n", 3.0, 10.0, "neural")]
    assert errors.front(found) == {"filled": ["g: a", "g: c", "g: e"], "neural": ["g: n"]}


def test_what_does_not_fit_is_said_and_not_attempted(monkeypatch, capsys, tmp_path):
    gb = 1 << 30
    assert scaling.problem(1_000_000, scaling.Room(8 * gb, 8 * gb)) is None
    assert scaling.problem(10**9, scaling.Room(8 * gb, 100 * gb)) is None, "memory does not grow with the scan"
    assert "of memory" in (scaling.problem(10**9, scaling.Room(4 * gb, 100 * gb)) or "")
    assert "of disk" in (scaling.problem(10**9, scaling.Room(100 * gb, 8 * gb)) or "")
    assert scaling.needed(10**9).memory < 4 * 10**9 and scaling.needed(10**9).disk > 12 * 10**9
    real = scaling.available(tmp_path / "not" / "there" / "yet")
    assert real.memory > 0 and real.disk > 0

    monkeypatch.setattr(scaling, "available", lambda folder: scaling.Room(1 << 20, 1 << 20))
    monkeypatch.setattr(scaling, "procedural_scene", lambda *a: pytest.fail("attempted"))
    assert run("bench", "scale", "--points", "1M,1G", "--size", "64x48", "--json", tmp_path / "s.json") == 0
    made = json.loads((tmp_path / "s.json").read_text())
    assert [row["fits"] for row in made["rows"]] == [False] * 4 and "needs" in made["rows"][0]["why"]
    assert capsys.readouterr().out.count("does not fit") == 4


def test_growth_is_from_ten_million_up():
    def row(points, ms, fits=True):
        times = {"raw": {"p50": ms}, "filled": {"p50": 2 * ms}}
        return {"series": "rooms", "points": points, "fits": fits, "milliseconds": times}

    found = [row(10**6, 5.0), row(10**7, 10.0), row(10**8, 12.0), row(10**9, 0.0, False)]
    assert scaling.growth(found) == {"rooms": {"from": 10**7, "to": 10**8, "raw": 1.2, "filled": 1.2}}
    assert scaling.growth(found[:1]) == {}


def test_fairness_and_ratios():
    from model.unet import PaperUNet, mac_per_pixel

    work = 2 * mac_per_pixel(PaperUNet(), 32) * 960 * 720
    fair = versus.fairness(1000.0, (960, 720), {"matmul": 2.5 * work, "convolution": 2 * work})
    assert fair["fair"] and fair["share_of_matmul"] == pytest.approx(0.4) and fair["share_of_convolution"] == pytest.approx(0.5)
    assert not versus.fairness(1001.0, (960, 720), {"matmul": 2.5 * work, "convolution": work})["fair"]
    assert not fair["busy"] and versus.fairness(1.0, (960, 720), {"matmul": work, "convolution": work})["busy"]
    assert fair["mac_per_pixel"] == pytest.approx(736_256, rel=1e-3)
    held = {name: {"milliseconds": {"total": {"p50": ms}}} for name, ms in (("ours, fast", 20.0), (versus.PAPER, 90.0))}
    assert versus.ratios(held) == {"ours, fast": {versus.PAPER: 4.5}}


# the opponent

def test_the_paper_gets_what_its_program_feeds_it():
    import torch

    depth = torch.tensor([[2.0, torch.inf], [6.0, 3.0]])
    colour = torch.tensor([[[255, 0, 51, 255]] * 2] * 2, dtype=torch.uint8)
    made = opponents.paper_input(colour, depth, torch.tensor([[True, False], [False, True]]))
    assert made.shape == (1, 5, 2, 2)
    assert torch.allclose(made[0, :3, 0, 0], torch.tensor([1.0, 0.0, 0.2]))
    assert made[0, 3].tolist() == [[1, 0], [0, 1]] and torch.allclose(made[0, 4], torch.tensor([[0.0, -1.0], [1.0, 0.25]]))
    void = opponents.paper_input(colour, torch.full((2, 2), torch.inf), torch.zeros(2, 2, dtype=torch.bool))
    assert torch.isfinite(void).all() and (void[0, 4] == -1).all()


def test_the_papers_network_is_whole_and_its_picture_that_of_the_network():
    import torch

    from model.unet import PaperUNet

    network = opponents.PaperNetwork((48, 32), "cpu", torch.float32, seed=4)
    assert network.parameters == 31_038_915
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(4)
        plain = PaperUNet().eval()
    rng = np.random.default_rng(1)
    colour = rng.integers(0, 256, (32, 48, 4), dtype=np.uint8)
    depth = rng.uniform(1, 9, (32, 48)).astype(np.float32)
    mask = rng.random((32, 48)) > 0.5
    network.load(colour, depth, mask)
    network.run()
    with torch.inference_mode():
        expected = plain(opponents.paper_input(*(torch.from_numpy(a) for a in (colour, depth, mask))))[0].clamp(0, 1)
    gap = np.abs(network.picture.numpy().astype(int) - np.rint(expected.permute(1, 2, 0).numpy() * 255))
    assert gap.max() <= 1


@pytest.mark.gl
def test_the_opponent_draws_every_point_and_the_same_picture(small):
    """All points or only those in view: the picture is that of an ordinary renderer with the published settings."""
    from viewer.render.context import create_context
    from viewer.render.renderer import Renderer

    _, scene = small
    context = create_context()
    renderer, camera = Renderer(context, scene, device="cpu"), views.named_views(scene, SIZE)[1]
    given = {}

    class Network:
        def load(self, colour, depth, mask):
            given.update(colour=colour.copy(), depth=depth.copy(), mask=mask.copy())

        def run(self):
            pass

    paper = opponents.Published(context, scene, Network())  # type: ignore[arg-type]
    times = paper.frame(camera)
    assert set(times) == {*opponents.COUNTED, *opponents.LEFT_OUT}
    assert paper._renderer.render(camera, paper.settings).stats["points_drawn"] == scene.count
    frame = renderer.render(camera, paper.settings, views=("raw", "filtered"))
    assert frame.stats["points_drawn"] < scene.count
    assert np.array_equal(frame.image("raw"), given["colour"]) and np.array_equal(frame.depth(), given["depth"])
    assert np.array_equal(frame.mask(), given["mask"]) and given["mask"].any()
    for made in (paper, renderer, context):
        made.release()


# whole runs

COMMON = {"bench", "machine", "scans", "opengl", "driver"}


def made_by(kind: str, folder, *arguments) -> dict:
    """The JSON of one bench on a tiny scan at 64x48; its plot is a picture."""
    scan = [] if kind in ("scale", "grid", "raster") else ["--procedural", "20k", "--rooms", "1"]
    json_file, plot = folder / f"{kind}.json", folder / f"{kind}.png"
    assert run("bench", kind, *scan, "--size", "64x48", "--json", json_file, "--plot", plot, *arguments) == 0
    assert plot.read_bytes().startswith(b"\x89PNG")

    def refuse(name):
        pytest.fail(f"{kind}: {name} is no JSON")

    made = json.loads(json_file.read_text(), parse_constant=refuse)
    assert made["bench"] == kind and {"cores", "processor", "system", "versions", "gpu"} <= made["machine"].keys()
    assert sorted(p.name for p in folder.iterdir()) == sorted([json_file.name, plot.name])
    return made


@pytest.mark.gl
def test_bench_frame(tmp_path, capsys):
    made = made_by("frame", tmp_path, "--size", "48x32,33x17", "--along", "views")
    assert made.keys() >= COMMON | {"raster", "network", "approximations", "runs", "sizes", "cameras", "along"}
    assert [run["size"] for run in made["runs"]] == [[64, 48], [48, 32], [33, 17]] == made["sizes"]
    for held in made["runs"]:
        assert list(held["views"]) == ["raw", "filtered", "filled", "neural"] and held["frames"] == 8
        assert set(held["views"]["neural"]) == {"cull", "raster", "filter", "fill", "network", "present", "total"}
        for stages in held["views"].values():
            assert stages["total"]["low1_fps"] > 0
            assert all({"p50", "p95", "p99", "cold_ms"} <= v.keys() and v["p50"] <= v["p99"] for v in stages.values())
    said = capsys.readouterr().out
    assert "llvmpipe" in said or made["opengl"] in said
    assert "procedural scan, 20,000 points, 1 rooms, seed 1" in said and "1 % low" in said


@pytest.mark.gl
def test_bench_open(tmp_path):
    made = made_by("open", tmp_path)
    assert made.keys() >= COMMON | {"milliseconds", "size", "points"}
    times = made["milliseconds"]
    assert times["cache to first picture"] < times["cache to full quality"] and "made and built" in times


def test_bench_grid(tmp_path):
    assert made_by("grid", tmp_path, "--points", "20k", "--repeats", "1")["points"] == 20_000


@pytest.mark.gl
def test_bench_scale(tmp_path):
    made = made_by("scale", tmp_path, "--points", "20k,40k,100G", "--repeats", "1")
    assert made.keys() >= COMMON | {"lod", "rows", "growth", "size"}
    assert [(r["series"], r["points"], r["fits"]) for r in made["rows"]] == [
        (series, n, n < 10**11) for series in ("rooms", "density") for n in (20_000, 40_000, 10**11)]
    for row in made["rows"]:
        if row["fits"]:
            assert row["packed_bytes"] == 12 * row["points"] and row["resident_bytes"] > row["packed_bytes"]
            assert row["open_to_first_picture_s"] > 0 and set(row["milliseconds"]) == {"raw", "filled"}
    assert set(made["growth"]) == {"rooms", "density"} and made["lod"] == scaling.LOD


@pytest.mark.gl
def test_bench_versus(tmp_path, monkeypatch, capsys):
    def absent():
        raise opponents.Open3DError("Open3D is not installed here")

    monkeypatch.setattr(opponents, "Open3DPoints", absent)
    rates = []
    monkeypatch.setattr(versus, "matmul_rate", lambda *a: rates.append("matmul") or 1e12)
    monkeypatch.setattr(versus, "conv_rate", lambda *a: rates.append("convolution") or 1e12)
    made = made_by("versus", tmp_path, "--frames", "2", "--repeats", "1", "--device", "cpu")
    assert made.keys() >= COMMON | {"runs", "said", "open3d", "frames", "device"} and rates == ["matmul", "convolution"] * 2
    assert made["open3d"] == "Open3D is not installed here" and "Open3D is not installed here" in capsys.readouterr().out
    (held,) = made["runs"]
    assert set(held["contenders"]) == {"ours, balanced", "ours, fast", versus.PAPER}
    assert set(held["contenders"][versus.PAPER]["milliseconds"]) == {*opponents.COUNTED, *opponents.LEFT_OUT, "total"}
    assert "31,038,915" in held["contenders"][versus.PAPER]["network"]
    assert held["ratios"]["ours, fast"][versus.PAPER] > 0 and held["fairness"]["needed"] == versus.FAIR


def test_matrix_rates_are_measured():
    import torch

    from viewer.bench.matrix_rate import conv_rate, matmul_rate

    assert matmul_rate("cpu", torch.float32, side=64, seconds=0.0) > 1e6
    assert conv_rate("cpu", torch.float32, (16, 12), seconds=0.0) > 1e5


@pytest.mark.gl
def test_bench_error(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(errors, "named_views", lambda scene, size: views.named_views(scene, size)[:1])
    made = made_by("error", tmp_path, "--repeats", "1")
    assert made.keys() >= COMMON | {"rows", "front", "left_out", "cameras"}
    rows = {f"{row['group']}: {row['name']}": row for row in made["rows"]}
    assert {f"packing: {bits} bits" for bits in range(10, 16)} <= rows.keys()
    assert {f"level of detail: {p} points a pixel" for p in ("0.5", "1", "2", "4", "8")} <= rows.keys()
    assert {"soft depth: 1/32 of depth", "filter: npbg++", "precision: fp16", "network: fast"} <= rows.keys()
    assert "precision: int8" in rows or any(why.startswith("int8") for why in made["left_out"])
    twin = rows["exact: against the float64 twin"]
    assert twin["mask"] < 0.02 and (twin["psnr"] is None or twin["psnr"] > 40), twin
    assert rows["filter: off"]["psnr"] < 60 and rows["packing: 10 bits"]["psnr"] < 60
    assert all(row["milliseconds"] > 0 and row["time"] > 0 for row in made["rows"])
    assert set(made["front"]) == {"filled", "neural"} and all(made["front"].values())
    assert "float64 twin" in capsys.readouterr().out


@pytest.mark.gl
def test_leaving_out_void_is_timed_apart_and_changes_no_pixel(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(errors, "named_views", lambda scene, size: views.named_views(scene, size)[-1:])
    made = made_by("error", tmp_path, "--repeats", "1", "--only", "void")
    row = next(row for row in made["rows"] if row["group"] == "void")
    assert row["psnr"] is None and row["largest"] == 0 and len(row["by_view"]) == 1
    assert run("bench", "error", "--only", "nothing") == 2 and "packing" in capsys.readouterr().err


@pytest.mark.gl
def test_bench_raster(tmp_path):
    made = made_by("raster", tmp_path, "--repeats", "1", "--points", "20k")
    assert made.keys() >= COMMON and made["points"] == 20_000 and made["failed"] is False
    assert made["milliseconds"].keys() == {"compute", "points"} and made["ratio"] > 0


@pytest.mark.gl
def test_a_tolerance_of_ones_own_is_that_of_the_twin(small):
    """The hook that tries other soft depths reaches the rasteriser: with 1/4 it draws the twin's picture with 1/4, and not
    that with the usual tolerance."""
    from model.project import SoftZ
    from viewer.bench import twin64
    from viewer.render.context import create_context

    _, scene = small
    context = create_context()
    renderer, camera = approximations.BenchRenderer(context, scene, device="cpu"), views.named_views(scene, SIZE)[1]
    plain = renderer.render(camera, approximations.EXACT).image("filled").copy()
    renderer.soft = 1 / 4
    other = renderer.render(camera, approximations.EXACT).image("filled").copy()
    patch = pytest.MonkeyPatch()
    patch.setattr("model.project.SoftZ.preset", lambda name, spacing, metre, **_: SoftZ(1 / 4, spacing, linear=True))
    try:
        twin = twin64.twin_frame(scene, camera, approximations.EXACT, 1.0)[0].astype(int)
    finally:
        patch.undo()
    usual = twin64.twin_frame(scene, camera, approximations.EXACT, 1.0)[0].astype(int)
    gap = {(a, b): (np.abs(made[..., :3] - truth) > 1).mean()  # more than rounding
           for a, made in (("1/4", other), ("usual", plain)) for b, truth in (("1/4", twin), ("usual", usual))}
    assert gap["1/4", "1/4"] < 0.01 and gap["usual", "usual"] < 0.01, gap
    assert gap["1/4", "usual"] > 0.02 and gap["usual", "1/4"] > 0.02, gap
    renderer.release()
    context.release()


# the command line

@pytest.mark.parametrize(("arguments", "said"), [
    (("frame", "--procedural", "many"), "--procedural 'many': expected a whole number of points"),
    (("frame", "--procedural", "0.5"), "expected a whole number of points"),
    (("scale", "--points", "1M,,2M"), "--points ''"),
    (("frame", "--size", "64"), "--size '64': expected WIDTHxHEIGHT"),
    (("frame", "a.laz", "--procedural", "1M"), "give one or the other"),
    (("grid", "a.laz"), "a.laz: `bench grid` makes its own points"),
    (("frame", "--repeats", "0"), "--repeats 0: expected at least 1"),
    (("open", "--procedural", "1M", "--rooms", "0"), "--rooms 0: expected at least 1"),
    (("open", "--json", "/nowhere/at/all/x.json"), "/nowhere/at/all/x.json: no such folder"),
    (("open", "missing.laz"), "missing.laz: no such file"),
])
def test_bad_usage_is_one_line(arguments, said, capsys):
    assert run("bench", *arguments) == 2
    out = capsys.readouterr().err
    assert said in out and out.count("\n") == 1


def test_stability_is_registered(monkeypatch, capsys, tmp_path):
    """Its module is loaded only then; here it is replaced."""
    import types

    called = {}
    stability = types.ModuleType("viewer.bench.stability")

    def run_stability(size, seed, plot):
        called["stability"] = (size, seed, plot)
        return {"rows": [{"name": "depth", "value": 3.0, "limit": 1.0, "ok": False}], "failed": ["depth"]}

    stability.run_stability = run_stability  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "viewer.bench.stability", stability)
    assert run("bench", "stability", "--size", "64x48", "--seed", "7", "--json", tmp_path / "s.json") == 1
    assert called["stability"] == ((64, 48), 7, None) and "ABOVE ITS LIMIT" in capsys.readouterr().out
    assert json.loads((tmp_path / "s.json").read_text())["failed"] == ["depth"]


@pytest.mark.parametrize("rooms", [1, 4])
def test_occlusion_walks_through_its_rooms(rooms, capsys, tmp_path):
    found, drawn = tmp_path / "occlusion.json", tmp_path / "occlusion.png"
    options = ("--rooms", rooms, "--points", "100k", "--frames", "6", "--size", "64x48", "--json", found, "--plot", drawn)
    status = run("bench", "occlusion", *options)
    result, said = json.loads(found.read_text()), capsys.readouterr().out
    assert result["points"] == 100_000 and result["rooms"] == rooms and len(result["rows"]) == 6 and result["jump"] == 4
    assert bool(status) == result["failed"] == (max(row["wrong"] for row in result["rows"]) >= result["limit"])
    assert f"{100 * result['wrong_worst']:.4f} % (limit 0.1 %)" in said and len(said.splitlines()) < 20
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_every_kind_has_its_help(capsys):
    with pytest.raises(SystemExit):
        run("bench", "--help")
    said = " ".join(capsys.readouterr().out.split())
    assert all(f"{name}: {kind.text}" in said for name, kind in KINDS.items())


def test_facts_name_machine_driver_versions_scan_and_size():
    machine = {"processor": "P", "cores": 3, "gpu": {"name": "G", "cuda": "13"}, "versions": {"torch": "2", "x": None}}
    result = {"machine": machine,
              "opengl": "soft", "driver": "9.9", "scans": ["/some/where/a.laz"], "size": [64, 48]}
    said = described(result)
    assert all(part in said for part in ("P, 3 cores", "G, CUDA 13", "soft (9.9)", "torch 2", "a.laz", "64x48"))
    assert "/some/where" not in said and Subject(procedural=ProceduralScan(10, 1)).names == [
        "procedural scan, 10 points, 1 rooms, seed 1"]
