"""Which parts of the network earn their place: variants trained alike and judged alike, one row each for the model card.

``python -m model.ablation --pairs DIR... --validation DIR --out F.json`` trains every variant from nothing on the same
crops for the same steps, and judges it on validation pairs that have neighbours: PSNR, perceptual distance, change between
neighbouring cameras, gradient energy against the truth's, MAC a pixel and measured milliseconds.  Short runs rank what
learns quickly; they say little about what a long run would reach.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from model.data.crops import Crops, PairFolder
from model.folders import replace_text
from model.metrics import gradient_energy, psnr
from model.objective import Objective, inside_flow, warp
from model.project import DEPTH_FEATURE_SCALE
from model.unet import BLENDS, FILLED_WEIGHT, SIZES, CompactUNet, Size, local_mean, mac_per_pixel

FAST = SIZES["fast"]


class _Fed(CompactUNet):
    """The compact network behind a change of what it is fed.  ``change``: (B, 5, H, W) -> the same shape."""

    def __init__(self, size: Size, change: Callable[[Tensor], Tensor]):
        super().__init__(size)
        self.change = change

    def forward(self, x: Tensor) -> Tensor:
        guide = self._trunk(self.change(x).to(self.stem.weight.dtype)).to(x.dtype)
        with torch.autocast(x.device.type, enabled=False):
            return self._blend(x, guide)


class _Plain(CompactUNet):
    """A residual U-Net: filled picture plus correction, no blends."""

    def _blend(self, x: Tensor, guide: Tensor) -> Tensor:
        return torch.cat([x[:, :3] + guide[:, :3], 1.0 + guide[:, -1:]], 1)


class _Free(CompactUNet):
    """The correction is free in colour and size, and the blends may overshoot."""

    def __init__(self, size: Size):
        super().__init__(size)
        self.head = nn.Conv2d(size.widths[0], size.block**2 * (3 + BLENDS + 1), 3, padding=1)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)  # type: ignore[arg-type]

    def _blend(self, x: Tensor, guide: Tensor) -> Tensor:
        picture, weight = x[:, :3], x[:, 3:4] * (1.0 - FILLED_WEIGHT) + FILLED_WEIGHT
        out, sharper = picture + guide[:, :3] - local_mean(guide[:, :3]), picture
        sums, kernel = torch.cat([picture * weight, weight], 1), self.get_buffer("kernel").to(x.dtype)[:4]
        for number in range(BLENDS):
            sums = F.conv2d(F.pad(sums, (2**number,) * 4, mode="replicate"), kernel, dilation=2**number, groups=4)
            smoother = sums[:, :3] / sums[:, 3:]
            out = out + guide[:, 3 + number : 4 + number] * (smoother - sharper)
            sharper = smoother
        return torch.cat([out, 1.0 + guide[:, -1:]], 1)


class _WithMean(CompactUNet):
    """The correction keeps its local mean: it may shift colours."""

    def _blend(self, x: Tensor, guide: Tensor) -> Tensor:
        return super()._blend(x, guide) + F.pad(local_mean(guide[:, :1]).expand(-1, 3, -1, -1), (0, 0, 0, 0, 0, 1))


class _Concatenated(CompactUNet):
    """Skips are concatenated and mixed by a 1x1 convolution instead of added."""

    def __init__(self, size: Size):
        super().__init__(size)
        self.mix = nn.ModuleList(nn.Conv2d(2 * w, w, 1) for w in size.widths[:-1])

    def _trunk(self, x: Tensor) -> Tensor:
        height, width = x.shape[-2:]
        padded = F.pad(x, (0, -width % self.multiple, 0, -height % self.multiple), mode="replicate")
        h, skips = F.relu(self.stem(F.pixel_unshuffle(padded, self.block))), []
        for level, convolutions in enumerate(self.down):
            h = convolutions(h)
            if level < len(self.shrink):
                skips.append(h)
                h = F.relu(self.shrink[level](h))
        for level in range(len(skips) - 1, -1, -1):
            h = F.interpolate(self.grow[level](h), scale_factor=2, mode="nearest")
            h = self.up[level](F.relu(self.mix[level](torch.cat([h, skips[level]], 1))))
        return F.pixel_shuffle(self.head(h), self.block)[..., :height, :width]


class _Gate(nn.Module):
    """A gated convolution (Yu et al. 2019): features times a learned soft mask."""

    def __init__(self, width: int):
        super().__init__()
        self.both = nn.Conv2d(width, 2 * width, 3, padding=1)

    def forward(self, x: Tensor) -> Tensor:
        feature, gate = self.both(x).chunk(2, 1)
        return F.relu(feature) * torch.sigmoid(gate)


class _Gated(CompactUNet):
    """Gated convolutions in place of plain ones."""

    def __init__(self, size: Size):
        super().__init__(size)
        self.down = nn.ModuleList(_Gate(w) for w in size.widths)
        self.up = nn.ModuleList(_Gate(w) for w in size.widths[:-1])


def _no_depth(x: Tensor) -> Tensor:
    return torch.cat([x[:, :4], torch.zeros_like(x[:, 4:])], 1)


def _frame_depth(x: Tensor) -> Tensor:
    """Depth between 0 and 1 over the crop's own range, as the paper does over the frame's."""
    z = torch.exp2(x[:, 4:] / DEPTH_FEATURE_SCALE)
    low, high = z.amin((2, 3), keepdim=True), z.amax((2, 3), keepdim=True)
    return torch.cat([x[:, :4], (z - low) / (high - low).clamp_min(1e-6)], 1)


def _raw_depth(x: Tensor) -> Tensor:
    """Depth itself (in units of one pixel's spacing, as metres are not known to a crop), linear."""
    return torch.cat([x[:, :4], torch.exp2(x[:, 4:] / DEPTH_FEATURE_SCALE) / 4], 1)


def _holes(x: Tensor) -> Tensor:
    """Colour where measured, black in holes: the network must fill by itself (the blends still see the filled picture)."""
    return torch.cat([x[:, :3] * x[:, 3:4], x[:, 3:]], 1)


VARIANTS: dict[str, Callable[[], nn.Module]] = {
    "as shipped (fast size)": lambda: CompactUNet(FAST),
    "no blends: plain residual": lambda: _Plain(FAST),
    "correction free in colour and size": lambda: _Free(FAST),
    "correction keeps its local mean": lambda: _WithMean(FAST),
    "fed holes instead of the filled picture": lambda: _Fed(FAST, _holes),
    "no depth": lambda: _Fed(FAST, _no_depth),
    "depth normalised per frame": lambda: _Fed(FAST, _frame_depth),
    "depth linear": lambda: _Fed(FAST, _raw_depth),
    "skips concatenated": lambda: _Concatenated(FAST),
    "gated convolutions": lambda: _Gated(FAST),
    "no space-to-depth, half the width": lambda: CompactUNet(Size((16, 32, 64, 96, 128), 1, block=1)),
    "narrower and deeper": lambda: CompactUNet(Size((32, 48, 64, 96), 2)),
    "wider and shallower": lambda: CompactUNet(Size((48, 96, 160), 1)),
}


@dataclass(frozen=True)
class Row:
    """Figures of one variant on the validation pairs.  change: mean absolute difference, 0..1, between neighbouring cameras.
    energy: of gradients, as a ratio to the truth's."""

    variant: str
    psnr: float
    distance: float
    change: float
    energy: float
    mac: float
    milliseconds: float


def learn(network: nn.Module, crops: Crops, objective: Objective, steps: int, batch: int, rate: float) -> None:
    """Trains in bf16 with a cosine rate; the same crops for every variant."""
    optimiser = torch.optim.AdamW(network.parameters(), rate, weight_decay=1e-4)
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1, (step + 1) / 50) * (0.02 + 0.49 * (1 + np.cos(np.pi * step / steps)))
        data = crops.batch(step, batch, 2)
        with torch.autocast("cpu", torch.bfloat16):
            made = network(torch.cat([data.x, data.neighbour]))
            loss, _ = objective(made[:batch], made[batch:], data)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()


@torch.no_grad()
def judge(name: str, network: nn.Module, folder: PairFolder, distance: nn.Module | None, count: int) -> Row:
    """Mean figures over ``count`` validation pairs with neighbours, in fp32."""
    assert folder.neighbours is not None and folder.flow is not None
    network.eval()
    figures, times = [], []
    for i in np.linspace(0, len(folder.inputs) - 1, count).astype(int):
        x, near, flow = (torch.from_numpy(np.asarray(a[i]).astype(np.float32))[None]
                         for a in (folder.inputs, folder.neighbours, folder.flow))
        truth = torch.from_numpy(np.asarray(folder.truth[i, :3]).astype(np.float32))[None] / 255
        start = time.perf_counter()
        made = network(x)[:, :3].clamp(0, 1)
        times.append((time.perf_counter() - start) * 1e3)
        beside = network(near)[:, :3].clamp(0, 1)
        steady = inside_flow(flow)
        change = float(((warp(beside, flow) - made).abs() * steady).sum() / (3 * steady.sum()).clamp_min(1))
        gap = float(distance(made, truth)) if distance is not None else float("nan")
        figures.append((psnr(made, truth), gap, change, gradient_energy(made) / gradient_energy(truth)))
    means = np.mean(figures, axis=0).tolist()
    psnr_mean, gap_mean, change_mean, energy_mean = means
    return Row(name, psnr_mean, gap_mean, change_mean, energy_mean, mac_per_pixel(network), float(np.median(times)))


def run(pairs: list[Path], validation: Path, out: Path, *, steps: int, batch: int, crop: int, count: int,
        perceptual: Path | None, only: list[str] | None = None) -> list[Row]:
    """Trains and judges every variant; ``out`` is rewritten after each."""
    objective = Objective(perceptual, 0.1, 0.0, 0.1)
    folder, rows = PairFolder(validation), []
    crops = Crops(pairs, crop, 1)
    rows.append(judge("the filled picture itself", _Same(), folder, objective.distance, count))
    for name, make in VARIANTS.items():
        if only and name not in only:
            continue
        torch.manual_seed(1)
        network = make()
        learn(network, crops, objective, steps, batch, 1e-3)
        rows.append(judge(name, network, folder, objective.distance, count))
        facts = {"steps": steps, "batch": batch, "crop": crop, "validation": str(validation), "distance": objective.name}
        replace_text(out, json.dumps({**facts, "rows": [vars(row) for row in rows]}, indent=1))
        print(format_row(rows[-1]), flush=True)
    return rows


class _Same(nn.Module):
    def forward(self, x: Tensor) -> Tensor:
        return x[:, :3]


def format_row(row: Row) -> str:
    """A row of the model card's table."""
    return (f"| {row.variant} | {row.psnr:.2f} | {row.distance:.3f} | {row.change:.4f} | {row.energy:.2f} | {row.mac:,.0f} "
            f"| {row.milliseconds:.0f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", nargs="+", type=Path, required=True)
    parser.add_argument("--validation", type=Path, required=True, help="pairs made with neighbours")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--perceptual", type=Path)
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--crop", type=int, default=128)
    parser.add_argument("--count", type=int, default=20)
    options = parser.parse_args()
    run(options.pairs, options.validation, options.out, steps=options.steps, batch=options.batch, crop=options.crop,
        count=options.count, perceptual=options.perceptual)


if __name__ == "__main__":
    main()
