"""The networks under stress, measured: every precision on every kind of picture, against the network in float64.

What is measured is what a frame runs: on a CPU convolutions in that precision and blends in compiled loops.  The float64
network is the plain one of :mod:`model.unet`, without any of that.
Pictures are the network's packed input (see :mod:`model.reconstruct`) as float32 and, rounded, as the half floats that the
renderer hands over: a procedural place at scales from 1e-3 to 1e6, and masks that no scan has.
"""

from collections.abc import Sequence

import numpy as np
import torch

from model.network_layout import CLOSED, PACKED_IN
from model.projection import SoftZ, frame, network_input, pixels
from model.reconstruct import PRECISIONS, Reconstructor, fitting_weights
from model.unet import INPUT_CHANNELS
from model.weights import weights_name
from viewer.bench.stability.exact_claims import exact_view
from viewer.bench.stability.frame_claims import SCALES, row
from viewer.bench.stability.scenes import view_inside, walls

PRECISION_LIMITS = {"fp32": (5e-4, 1.5e-4), "bf16": (0.12, 0.01), "fp16": (0.02, 0.002)}
"""Largest and mean absolute difference from float64, of a picture in 0..1.  A result is stored in half floats, which alone
makes 2.4e-4 of the largest, and nearly all that fp32 has of either."""
NOISE = 0.02
"""Standard deviation of a point's colour that the network is told of the procedural place: a usual one of real scans."""
SCALE_LIMIT = 0.02  # mean difference of a picture from the same place at scale 1; a pixel in thousands changes hands


def masks(seed: int, size: tuple[int, int]) -> dict[str, torch.Tensor]:
    """(H, W, 8) half floats by kind: noise under masks that are empty, full, a checkerboard, one point, shares of trust, and
    extremes."""
    rng = np.random.default_rng(seed)
    width, height = size
    board = (np.indices((height, width)).sum(axis=0) % 2).astype(bool)
    one = np.zeros((height, width), bool)
    one[rng.integers(height), rng.integers(width)] = True
    kinds = {"empty": np.zeros_like(board), "full": np.ones_like(board), "checkerboard": board, "one point": one,
             "random": rng.random((height, width)) < 0.3}
    made = {}
    for name, mask in kinds.items():
        packed = np.zeros((height, width, PACKED_IN), np.float16)
        packed[..., :3] = rng.random((height, width, 3)) if mask.any() else 0
        packed[..., 3] = mask
        packed[..., 4] = rng.uniform(-2, 2, (height, width)) if mask.any() else 0
        made[name] = torch.from_numpy(packed)
    trusted = made["full"].clone()  # of points with weights: how far each pixel is trusted, in steps of 1/255
    trusted[..., 3] = torch.from_numpy(rng.integers(0, 256, (height, width)) / 255.0)
    made["trusted in part"] = trusted
    extreme = np.zeros((height, width, PACKED_IN), np.float16)
    extreme[..., :6] = rng.choice([0.0, 1.0], (height, width, 6)) * [1, 1, 1, 1, 4, 2] - [0, 0, 0, 0, 2, 0]
    return {**made, "extremes": torch.from_numpy(extreme)}


def scaled(seed: int, size: tuple[int, int], scales: Sequence[float] = SCALES) -> dict[float, torch.Tensor]:
    """(H, W, 8) half floats by scale: one view of the procedural place, by model.projection in float32."""
    place, rgb = walls(seed)
    camera = view_inside(seed, size)
    spacing = float(np.sqrt(208.0 / len(place)))  # of the room's own walls; only its changing with the scale matters
    made = {}
    for scale in scales:
        view = torch.from_numpy((exact_view(place, camera) * scale).astype(np.float32))
        x, y, z = view.unbind(1)
        index, inside = pixels(x, y, z, camera)
        soft = SoftZ.preset("auto", spacing * scale, 1.0)
        raster, mask = frame(index, z[inside], torch.from_numpy(rgb)[inside].long(), camera, soft)
        channels = network_input(raster, mask, camera.fx, spacing * scale, NOISE).permute(1, 2, 0)
        made[scale] = torch.nn.functional.pad(channels, (0, PACKED_IN - channels.shape[2])).half()
    return made


@torch.inference_mode()
def in_float64(network: torch.nn.Module, packed: torch.Tensor) -> torch.Tensor:
    """(H, W, 8) -> (H, W, 4) float64, within 0..1.  network: as trained, in float64."""
    made = network(packed[None, ..., :INPUT_CHANNELS].permute(0, 3, 1, 2).double())[0].permute(1, 2, 0).clamp(0.0, 1.0)
    made[..., 3] = torch.maximum(made[..., 3], packed[..., CLOSED].double())
    return made


def _faulty(made: torch.Tensor) -> int:
    """Values that are not numbers or lie outside 0..1."""
    made = made.float()
    return int((~((made >= 0) & (made <= 1))).sum())


def network_rows(seed: int, size: tuple[int, int], quality: str = "fast", scales: Sequence[float] = SCALES,
                 precisions: Sequence[str] = tuple(PRECISIONS), *, filtered: bool = True) -> tuple[list[dict], list[dict]]:
    """Rows with limits, and the table: kind, precision, largest and mean difference from float64, values that are
    faulty."""
    inputs: dict[str | float, torch.Tensor] = {**masks(seed, size), **scaled(seed, size, scales)}
    which = weights_name(quality, filtered=filtered)
    exact = fitting_weights(quality, filtered=filtered)[1].double().eval()
    truth = {kind: in_float64(exact, packed) for kind, packed in inputs.items()}
    rows, table = [], []
    for precision in precisions:
        network = Reconstructor(quality, filtered=filtered, device="cpu", precision=precision)
        largest, mean = PRECISION_LIMITS[precision]
        for kind, packed in inputs.items():
            made = network(packed)
            raw = network.network(network.channels(packed))
            gap = (made.double() - truth[kind]).abs()
            name = kind if isinstance(kind, str) else f"scale {kind:g}"
            table.append({"kind": name, "precision": precision, "largest": float(gap.max()), "mean": float(gap.mean()),
                          "faulty": _faulty(made), "not finite before clamping": int((~raw.isfinite()).sum())})
        mine = [entry for entry in table if entry["precision"] == precision]
        rows += [
            row(f"{which} in {precision}: largest difference from float64", max(e["largest"] for e in mine), largest),
            row(f"{which} in {precision}: mean difference from float64", max(e["mean"] for e in mine), mean),
            row(f"{which} in {precision}: values that are NaN or outside 0..1", sum(e["faulty"] for e in mine), 0),
            row(f"{which} in {precision}: values not finite before clamping",
                sum(e["not finite before clamping"] for e in mine), 0),
        ]
    if 1.0 in truth:
        apart = max(float((truth[s] - truth[1.0]).abs().mean()) for s in scales)
        rows.append(row(f"{which}: mean difference between scales {min(scales):g} to {max(scales):g}", apart, SCALE_LIMIT))
    return rows, table
