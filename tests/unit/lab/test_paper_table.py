"""The paper's table over places to learn from: its columns, which pixels count, and the command that gives it."""

import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scannetpp_files import write_scannetpp
from walls import cast, look, rays_of, straight_view, wall_scan

from pointglass.model.common.errors import DataError
from pointglass.model.data.dataset import MemoryPicture
from pointglass.model.data.images.lens import Lens
from pointglass.model.data.images.photo_place import PhotoPlace
from pointglass.model.evaluation.metrics.image_metrics import ssim
from pointglass.model.evaluation.paper_methods import scaled
from pointglass.model.evaluation.paper_report import format_paper_table
from pointglass.model.evaluation.paper_table import NO_NETWORK, known_ssim, paper_table
from pointglass.model.network.unet import make_network
from pointglass.model.network.weights import save_weights

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture
def scannetpp(tmp_path):
    return write_scannetpp(tmp_path / "root")


def test_scaled_views_keep_every_pixel_on_its_ray():
    lens = Lens("PINHOLE", 150, 80, 70, 70, 77.0, 41.0)
    view = MemoryPicture(cast(rays_of(lens), look(4))[0], 70.0, look(4), centre=(77.0, 41.0))
    for width, height in ((80, 60), (160, 120)):
        made = scaled(view, width, height)
        same = Lens("PINHOLE", width, height, made.fl, made.fl, made.cx, made.cy)
        expected, _ = cast(rays_of(same), look(4))
        assert made.rgb().shape == (height, width, 3) and made.fl == 70 * height / 80
        assert np.abs(made.rgb().astype(int) - expected).mean() < 1


def test_known_ssim_is_the_mean_over_windows_that_hold_a_known_pixel():
    rng = np.random.default_rng(5)
    truth = torch.from_numpy(rng.random((3, 40, 50))).float()
    made = (truth + 0.1 * torch.from_numpy(rng.normal(size=truth.shape)).float()).clamp(0, 1)
    known = torch.zeros(40, 50, dtype=torch.bool)
    known[5:12, 30:44] = True
    mixed = torch.where(known, made, truth)
    windows = [ssim(mixed[:, r : r + 11, c : c + 11], truth[:, r : r + 11, c : c + 11])
               for r in range(30) for c in range(40) if known[r : r + 11, c : c + 11].any()]
    assert known_ssim(made, truth, known) == pytest.approx(np.mean(windows), abs=1e-6)
    assert known_ssim(made, truth, torch.ones_like(known)) == pytest.approx(ssim(made, truth), abs=1e-9)
    assert np.isnan(known_ssim(made, truth, torch.zeros_like(known)))


@pytest.fixture
def small_weights(tmp_path):
    torch.manual_seed(0)
    files = {}
    for name, filtered in (("fast", True), ("fast-unfiltered", False)):
        files[name] = tmp_path / f"{name}.safetensors"
        save_weights(files[name], make_network("fast"), "fast", filtered=filtered)
    return files


@pytest.mark.slow
def test_the_papers_table_has_its_columns_and_sane_figures(small_weights, monkeypatch):
    monkeypatch.setitem(sys.modules, "lpips", None)
    monkeypatch.setitem(sys.modules, "torchmetrics", None)
    place = PhotoPlace("box", wall_scan(80_000), [straight_view(n, 128, 96, 80.0) for n in (0, 3)])
    result = paper_table([place], small_weights, sizes=((96, 72), (48, 36)), precision="fp32", repeats=1)
    rows = {(r["method"], r["width"], r["density"]): r for r in result["rows"]}
    assert set(rows) == {(m, w, d) for m in (NO_NETWORK, "fast", "fast-unfiltered") for w in (96, 48) for d in (1.0, 0.1)}
    for (method, width, density), row in rows.items():
        assert row["views"] == 2 and 20 < row["psnr"] < 60 and 0.2 < row["ssim"] < 1 and row["known"] > 0.95
        assert row["frame_s"] > 0 and row["network_s"] >= 0 and (row["network_s"] > 0) == (method != NO_NETWORK)
        assert np.isnan(row["lpips"]) and np.isnan(row["squeeze"])
        if method == "fast":  # untrained, it returns the filled picture
            assert row["psnr"] == pytest.approx(rows[NO_NETWORK, width, density]["psnr"], abs=0.01)
    assert rows[NO_NETWORK, 96, 1.0]["ssim"] > rows[NO_NETWORK, 96, 0.1]["ssim"]
    text = format_paper_table(result)
    for word in ("PSNR", "LPIPS[0,1]", "LPIPS[-1,1]", "SSIM", "frames/s", "network/s", "96x72", "48x36", "10%", "not available",
                 "only pixels the scan covers", "threads", "16.10", "RTX 4090"):
        assert word in text
    json.dumps(result)


def test_only_known_pixels_count_in_the_papers_table(monkeypatch):
    monkeypatch.setitem(sys.modules, "lpips", None)
    monkeypatch.setitem(sys.modules, "torchmetrics", None)
    view = straight_view(2)
    usable = np.ones((72, 96), bool)
    usable[:, 48:] = False
    spoiled = view.colour.copy()
    spoiled[:, 48:] = 255 - spoiled[:, 48:]
    tables = []
    for colour, trusted in ((view.colour, usable), (spoiled, usable), (spoiled, None)):
        place = PhotoPlace("box", wall_scan(), [replace(view, colour=colour, usable=trusted)])
        result = paper_table([place], {}, sizes=((96, 72),), densities=(1.0,), repeats=1)
        tables.append(result["rows"][0])
    assert tables[0]["psnr"] > 22 and tables[0]["known"] == pytest.approx(0.5, abs=0.02)
    assert tables[0]["psnr"] == tables[1]["psnr"] and tables[1]["psnr"] > tables[2]["psnr"] + 5
    assert tables[1]["ssim"] > tables[2]["ssim"]
    nothing = PhotoPlace("box", wall_scan(), [replace(view, usable=np.zeros((72, 96), bool))])
    empty = paper_table([nothing], {}, sizes=((96, 72),), densities=(1.0,), repeats=1)
    assert empty["skipped"] == 1 and empty["rows"] == [] and "1 pictures left out" in format_paper_table(empty)
    with pytest.raises(DataError, match="at least one true picture"):
        paper_table([], {})


def test_lpips_is_given_in_both_forms(monkeypatch):
    class Fake(torch.nn.Module):
        def __init__(self, net, verbose):
            super().__init__()
            assert net == "alex" and not verbose

        def forward(self, a, b, normalize):
            assert a.min() >= 0 and a.max() <= 1  # the pictures come as 0..1; normalize turns them into -1..1
            return (a - b).abs().mean() * (2 if normalize else 1)

    monkeypatch.setitem(sys.modules, "lpips", SimpleNamespace(LPIPS=Fake))
    place = PhotoPlace("box", wall_scan(), [straight_view(2)])
    result = paper_table([place], {}, sizes=((96, 72),), densities=(1.0,), repeats=1, backbone="alex")
    row = result["rows"][0]
    assert row["lpips"] == pytest.approx(2 * row["lpips_published"], rel=1e-6) and row["lpips"] > 0
    text = format_paper_table(result)
    assert "LPIPS (alex)" in text and f"{row['lpips']:.3f}" in text and f"{row['lpips_published']:.3f}" in text


def test_the_squeezenet_distance_stands_under_its_own_name(shared_data):
    place = PhotoPlace("box", wall_scan(), [straight_view(2)])
    result = paper_table([place], {}, sizes=((96, 72),), densities=(1.0, 0.1), repeats=1,
                         distance_path=shared_data / "perceptual")
    dense, sparse = (row["squeeze"] for row in result["rows"])
    assert 0 < dense < sparse and f"{dense:.3f}" in format_paper_table(result) and "SqueezeNet" in format_paper_table(result)


@pytest.mark.slow
def test_one_command_gives_the_papers_table(scannetpp, tmp_path, capsys, monkeypatch):
    import pointglass.model.evaluation.paper_table as table
    from pointglass.viewer.cli import main

    (scannetpp / "splits" / "nvs_sem_val.txt").write_text("aa11bb22cc\n")
    small = {**(table.paper_table.__kwdefaults__ or {}), "sizes": ((96, 72),), "repeats": 1}
    monkeypatch.setattr(table.paper_table, "__kwdefaults__", small)
    assert main(["evaluate", str(scannetpp), "--paper-table", "--views", "1", "--json", str(tmp_path / "t.json")]) == 0
    said = capsys.readouterr().out
    assert "balanced-filtered" in said and "pull-push" in said and "16.10" in said  # ours above, the published below
    assert (tmp_path / "t.json").is_file()
    assert main(["evaluate", str(scannetpp), "--paper-table", "--split", "nowhere"]) == 2
