"""Errors of the networks in each precision on ordinary and extreme inputs, against the network in float64.

The networks run as in a frame: on a CPU, convolutions in that precision and blends in compiled loops.  The float64 network is
the reference implementation in :mod:`model.network.unet`.
Inputs are packed half floats as from the renderer (see :mod:`model.network.reconstruct`): a procedural place at scales from
1e-3 to 1e6, and synthetic masks that no scan produces.
"""

from collections.abc import Sequence

import numpy as np
import torch
from exact_claims import exact_view
from frame_claims import SCALES

from pointglass.model.network.network_layout import CLOSED, PACKED_IN
from pointglass.model.network.reconstruct import PRECISIONS, Reconstructor, fitting_weights
from pointglass.model.network.unet import INPUT_CHANNELS
from pointglass.model.network.weights_folder import weights_name
from pointglass.model.reference.projection import SoftZ, frame, network_input, pixels
from pointglass.viewer.bench.cases.stability import row, view_inside, walls

PRECISION_LIMITS = {"fp32": (5e-4, 1.5e-4), "bf16": (0.12, 0.01), "fp16": (0.02, 0.002)}
"""Limits of the largest and mean absolute difference from float64, colours in 0..1.  Results are stored in half floats, which
causes 2.4e-4 of the largest difference and nearly all differences of fp32."""
NOISE = 0.02
"""Noise standard deviation in the network's input, colours in 0..1: a common value of real scans."""
SCALE_LIMIT = 0.02
"""Limit of the mean difference between scales.  One pixel in thousands shows another point.  Chosen by hand."""


def masks(seed: int, size: tuple[int, int]) -> dict[str, torch.Tensor]:
    """(H, W, 8) half floats by kind: random colours with masks that are empty, full, a checkerboard, one point, random or of
    partial confidence; and extreme values."""
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
    confidence = made["full"].clone()  # of view-dependent blending, in steps of 1/255
    confidence[..., 3] = torch.from_numpy(rng.integers(0, 256, (height, width)) / 255.0)
    made["partial confidence"] = confidence
    extreme = np.zeros((height, width, PACKED_IN), np.float16)
    extreme[..., :6] = rng.choice([0.0, 1.0], (height, width, 6)) * [1, 1, 1, 1, 4, 2] - [0, 0, 0, 0, 2, 0]
    return {**made, "extremes": torch.from_numpy(extreme)}


def scaled(seed: int, size: tuple[int, int], scales: Sequence[float] = SCALES) -> dict[float, torch.Tensor]:
    """(H, W, 8) half floats by scale: one view of the procedural place, projected in float32."""
    place, rgb = walls(seed)
    camera = view_inside(seed, size)
    spacing = float(np.sqrt(208.0 / len(place)))  # of the walls, whose area is 208; only proportionality to the scale matters
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
    """(H, W, 4) float64 in 0..1: output of the network in float64 for packed (H, W, 8)."""
    made = network(packed[None, ..., :INPUT_CHANNELS].permute(0, 3, 1, 2).double())[0].permute(1, 2, 0).clamp(0.0, 1.0)
    made[..., 3] = torch.maximum(made[..., 3], packed[..., CLOSED].double())
    return made


def _faulty(made: torch.Tensor) -> int:
    """Number of values that are NaN or outside 0..1."""
    made = made.float()
    return int((~((made >= 0) & (made <= 1))).sum())


def network_rows(seed: int, size: tuple[int, int], quality: str = "fast", scales: Sequence[float] = SCALES,
                 precisions: Sequence[str] = tuple(PRECISIONS), *, filtered: bool = True) -> tuple[list[dict], list[dict]]:
    """Rows with limits, and the table: kind, precision, largest and mean difference from float64, and numbers of faulty
    values."""
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
