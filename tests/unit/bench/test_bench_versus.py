"""`bench versus`: the opponents get what their programs feed them, and are drawn, timed and judged fair."""

import numpy as np
import pytest
from bench_run import COMMON, SIZE, four_rooms, made_by

from pointglass.viewer.bench import opponents
from pointglass.viewer.bench.cases import versus
from pointglass.viewer.work.places import viewpoints as views


@pytest.fixture(scope="module")
def small():
    return four_rooms()


def test_the_paper_gets_what_its_program_feeds_it():
    import torch

    depth = torch.tensor([[2.0, torch.inf], [6.0, 3.0]])
    colour = torch.tensor([[[255, 0, 51, 255]] * 2] * 2, dtype=torch.uint8)
    made = opponents.paper_input(colour, depth, torch.tensor([[True, False], [False, True]]))
    assert made.shape == (1, 5, 2, 2)
    assert torch.allclose(made[0, :3, 0, 0], torch.tensor([1.0, 0.0, 0.2]))
    assert made[0, 3].tolist() == [[1, 0], [0, 1]] and torch.allclose(made[0, 4], torch.tensor([[0.0, -1.0], [1.0, 0.25]]))
    empty = opponents.paper_input(colour, torch.full((2, 2), torch.inf), torch.zeros(2, 2, dtype=torch.bool))
    assert torch.isfinite(empty).all() and (empty[0, 4] == -1).all()


def test_the_papers_network_is_whole_and_its_picture_that_of_the_network():
    import torch

    from pointglass.model.network.unet import PaperUNet

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
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.renderer import Renderer

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


@pytest.mark.gl
def test_bench_versus(tmp_path, monkeypatch, capsys):
    def absent():
        raise opponents.Open3DError("Open3D is not installed here")

    monkeypatch.setattr(opponents, "Open3DPoints", absent)
    rates = []
    monkeypatch.setattr(versus, "matmul_rate", lambda *a: rates.append("matmul") or 1e12)
    monkeypatch.setattr(versus, "conv_rate", lambda *a: rates.append("convolution") or 1e12)
    made = made_by("versus", tmp_path, "--frames", "2", "--repeats", "1", "--device", "cpu")
    assert made.keys() >= COMMON | {"runs", "note", "open3d", "frames", "device"} and rates == ["matmul", "convolution"] * 2
    assert made["open3d"] == "Open3D is not installed here" and "Open3D is not installed here" in capsys.readouterr().out
    (held,) = made["runs"]
    assert set(held["contenders"]) == {"ours, balanced", "ours, fast", versus.PAPER}
    assert set(held["contenders"][versus.PAPER]["milliseconds"]) == {*opponents.COUNTED, *opponents.LEFT_OUT, "total"}
    assert "31,038,915" in held["contenders"][versus.PAPER]["network"]
    assert held["ratios"]["ours, fast"][versus.PAPER] > 0 and held["fairness"]["needed"] == versus.FAIR


def test_matrix_rates_are_measured():
    import torch

    from pointglass.viewer.bench.matrix_rate import conv_rate, matmul_rate

    assert matmul_rate("cpu", torch.float32, side=64, seconds=0.0) > 1e6
    assert conv_rate("cpu", torch.float32, (16, 12), seconds=0.0) > 1e5


def test_fairness_and_ratios():
    from pointglass.model.network.unet import PaperUNet, mac_per_pixel

    work = 2 * mac_per_pixel(PaperUNet(), 32) * 960 * 720
    fair = versus.fairness(1000.0, (960, 720), {"matmul": 2.5 * work, "convolution": 2 * work})
    assert fair["fair"] and fair["share_of_matmul"] == pytest.approx(0.4) and fair["share_of_convolution"] == pytest.approx(0.5)
    assert not versus.fairness(1001.0, (960, 720), {"matmul": 2.5 * work, "convolution": work})["fair"]
    assert not fair["busy"] and versus.fairness(1.0, (960, 720), {"matmul": work, "convolution": work})["busy"]
    assert fair["mac_per_pixel"] == pytest.approx(736_256, rel=1e-3)
    held = {name: {"milliseconds": {"total": {"p50": ms}}} for name, ms in (("ours, fast", 20.0), (versus.PAPER, 90.0))}
    assert versus.ratios(held) == {"ours, fast": {versus.PAPER: 4.5}}
