"""Networks, weights and inference: shapes, files, precision."""

import json
from functools import reduce

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from PIL import Image, ImageDraw, ImageFont
from rooms import make_room
from safetensors.torch import save_file
from untyped import any_typed

from pointglass.model.common.errors import DataError
from pointglass.model.data.stations import ScanModel, load_scene, scan_stations
from pointglass.model.evaluation.metrics.image_metrics import psnr, psnr_after_gain, ssim
from pointglass.model.evaluation.report import format_table
from pointglass.model.evaluation.room_scores import evaluate
from pointglass.model.network.network_layout import BACKGROUND, CLOSED, NOISE_SCALE, PACKED_IN
from pointglass.model.network.reconstruct import FLIPS, Reconstructor, covered, fast_precision, fitting_weights
from pointglass.model.network.unet import (
    FILLED_WEIGHT,
    INPUT_CHANNELS,
    KEPT_DEVIATIONS,
    CompactUNet,
    PaperUNet,
    Size,
    mac_per_pixel,
    make_network,
    without_mesh,
)
from pointglass.model.network.weights import FORMAT, WeightsError, load_weights, save_weights
from pointglass.model.network.weights_folder import shipped, weights_dir


@pytest.mark.parametrize("size", [(1, 1), (31, 17), (64, 48)])
def test_an_untrained_network_returns_the_filled_picture_at_any_size(size):
    x = torch.rand(2, 6, *size)
    made = CompactUNet(Size((8, 8, 16), 1)).eval()(x)
    assert torch.equal(made[:, :3], x[:, :3]) and torch.equal(made[:, 3:], torch.ones(2, 1, *size))


def test_the_papers_network_is_the_papers():
    network = PaperUNet()
    assert sum(p.numel() for p in network.parameters()) == 31_038_915
    assert mac_per_pixel(PaperUNet(8)) > 0 and mac_per_pixel(network, 32) == 736_256
    assert PaperUNet(4).eval()(torch.rand(1, 6, 33, 50)).shape == (1, 3, 33, 50)


def test_weights_come_back_as_written(tmp_path):
    network = make_network("fast")
    path = tmp_path / "w.safetensors"
    save_weights(path, network, "fast", filtered=True, notes={"step": 3})
    again, header = load_weights(path)
    assert header["quality"] == "fast" and json.loads(header["notes"]) == {"step": 3}
    for (name, a), b in zip(network.state_dict().items(), again.state_dict().values(), strict=True):
        assert torch.equal(a.half().float(), b), name
    assert not list(tmp_path.glob("*.partial")) and path.stat().st_mode & 0o777 == 0o644, "anybody may read them"
    assert fitting_weights("best", filtered=True, weights=path)[0] == path
    with pytest.raises(WeightsError, match=r"made for filtered input, this picture's is unfiltered; .*a filter"):
        fitting_weights("fast", filtered=False, weights=path)


def _bad_weights(folder):
    good = {k: v.half() for k, v in make_network("fast").state_dict().items()}
    header = {"format": FORMAT, "quality": "fast"}
    save_file({"a": torch.zeros(2)}, str(folder / "foreign.safetensors"))
    save_file({"a": torch.zeros(2)}, str(folder / "names.safetensors"), header)
    save_file({**good, "head.bias": torch.zeros(5)}, str(folder / "shape.safetensors"), header)
    save_file({**good, "head.bias": torch.full_like(good["head.bias"], float("nan"))}, str(folder / "nan.safetensors"), header)
    for name, kind in (("whole", torch.int16), ("complex", torch.complex64)):
        save_file({**good, "head.bias": good["head.bias"].to(kind)}, str(folder / f"{name}.safetensors"), header)
    save_file(good, str(folder / "size.safetensors"), {**header, "quality": "enormous"})
    (folder / "text.safetensors").write_text("not weights")
    (folder / "empty.safetensors").write_bytes(b"")


@pytest.mark.parametrize("name, message", [
    ("foreign", "not pointglass weights"), ("names", "the tensors are not those"), ("shape", "another shape"),
    ("nan", "not finite"), ("size", "unknown network"), ("text", "cannot be read"), ("empty", "cannot be read"),
    ("missing", "no such weights"), ("whole", "has type I16, not F16"), ("complex", "has type C64"),
])
def test_bad_weights_are_refused_by_name(tmp_path, name, message):
    _bad_weights(tmp_path)
    with pytest.raises(WeightsError, match=message) as caught:
        load_weights(tmp_path / f"{name}.safetensors")
    assert name in str(caught.value) and "\n" not in str(caught.value)


def test_shipped_weights_load_and_improve_on_nothing_silently():
    assert "balanced-filtered" in shipped()
    for name in shipped():
        network, header = load_weights(weights_dir() / f"{name}.safetensors")
        assert name == f"{header['quality']}-{header['input']}"
        assert network(torch.rand(1, 6, 40, 30)).isfinite().all()


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
@pytest.mark.parametrize("kind", ["random", "empty", "full", "checkerboard", "single point", "extreme"])
def test_inference_is_finite_in_range_and_close_to_fp32(precision, kind):
    rng = np.random.default_rng(1)
    packed = np.zeros((50, 70, 8), np.float16)
    packed[..., :3] = rng.random((50, 70, 3))
    packed[..., 3] = {"empty": 0.0, "full": 1.0, "checkerboard": np.indices((50, 70)).sum(0) % 2}.get(
        kind, rng.random((50, 70)) < 0.3)
    packed[..., 4] = 2.0 if kind == "extreme" else rng.uniform(-1, 1, (50, 70))
    if kind == "empty":
        packed[:] = 0
    if kind == "single point":
        packed[:] = 0
        packed[20, 30, :4] = 1
    made, exact = (Reconstructor("balanced", filtered=True, device="cpu", precision=p)(torch.from_numpy(packed))
                   for p in (precision, "fp32"))
    assert made.shape == (50, 70, 4) and made.dtype == torch.float16
    assert made.isfinite().all() and made.min() >= 0 and made.max() <= 1
    assert (made.float() - exact.float()).abs().max() <= (0 if precision == "fp32" else 0.12)
    assert (made.float() - exact.float()).abs().mean() <= 0.01


def test_an_enclosed_direction_is_never_background():
    rng = np.random.default_rng(2)
    packed = torch.from_numpy(rng.random((40, 60, 8)).astype(np.float16))
    packed[..., CLOSED] = 0
    packed[:, 30:, CLOSED] = 1
    network = Reconstructor("balanced", filtered=True, device="cpu", precision="fp32")
    with torch.no_grad():
        network.network.head.bias[-4:] = -0.6  # a network that predicts no coverage
    made = network(packed)
    assert (made[:, 30:, 3] == 1).all() and made[:, :30, 3].max() < 1


@pytest.mark.parametrize("quality", ["fast", "balanced"])
def test_leaving_out_background_changes_no_visible_pixel(quality, seed):
    rng = np.random.default_rng(seed)
    packed = torch.from_numpy(rng.random((333, 460, 8)).astype(np.float16))
    packed[..., CLOSED] = 0
    top, left = (int(v) for v in rng.integers(0, 250, 2))
    shown = torch.zeros(333, 460, dtype=torch.bool)
    shown[top : top + int(rng.integers(1, 60)), left : left + int(rng.integers(1, 60))] = True
    packed[..., BACKGROUND] = (~shown).half()
    network = Reconstructor(quality, filtered=True, device="cpu", precision="fp32")
    cut, whole = network(packed), network.made(packed)
    assert (cut == 0).all(2).float().mean() > 0.2, f"seed {seed}: nothing was left out"
    assert (cut - whole)[shown].abs().max() <= 1e-3, f"seed {seed}"  # half precision: one step below 1 is 5e-4
    packed[..., BACKGROUND] = 1
    rows, columns = covered(packed[..., BACKGROUND], network.network.reach, network.network.multiple)
    assert packed[rows, columns].numel() == 0 and not network(packed).any()


def test_the_receptive_field_is_at_most_the_reach():
    torch.manual_seed(4)
    for quality in ("fast", "balanced"):
        network = make_network(quality)
        for parameter in network.parameters():
            torch.nn.init.normal_(parameter, 0.0, 0.05)
        for at in ((200, 208), (207, 199)):
            x = torch.rand(1, INPUT_CHANNELS, 400, 400, requires_grad=True)
            network(x)[0, :, at[0], at[1]].sum().backward()
            assert x.grad is not None
            reached = torch.nonzero(x.grad[0].abs().amax(0))
            assert (reached - torch.tensor(at)).abs().max() <= any_typed(network.reach), quality


def test_a_missing_quality_names_the_shipped_weights():
    missing = next(q for q in ("paper", "balanced") if f"{q}-unfiltered" not in shipped())
    with pytest.raises(WeightsError, match=f"no weights are shipped for quality '{missing}'"):
        Reconstructor(missing, filtered=False, device="cpu")
    assert fast_precision("cuda") == "fp16" and fast_precision("cpu") in ("bf16", "fp32")


def test_scans_of_a_room_keep_its_geometry_and_mean_exposure(tmp_path):
    scene = load_scene(make_room(tmp_path / "box"))
    clean = ScanModel(0, 0, 0, 0, 0, 0, 0, 0)
    scan = scan_stations(scene, 1, clean)
    assert len(scan.xyz) == 2 * 6 * 48 * 48
    on_wall = np.abs(np.abs(scan.xyz) / (2.0, 1.5, 2.5) - 1).min(axis=1)
    assert on_wall.max() < 2e-3
    spoiled = scan_stations(scene, 1, ScanModel(white_balance=0, dropout=0, colour_noise=0))
    gains = [spoiled.rgb[spoiled.station == s].astype(float).mean() / scan.rgb[scan.station == s].astype(float).mean()
             for s in (0, 1)]
    assert abs(np.mean(gains) - 1) < 0.01 and abs(gains[0] - gains[1]) > 0.001


def test_a_room_with_missing_truncated_or_mismatched_files_is_refused_naming_ten(tmp_path):
    folder = make_room(tmp_path / "box")
    (folder / "v2.png").unlink()
    whole = (folder / "v1.png").read_bytes()
    (folder / "v1.png").write_bytes(whole[: len(whole) // 2])
    Image.open(folder / "v3.depth.png").crop((0, 0, 20, 20)).save(folder / "v3.depth.png")
    with pytest.raises(DataError, match=r"3 pictures .*v1\.png cannot be read.*v2\.png is missing.*v3\.depth\.png has 20x20"):
        load_scene(folder)
    for face in range(6):
        for name in (f"s0f{face}.png", f"s1f{face}.png"):
            (folder / name).write_text("no picture")
    with pytest.raises(DataError, match="15 pictures") as caught:
        load_scene(folder)
    assert str(caught.value).count(".png ") == 10 and "\n" not in str(caught.value)
    with pytest.raises(DataError, match=r"no scene\.json"):
        load_scene(tmp_path)


def test_evaluation_has_a_row_for_each_method_and_density(tmp_path):
    folder = make_room(tmp_path / "box")
    result = evaluate(folder, densities=(1.0, 0.3), weights={"balanced": weights_dir() / "balanced-filtered.safetensors"})
    methods = {r["method"] for r in result["rows"]}
    assert {"raw", "pull-push, our filter", "pull-push, true visibility", "network balanced"} <= methods
    assert len(result["rows"]) == 2 * len(methods) and "PSNR" in format_table(result)
    json.dumps(result)


def test_metrics_of_equal_brighter_and_noisy_pictures():
    a = torch.rand(3, 40, 40)
    assert psnr(a, a) == float("inf") and ssim(a, a) == pytest.approx(1.0)
    assert psnr(a, a + 0.1) == pytest.approx(20.0, abs=1e-4)
    assert psnr_after_gain(a * 0.8, a) > 100 > psnr(a * 0.8, a)
    assert ssim(a, torch.rand(3, 40, 40)) < 0.2


@pytest.mark.parametrize("block", [1, 2, 4])
def test_what_the_corners_of_all_blocks_differ_by_leaves_no_pattern(block):
    """A head that is lighter in one corner of every block than in the next: a grating of a few pixels over the picture."""
    torch.manual_seed(3)
    network, x = CompactUNet(Size((8, 8), 1, block)).eval(), torch.rand(1, 6, 60, 44)  # the last squares lie beyond the border
    plain = network(x)
    with torch.no_grad():
        any_typed(network.head.bias)[: block**2] += torch.linspace(-0.2, 0.2, block**2) if block > 1 else 0.1
    assert torch.allclose(network(x), plain, atol=1e-5)


@torch.inference_mode()
def test_blends_have_no_mesh_of_blocks_either():
    """Shares that are larger in one corner of every block than in the next blend like their mean."""
    torch.manual_seed(4)
    network, x, made = make_network("fast").eval(), torch.rand(1, 6, 48, 64), []
    assert isinstance(network, CompactUNet)
    for corners in ((0.5, 0.5, 0.5, 0.5), (0.2, 0.4, 0.6, 0.8)):
        any_typed(network.head.bias)[4:8] = torch.tensor(corners)
        made.append(network(x)[:, :3])
    assert torch.allclose(*(picture[..., 2:-2, 2:-2] for picture in made), atol=1e-5)
    assert (made[0] - x[:, :3]).abs().max() > 0.1


def test_what_changes_from_pixel_to_pixel_is_taken_from_the_light_and_little_else():
    kernel = make_network("fast").get_buffer("half_band")
    y, x = torch.meshgrid(torch.arange(40.0), torch.arange(50.0), indexing="ij")
    slowly = torch.cos(2 * torch.pi * (x + 2 * y) / 60)
    for mesh in ((-1) ** x, (-1) ** y, (-1) ** (x + y)):
        left = without_mesh((slowly * mesh)[None, None], kernel)
        assert left[..., 2:-2, 2:-2].abs().max() < 0.03 and left.abs().max() < 1.0
    edges = 0.3 + torch.cos(2 * torch.pi * x / 8)
    assert (without_mesh(edges[None, None], kernel)[..., 2:-2] - edges[:, 2:-2]).abs().max() < 0.06


@torch.inference_mode()
def test_the_light_is_corrected_where_something_is_to_be_seen_and_not_where_points_stray(seed):
    """Whatever the network wants: a wall whose points vary keeps its noise and gets none of the network's own."""
    generator = torch.Generator().manual_seed(seed)
    network = CompactUNet(Size((8, 8), 1)).eval()
    guide = torch.zeros(1, 6, 96, 96)
    guide[:, 0] = torch.nn.functional.avg_pool2d(torch.randn(1, 1, 98, 98, generator=generator), 3, 1)[0]

    def change(wall: torch.Tensor) -> torch.Tensor:
        x = torch.cat([wall.expand(1, 3, 96, 96), torch.ones(1, 3, 96, 96)], 1)  # noise level 1: no bound of measured pixels
        return (network._blend(x, guide)[:, :3] - x[:, :3])[..., 8:-8, 8:-8]

    noise = 0.02 * torch.randn(1, 1, 96, 96, generator=generator)
    assert change(0.5 + noise).std() < 0.1 * 0.02
    assert change(torch.full((1, 1, 96, 96), 0.5)).abs().max() < 0.002
    stripes = 0.3 * (torch.arange(96) // 6 % 2).float().expand(1, 1, 96, 96)
    assert change(0.3 + stripes + noise).std() > 0.03


@pytest.mark.parametrize("level", [0.0, 0.2])
def test_a_measurement_with_which_its_neighbours_agree_stays_whatever_the_network_wants(level, seed):
    """Measured pixels change by their noise and by their difference from the 3x3 blur at most, filled ones by any amount."""
    generator = torch.Generator().manual_seed(seed)
    network, size = CompactUNet(Size((8, 8), 1)).eval(), (1, 1, 64, 64)
    guide = torch.rand(1, 6, 64, 64, generator=generator) * 2 - 0.5
    measured = torch.where(torch.rand(size, generator=generator) < 0.7, torch.rand(size, generator=generator), 0.0)
    picture = torch.rand(1, 3, 64, 64, generator=generator)
    picture[..., :32] = 0.5 + 0.01 * picture[..., :32]
    x = torch.cat([picture, measured, torch.zeros(size), torch.full(size, level)], 1)
    changed = (network._blend(x, guide)[:, :3] - picture).abs()
    weight = measured * (1 - FILLED_WEIGHT) + FILLED_WEIGHT
    sums = F.pad(torch.cat([picture * weight, weight], 1), (1, 1, 1, 1), mode="replicate")
    taps = [(i, j, (1 + i % 2) * (1 + j % 2)) for i in range(3) for j in range(3)]
    near = torch.stack([tap * sums[..., i : i + 64, j : j + 64] for i, j, tap in taps]).sum(0)
    bound = KEPT_DEVIATIONS * level / NOISE_SCALE + (picture - near[:, :3] / near[:, 3:]).abs()
    kept = (measured > 0).expand_as(picture)
    assert (changed - bound / measured.clamp_min(1e-3))[kept].max() < 1e-5
    assert (changed > bound + 1e-3)[~kept].any()


@pytest.mark.parametrize("quality", ["fast", "balanced"])
@torch.inference_mode()
def test_trained_network_tells_faint_lettering_from_noise_by_the_noise_level(quality, seed):
    """No bound forbids the blends to smooth anything: faint structure is kept because of the noise level input."""
    generator = torch.Generator().manual_seed(seed)
    network, _ = load_weights(weights_dir() / f"{quality}-filtered.safetensors")
    sign = Image.new("L", (160, 96))
    for height, row in ((14, 4), (20, 26), (32, 54)):
        ImageDraw.Draw(sign).text((8, row), "Pump 27-B", fill=255, font=ImageFont.load_default(height))
    letters = torch.from_numpy(np.asarray(sign, np.float32) / 255)[None, None]

    def made(contrast: float, noise: float) -> torch.Tensor:
        wall = 0.4 + contrast * letters + noise * torch.randn(letters.shape, generator=generator)
        ones = torch.ones_like(wall)
        return network(torch.cat([wall.expand(-1, 3, -1, -1), ones, 0 * ones, NOISE_SCALE * noise * ones], 1))[0, 1]

    def kept(contrast: float, noise: float) -> float:
        """Share of the contrast of the letters that is left: slope of the picture on the truth."""
        true, picture = letters[0, 0] - letters.mean(), made(contrast, noise)
        return float((true * (picture - picture.mean())).sum() / (contrast * true.square().sum()))

    assert kept(0.06, 0.004) > 0.45 and kept(0.3, 0.004) > 0.8, "lettering far above the noise is kept"
    assert kept(0.3, 0.05) > 0.35, "and so is lettering of six times the noise"
    assert made(0.0, 0.05).std() < 0.25 * 0.05, "noise alone is removed"


@torch.inference_mode()
def test_best_is_the_mean_of_the_balanced_networks_mirrored_pictures(seed):
    """Each flip of the input, flipped back, with background left out and coverage bounded as for one."""
    rng = np.random.default_rng(seed)
    packed = torch.from_numpy(rng.random((40, 56, PACKED_IN), np.float32)).half()
    packed[..., CLOSED:] = 0.0
    best, one = (Reconstructor(quality, filtered=True, device="cpu", precision="fp32") for quality in ("best", "balanced"))
    wanted = reduce(torch.add, (one(packed.flip(axes).contiguous()).flip(axes).float() for axes in FLIPS)) / len(FLIPS)
    assert torch.equal(best(packed), wanted.half()) and len(set(FLIPS)) == 4
    assert "4 mirrored pictures" in best.name and best.name.split()[1] == one.name.split()[1]
    mirrored = best(packed.flip((1,)).contiguous()).flip((1,))
    assert (best(packed).float() - mirrored.float()).abs().max() < 2e-3, "which side is left no longer matters"


def test_a_network_is_interrupted_between_its_layers_and_unharmed(seed):
    """From the first layer that finds its picture needless on, nothing runs; the next picture is as always."""
    from pointglass.model.network.interruption import Interrupted, interruptible
    from pointglass.model.network.network_layout import PACKED_IN
    from pointglass.model.network.reconstruct import Reconstructor

    network = Reconstructor("fast", filtered=True, device="cpu", precision="fp32")
    packed = torch.from_numpy(np.random.default_rng(seed).random((32, 48, PACKED_IN)).astype(np.float16))
    expected, asked = network(packed), []

    def needless():
        asked.append(1)
        return len(asked) == 4

    with pytest.raises(Interrupted), interruptible(needless):
        network(packed)
    assert len(asked) == 4 and torch.equal(network(packed), expected)
