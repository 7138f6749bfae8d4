"""The evaluation: figures agree with hand computation, flicker with what a film shows, bad input is named before the work."""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from PIL import Image
from rooms import FACES, _look, _shoot, make_room

import model.evaluation.methods as methods_module
import model.evaluation.scene as scene_module
from model.data.pairs import Projected, project_scan
from model.data.stations import ScanModel, load_scene, scan_stations
from model.data.truth import DataError, MemoryPicture, Scan
from model.depth_filter import keep_mask
from model.evaluation import evaluate, format_table, precision_table, save
from model.evaluation.command import add_arguments, names_of, run
from model.evaluation.figures import Truth
from model.evaluation.flicker import measure_flicker, middle_stretch, reprojection
from model.evaluation.methods import sight, thinned
from model.evaluation.open3d_points import Open3DError, Open3DPoints
from model.evaluation.outside import open_outside, parse_outside
from model.evaluation.precision import scaled_input
from model.evaluation.report import plot
from model.evaluation.scene import matched_colours
from model.exposure import exposures_of, match_exposures
from model.losses import SqueezeDistance
from model.metrics import masked_error, masked_psnr, ssim
from model.unet import CompactUNet, PaperUNet, Size, mac_per_pixel
from model.weights import WeightsError, load_weights, weights_dir

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    """A box with a path of four frames that creeps sideways."""
    folder = make_room(tmp_path_factory.mktemp("rooms") / "box")
    facts = json.loads((folder / "scene.json").read_text())
    facts["path"] = []
    for n in range(4):
        rotation, position = _look(*FACES[0]), np.array([0.0, 0.0, 0.02 * n])
        rgb, depth = _shoot(rotation, position, (36, 48), 40.0)
        Image.fromarray(rgb).save(folder / f"p{n}.png")
        Image.fromarray(np.round(depth * 1000).astype(np.uint16)).save(folder / f"p{n}.depth.png")
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, position
        facts["path"].append({"rgb": f"p{n}.png", "depth": f"p{n}.depth.png", "w": 48, "h": 36, "fl": 40.0,
                              "camera_to_world": pose.tolist()})
    (folder / "scene.json").write_text(json.dumps(facts))
    return folder


@pytest.fixture(scope="module")
def squeeze(tmp_path_factory) -> Path:
    """Files of a SqueezeNet distance with random weights."""
    from scipy.io import savemat

    rng = np.random.default_rng(0)
    taps = [64, 128, 256, 384, 384, 512, 512]
    layers = {"conv1": (3, 3, 3, 64)}
    wide = 64
    for fire, out in zip(range(2, 10), (64, 64, 128, 128, 192, 192, 256, 256), strict=True):
        squeezed = out // 4
        layers |= {f"fire{fire}/squeeze1x1": (1, 1, wide, squeezed), f"fire{fire}/expand1x1": (1, 1, squeezed, out),
                   f"fire{fire}/expand3x3": (3, 3, squeezed, out)}
        wide = 2 * out
    stored = {}
    for name, shape in layers.items():
        cell = np.empty((1, 2), object)
        cell[0, 0] = rng.normal(0, 1.4 / np.sqrt(np.prod(shape[:3])), shape).astype(np.float32)
        cell[0, 1] = rng.normal(0, 0.1, (1, shape[3])).astype(np.float32)
        stored[name] = cell
    folder = tmp_path_factory.mktemp("squeeze")
    savemat(folder / "sqz_notop.mat", stored)
    heads = {f"lin{k}.model.1.weight": torch.rand(1, count, 1, 1, generator=torch.Generator().manual_seed(k))
             for k, count in enumerate(taps)}
    torch.save(heads, folder / "lin_v0.1_squeeze.pth")
    return folder


# One picture against its truth


def test_ssim_is_that_of_a_plain_window():
    generator = torch.Generator().manual_seed(1)
    a = torch.rand(1, 14, 17, generator=generator).double()
    b = (a + 0.2 * torch.rand(1, 14, 17, generator=generator)).clamp(0, 1)
    offsets = np.arange(11) - 5
    one = np.exp(-(offsets**2) / 4.5)
    kernel = np.outer(one, one) / one.sum() ** 2
    values = []
    for y in range(4):
        for x in range(7):
            p, q = (t[0, y : y + 11, x : x + 11].numpy() for t in (a, b))
            mp, mq = (kernel * p).sum(), (kernel * q).sum()
            vp, vq, c = (kernel * p * p).sum() - mp**2, (kernel * q * q).sum() - mq**2, (kernel * p * q).sum() - mp * mq
            values.append((2 * mp * mq + 1e-4) * (2 * c + 9e-4) / ((mp**2 + mq**2 + 1e-4) * (vp + vq + 9e-4)))
    assert ssim(a, b) == pytest.approx(np.mean(values), abs=1e-12)
    assert Truth(b.float().expand(3, -1, -1), None).similarity(a.expand(3, -1, -1)) == pytest.approx(np.mean(values), abs=1e-5)


def test_figures_over_invented_pixels_agree_with_hand_computation():
    truth, made = torch.full((3, 12, 12), 0.5), torch.full((3, 12, 12), 0.5)
    invented = torch.zeros(12, 12, dtype=torch.bool)
    invented[:4, :3] = True
    made[:, :4, :3] += 0.1  # 12 pixels off by 0.1, another that is measured by 0.4
    made[:, 11, 11] += 0.4
    figures = Truth(truth, None).figures(made, invented)
    assert figures.invented_psnr == pytest.approx(20.0, abs=1e-4) and figures.invented_error == pytest.approx(0.1, abs=1e-6)
    assert figures.invented == pytest.approx(12 / 144)
    assert figures.psnr == pytest.approx(-10 * np.log10((12 * 0.01 + 0.16) / 144), abs=1e-4)
    none = torch.zeros(12, 12, dtype=torch.bool)
    assert np.isnan(masked_psnr(made, truth, none)) and np.isnan(masked_error(made, truth, none))
    assert np.isnan(figures.distance)


def test_the_distance_to_a_truth_whose_features_are_kept_is_the_distance(squeeze):
    distance = SqueezeDistance(squeeze).eval()
    generator = torch.Generator().manual_seed(2)
    truth, made = torch.rand(2, 3, 40, 48, generator=generator)
    invented = torch.rand(40, 48, generator=generator) < 0.3
    judge = Truth(truth, distance)
    with torch.inference_mode():
        whole = float(distance(made[None], truth[None]))
        composed = float(distance(torch.where(invented, made, truth)[None], truth[None]))
    figures = judge.figures(made, invented)
    assert figures.distance == pytest.approx(whole, rel=1e-4) and whole > 0
    assert figures.invented_distance == pytest.approx(composed, rel=1e-4) and composed < whole
    assert judge.gap(truth) == pytest.approx(0, abs=1e-6)


# Flicker


def _plane(shift: float, tilt: float = 0.0, size=(60, 80), fl: float = 70.0) -> MemoryPicture:
    """A textured plane z = 3 + tilt x world x, seen along the world's -z by a camera moved along x."""
    pose = np.eye(4)
    pose[0, 3] = shift
    i = np.arange(size[1]) + 0.5
    j = np.arange(size[0]) + 0.5
    ray = (i - size[1] / 2) / fl
    z = np.broadcast_to((3 + tilt * shift) / (1 - tilt * ray), size)
    x, y = shift + ray * z, ((j - size[0] / 2) / fl)[:, None] * z
    colour = np.stack([128 + 60 * np.sin(4 * x), 128 + 60 * np.cos(3 * y), 128 + 60 * np.sin(2 * x + 2 * y)], -1)
    return MemoryPicture(np.rint(colour).astype(np.uint8), fl, pose, z.astype(np.float32))


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_warping_draws_the_next_frame_where_this_one_sees_it(tilt):
    """Bilinear sampling is exact on a picture affine in its pixels, so where each pixel goes can be read off."""
    before, after = _plane(0.0, tilt), _plane(0.15, tilt)
    back = reprojection(before, after)
    j, i = np.mgrid[0:60, 0:80] + 0.5
    assert before.z is not None
    there = (i - 40) / 70 - 0.15 / before.z  # x / z in the moved camera: the plane's z is the same in both
    column = 40 + 70 * there
    expected = np.stack([0.2 + 0.005 * column, 0.8 - 0.01 * j, 0.1 + 0.004 * (column + j)]).astype(np.float32)
    affine = torch.from_numpy(np.stack([0.2 + 0.005 * i, 0.8 - 0.01 * j, 0.1 + 0.004 * (i + j)]).astype(np.float32))
    made = back.warp(affine)
    assert (made - torch.from_numpy(expected))[:, back.valid].abs().max() < 1e-5
    assert torch.equal(back.valid, torch.from_numpy((column >= 0.5) & (column <= 79.5)))
    first, second = (torch.from_numpy(p.rgb()).permute(2, 0, 1) / 255 for p in (before, after))
    assert back.change(first, second) < 0.004 < 0.02 < float((first - second).abs().mean())  # rounding to 8 bits, and texture


def test_what_the_next_frame_does_not_see_is_left_out():
    """A near square before a wall: what it uncovers and covers when the camera moves is compared with nothing."""
    def shot(shift):
        pose = np.eye(4)
        pose[0, 3] = shift
        z = np.full((60, 80), 4.0, np.float32)
        left = round(40 + 70 * (-0.3 - shift) / 2)
        z[20:40, left : left + 20] = 2.0
        return MemoryPicture(np.zeros((60, 80, 3), np.uint8), 70.0, pose, z)

    valid = reprojection(shot(0.0), shot(0.2)).valid
    left = 40 - 10  # of the square now; it moves by 7 pixels, the wall by 3.5
    assert valid[20:40, left + 1 : left + 19].all()
    assert not valid[21:39, left - 3 : left].any()  # the square covers this next
    assert valid[:18, 10:].all() and valid[42:, 10:].all()


def _film():
    return [_plane(0.03 * n) for n in range(4)]


def _rgb(picture):
    return torch.from_numpy(picture.rgb()).permute(2, 0, 1) / 255


def test_flicker_of_truth_is_one_noise_is_more_and_blur_pays_in_gradient():
    generator = torch.Generator().manual_seed(3)

    def draw(shot):
        truth = _rgb(shot)
        return {
            ("same", 1.0): truth, ("noisy", 1.0): truth + 0.05 * torch.randn(truth.shape, generator=generator),
            ("blurred", 1.0): F.avg_pool2d(F.pad(truth[None], (7,) * 4, mode="replicate"), 15, 1)[0],
        }

    rows = {row["method"]: row for row in measure_flicker(_film(), draw)}
    assert set(rows) == {"same", "noisy", "blurred"}
    assert rows["same"]["flicker"] == pytest.approx(1.0) and rows["same"]["gradient"] == pytest.approx(1.0)
    assert rows["noisy"]["flicker"] > 3 and rows["noisy"]["gradient"] > 1.2
    assert rows["blurred"]["gradient"] < 0.95
    assert 0.8 < rows["same"]["valid"] <= 1
    assert middle_stretch(list(range(10)), 4) == [3, 4, 5, 6] and middle_stretch([1, 2], None) == [1, 2]


def test_the_same_points_survive_in_every_frame(room, monkeypatch):
    seeds = []

    def spy(scan, shot, seed=0, *rest, **more):
        seeds.append(seed)
        return project_scan(scan, shot, seed, *rest, **more)

    monkeypatch.setattr(scene_module, "project_scan", spy)
    evaluate(room, densities=(0.3,), views=1, open3d=False)
    assert len(seeds) == 5 and len(set(seeds[1:])) == 1  # one view, four frames
    xyz = np.random.default_rng(1).uniform(-1, 1, (500, 3)) - (0, 0, 4)
    scan = Scan(xyz, np.zeros((500, 3), np.uint8), np.zeros(500, np.uint8))
    here, there = (project_scan(scan, _plane(shift), seed=7) for shift in (0.0, 0.1))
    both = {float(z) for z in here.z} & {float(z) for z in there.z}  # moving sideways keeps a point's depth
    ranks = [{float(z): float(r) for z, r in zip(seen.z, seen.rank, strict=True) if float(z) in both} for seen in (here, there)]
    assert len(both) > 100 and ranks[0] == ranks[1]


# Exposures


def test_matching_undoes_known_gains_and_is_what_opening_does(room):
    scene = load_scene(room)
    clean = scan_stations(scene, 1, ScanModel(0, 0, 0, 0, 0, 0, 0, 0))
    gains = np.array([[1.08], [0.92]])
    dimmed = Scan(clean.xyz, np.clip(np.rint(clean.rgb * gains[clean.station]), 0, 255).astype(np.uint8), clean.station)
    solved = exposures_of(dimmed.xyz, dimmed.rgb, dimmed.station)
    assert solved.matched.all()
    undone = matched_colours(torch.from_numpy(dimmed.rgb), torch.from_numpy(dimmed.station), solved.gains).numpy()
    assert np.array_equal(undone, match_exposures(dimmed.xyz, dimmed.rgb, dimmed.station))
    middling = (clean.rgb > 20).all(1) & (clean.rgb < 220).all(1)
    before, after = (np.abs(rgb[middling].astype(float) - clean.rgb[middling]).mean() for rgb in (dimmed.rgb, undone))
    assert after < 0.35 * before


# The whole


@pytest.fixture(scope="module")
def result(room, squeeze, tmp_path_factory):
    """Everything but Open3D: both exposures, two densities, our network, the paper's (narrow), a method from outside."""
    outside = tmp_path_factory.mktemp("outside")
    scene = load_scene(room)
    for shot in (*scene.views, *scene.path):
        Image.fromarray(shot.rgb()).save(outside / f"{Path(shot.rgb_file).stem}.png")
    torch.manual_seed(1)
    narrow = PaperUNet(4).eval().requires_grad_(False), {"quality": "paper", "input": "filtered"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(methods_module, "load_weights", lambda path: narrow if path.stem == "paper" else load_weights(path))
        return evaluate(
            room, densities=(1.0, 0.3), distance_path=squeeze, exposures=("scanned", "matched"), outside={"oracle": outside},
            weights={"fast": weights_dir() / "fast-filtered.safetensors", "paper": Path("paper.safetensors")},
            open3d=False, views=2,
        )


def test_there_is_a_row_a_method_density_and_exposure(result):
    ours = {"raw", "pull-push, no filter", "pull-push, paper's filter", "pull-push, our filter", "pull-push, true visibility",
            "pull-push, NPBG++'s visibility", "network fast", "network paper"}
    keys = {(r["method"], r["density"], r["exposure"]) for r in result["rows"]}
    assert keys == {(m, d, e) for m in ours for d in (1.0, 0.3) for e in ("scanned", "matched")} | {
        ("oracle", 1.0, "-"), ("oracle", 0.3, "-")}
    assert len(keys) == len(result["rows"])
    assert {(r["method"], r["density"]) for r in result["flicker"]} == {(m, d) for m in (*ours, "oracle") for d in (1.0, 0.3)}
    invented = {r["density"]: set() for r in result["rows"]}
    for row in result["rows"]:
        invented[row["density"]].add(row["invented"])
    assert all(len(values) == 1 for values in invented.values())  # the same pixels for all
    text = format_table(result)
    assert "SqueezeNet distance" in text and "matched: stations' gains" in text and "along 4 frames" in text


def test_invented_pixels_are_those_outside_our_filter(room, result):
    scene = load_scene(room)
    scan = scan_stations(scene, 11)
    share = []
    for number, shot in enumerate((scene.views[0], scene.views[3])):
        left = thinned(project_scan(scan, shot, seed=11 + number), 0.3)
        spacing = scene_module.scan_spacing(scan) / 0.3**0.5
        share.append(float((~keep_mask(sight(left, torch.from_numpy(shot.depth()), spacing).raster.depth)).double().mean()))
    row = next(r for r in result["rows"] if r["density"] == 0.3)
    assert row["invented"] == pytest.approx(np.mean(share)) and row["invented"] > 0.05


def test_time_and_work_are_given_for_every_method(result):
    rows = {(r["method"], r["density"], r["exposure"]): r for r in result["rows"]}
    for (name, _, _), row in rows.items():
        assert (row["ms"] is None) == (name == "oracle") and (row["network_ms"] is not None) == name.startswith("network")
    assert rows["network paper", 1.0, "scanned"]["mac"] == pytest.approx(mac_per_pixel(PaperUNet(4)))
    assert rows["raw", 1.0, "scanned"]["mac"] == 0
    assert rows["network paper", 1.0, "scanned"]["network_ms"] < rows["network paper", 1.0, "scanned"]["ms"]


def test_pictures_left_by_others_are_judged_as_they_are(result):
    for row in (r for r in result["rows"] if r["method"] == "oracle"):
        assert row["psnr"] == row["invented_psnr"] == float("inf")
        assert row["ssim"] == pytest.approx(1) and row["distance"] == pytest.approx(0, abs=1e-6)
    oracle = [r for r in result["flicker"] if r["method"] == "oracle"]
    assert len(oracle) == 2 and all(r["flicker"] == r["gradient"] == pytest.approx(1) for r in oracle)


def test_json_and_plot_are_whole_files(result, tmp_path):
    save(result, tmp_path / "a.json")
    stored = json.loads((tmp_path / "a.json").read_text(), parse_constant=lambda name: pytest.fail(name))
    assert next(r for r in stored["rows"] if r["method"] == "oracle")["psnr"] is None
    plot(result, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert min(image.size) > 300
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.json", "a.png"]
    with pytest.raises(DataError, match=r"a\.gif: the name must end in \.png"):
        plot(result, tmp_path / "a.gif")


# Methods from outside


def test_pictures_missing_or_of_another_size_are_refused_naming_ten(room, tmp_path):
    scene = load_scene(room)
    shots = [scene.views[k % 4] for k in range(4)]
    wide = [SimpleNamespace(rgb_file=f"w{k:02}.jpg", width=48, height=36) for k in range(12)]
    with pytest.raises(DataError) as caught:
        open_outside({"x": tmp_path}, wide, [], [1.0])  # type: ignore[arg-type]
    said = str(caught.value)
    assert "12 pictures" in said and said.count("is missing") == 10 and "and 2 more" in said
    for shot in shots:
        Image.new("RGB", (48, 36)).save(tmp_path / f"{Path(shot.rgb_file).stem}.png")
    assert not open_outside({"x": tmp_path}, shots, scene.path, [1.0, 0.1])[0].path_frames
    (tmp_path / "D10").mkdir()
    with pytest.raises(DataError, match=r"4 pictures.*D10/v0\.png is missing"):
        open_outside({"x": tmp_path}, shots, [], [1.0, 0.1])
    (tmp_path / "D10").rmdir()
    Image.new("RGB", (40, 36)).save(tmp_path / "v1.png")
    (tmp_path / "v2.png").write_bytes((tmp_path / "v0.png").read_bytes()[:60])
    with pytest.raises(DataError, match=r"2 pictures.*v1\.png is 40x36, not 48x36; .*v2\.png cannot be read"):
        open_outside({"x": tmp_path}, shots, [], [1.0])
    for name in ("v1.png", "v2.png", "p0.png"):
        Image.new("RGB", (48, 36)).save(tmp_path / name)
    with pytest.raises(DataError, match=r"3 pictures.*p1\.png is missing"):  # some of the path, not all
        open_outside({"x": tmp_path}, shots, scene.path, [1.0])


def test_a_density_has_a_folder_of_its_own_where_there_is_one(room, tmp_path):
    scene = load_scene(room)
    for name, value in (("D100", 250), ("D30", 30)):
        (tmp_path / name).mkdir()
        Image.new("RGB", (48, 36), (value,) * 3).save(tmp_path / name / "v0.png")
    (outside,) = open_outside({"x": tmp_path}, scene.views[:1], [], [1.0, 0.3])
    assert [round(255 * float(outside.picture(scene.views[0], d).mean())) for d in (1.0, 0.3)] == [250, 30]


@pytest.mark.parametrize("texts, said", [
    (["nerf"], "expected NAME=FOLDER"), (["=x"], "expected NAME=FOLDER"), (["a=x", "a=y"], "given twice"),
])
def test_outside_arguments_are_read_strictly(texts, said):
    with pytest.raises(DataError, match=said):
        parse_outside(texts)
    assert parse_outside(["a=x=y"]) == {"a": Path("x=y")}


@pytest.mark.parametrize("options, said", [
    ({"densities": (1.0, 1.5)}, "density 1.5"), ({"densities": (0.0,)}, "density 0"), ({"densities": ()}, "no density"),
    ({"views": 0}, "0 views"), ({"frames": 1}, "1 frames"), ({"exposures": ("bright",)}, "bright"),
    ({"outside": {"raw": Path(".")}}, "compared already"), ({"outside": {"x": Path("missing")}}, "no such folder"),
])
def test_bad_settings_are_refused_before_the_work(room, monkeypatch, options, said):
    monkeypatch.setattr(scene_module, "scan_stations", lambda *_: pytest.fail("work was begun"))
    with pytest.raises(DataError, match=said) as caught:
        evaluate(room, **options)
    assert "\n" not in str(caught.value)


# Open3D


def test_open3d_draws_points_where_they_belong_or_says_why_not():
    # the third lies behind the second
    xyz = np.array([[0.5, 0.5, 40], [20.5, 0.5, 40], [30.75, 0.75, 60], [0.5, -9.5, 40]], np.float32) / 20
    rgb = np.array([[250, 10, 20], [30, 240, 50], [9, 9, 9], [60, 70, 230]], np.uint8)
    try:
        renderer = Open3DPoints()
    except Open3DError as error:
        assert str(error)
        pytest.skip(f"Open3D cannot draw here: {error}")
    (small, large), spent = renderer.draw(xyz, rgb, (64, 48), 40.0)
    renderer.close()
    assert small.shape == (48, 64, 3) and len(spent) == 2 and min(spent) > 0
    for pixel, colour in (((24, 32), 0), ((24, 52), 1), ((14, 32), 3)):
        assert np.abs(small[pixel].astype(int) - rgb[colour]).max() <= 1
        assert np.abs(large[pixel[0] - 2, pixel[1] + 2].astype(int) - rgb[colour]).max() <= 1
    assert (small.sum(2) > 0).sum() == 3 and (large.sum(2) > 0).sum() == 75


def test_without_open3d_the_table_says_why(room, monkeypatch):
    def broken(*_):
        raise Open3DError("no Vulkan on this planet")

    monkeypatch.setattr(scene_module, "Open3DPoints", broken)
    result = evaluate(room, densities=(0.3,), views=1, flicker=False)
    assert not any(r["method"].startswith("Open3D") for r in result["rows"])
    assert "not in the table: Open3D: no Vulkan on this planet" in format_table(result)


# Half precision


@pytest.fixture(scope="module")
def seen(room) -> tuple[Projected, torch.Tensor, float]:
    scene = load_scene(room)
    scan = scan_stations(scene, 1)
    left = thinned(project_scan(scan, scene.views[0], 1), 0.5)
    return left, _rgb(SimpleNamespace(rgb=lambda: scene.views[0].rgb().copy())), scene_module.scan_spacing(scan) / 0.5**0.5


def _scaled(seen, scale: float):
    points, truth, spacing = seen
    return scaled_input(points, truth, spacing, scale, filtered=True)


@pytest.mark.parametrize("scale, pixels", [(2.0**-10, 0), (2.0**10, 0), (1e-3, 4), (1e3, 4)])
def test_the_unit_of_a_scan_changes_nothing_that_a_network_sees(seen, scale, pixels):
    """To the bit for powers of two; but for rounding ties of the filter and the soft z-buffer for others."""
    metres, other = (_scaled(seen, s).x for s in (1.0, scale))
    differs = (metres - other).abs() > (0 if pixels == 0 else 1e-5)
    assert int(differs.any(0).sum()) <= pixels
    assert metres[4].abs().max() > 0.1


def test_half_precision_is_measured_at_every_scale(seen, tmp_path):
    inputs = [_scaled(seen, scale) for scale in (1e-3, 1.0, 1e3)]
    rows = precision_table(weights_dir() / "fast-filtered.safetensors", inputs)
    assert {(r["precision"], r["scale"]) for r in rows} == {(p, s) for p in ("fp32", "bf16", "fp16") for s in (1e-3, 1.0, 1e3)}
    by = {(r["precision"], r["scale"]): r for r in rows}
    for row in rows:
        assert row["nan"] == 0 and 0 < row["percentile"] <= row["largest"] < 0.1
        assert row["psnr"] == pytest.approx(by["fp32", row["scale"]]["psnr"], abs=0.1)
    assert by["bf16", 1.0]["percentile"] > by["fp32", 1.0]["percentile"]
    with pytest.raises(WeightsError):
        precision_table(tmp_path / "none.safetensors", inputs)


def test_nan_is_counted_not_hidden(seen, monkeypatch):
    class Overflowing(CompactUNet):
        def forward(self, x):
            made = super().forward(x).clone()
            if self.stem.weight.dtype == torch.float16:
                made[:, :, 0, :5] = float("nan")
            return made

    import model.evaluation.precision as precision

    monkeypatch.setattr(precision, "load_weights", lambda path: (Overflowing(Size((8, 8), 1)).eval(), {}))
    rows = {r["precision"]: r for r in precision_table(Path("x.safetensors"), [_scaled(seen, 1.0)])}
    assert rows["fp16"]["nan"] == 15 and rows["bf16"]["nan"] == rows["fp32"]["nan"] == 0
    assert rows["fp16"]["largest"] < 0.01


# The command line's part


def test_the_command_writes_what_was_asked_for(room, squeeze, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(scene_module, "Open3DPoints", lambda: (_ for _ in ()).throw(Open3DError("left out")))
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    files = [str(tmp_path / name) for name in ("r.json", "r.svg")]
    weights = str(weights_dir() / "fast-filtered.safetensors")
    assert run(parser.parse_args([str(room), "--weights", weights, "--densities", "0.5", "--views", "1", "--json", files[0],
                                  "--plot", files[1], "--precision", "--no-flicker", "--exposures", "matched"])) == 0
    out = capsys.readouterr()
    assert "network fast-filtered" in out.out and "against fp32" in out.out and not out.err
    stored = json.loads(Path(files[0]).read_text())
    assert {r["exposure"] for r in stored["rows"]} == {"matched"} and len(stored["precision"]) == 9 and not stored["flicker"]
    assert "<svg" in Path(files[1]).read_text()
    with pytest.raises(DataError, match=r"plot\.gif"):
        run(parser.parse_args([str(room), "--plot", str(tmp_path / "plot.gif")]))
    with pytest.raises(DataError, match="cannot be written"):
        run(parser.parse_args([str(room), "--json", str(tmp_path / "nowhere" / "r.json")]))


def test_weights_of_one_name_are_told_apart_by_folder():
    assert list(names_of([Path("a/w.st"), Path("b/w.st"), Path("b/v.st")])) == ["a/w", "b/w", "v"]
    with pytest.raises(DataError, match="same name"):
        names_of([Path("a/w.st"), Path("a/w.st")])


def test_the_options_load_nothing_heavy():
    code = ("import sys, argparse; from model.evaluation.command import add_arguments;"
            "add_arguments(argparse.ArgumentParser());"
            "sys.exit(', '.join({'torch', 'numpy', 'open3d', 'scipy', 'matplotlib'} & set(sys.modules)) or 0)")
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=60).returncode == 0
