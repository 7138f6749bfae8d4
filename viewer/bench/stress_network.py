"""The networks under stress, measured: every precision on every kind of picture, against fp32.

Pictures are the network's packed input (see :mod:`model.reconstruct`) as float32 and, rounded, as the half floats that the
renderer hands over: a procedural place at scales from 1e-3 to 1e6, and masks that no scan has.
"""

from collections.abc import Sequence

import numpy as np
import torch

from model.project import SoftZ, frame, network_input, pixels
from model.reconstruct import PACKED_IN, PRECISIONS, Reconstructor
from viewer.bench.stress_frames import SCALES, row
from viewer.bench.stress_scenes import view_inside, walls
from viewer.bench.stress_truth import exact_view

PRECISION_LIMITS = {"fp32": (1e-3, 1e-3), "bf16": (0.12, 0.01), "fp16": (0.02, 0.002)}
"""Largest and mean absolute difference from fp32, of a picture in 0..1.  fp32 differs from itself by the half float that
the result is stored in."""
SCALE_LIMIT = 0.02  # mean difference of a picture from the same place at scale 1; a pixel in thousands changes hands


def masks(seed: int, size: tuple[int, int]) -> dict[str, torch.Tensor]:
    """(H, W, 8) half floats by kind: noise under masks that are empty, full, a checkerboard, one point, and extremes."""
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
    extreme = np.zeros((height, width, PACKED_IN), np.float16)
    extreme[..., :5] = rng.choice([0.0, 1.0], (height, width, 5)) * [1, 1, 1, 1, 4] - [0, 0, 0, 0, 2]
    return {**made, "extremes": torch.from_numpy(extreme)}


def scaled(seed: int, size: tuple[int, int], scales: Sequence[float] = SCALES) -> dict[float, torch.Tensor]:
    """(H, W, 8) half floats by scale: one view of the procedural place, by model.project in float32."""
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
        channels = network_input(raster, mask, camera.fx, spacing * scale).permute(1, 2, 0)
        made[scale] = torch.nn.functional.pad(channels, (0, PACKED_IN - channels.shape[2])).half()
    return made


def _faulty(made: torch.Tensor) -> int:
    """Values that are not numbers or lie outside 0..1."""
    made = made.float()
    return int((~((made >= 0) & (made <= 1))).sum())


def network_rows(seed: int, size: tuple[int, int], quality: str = "fast", scales: Sequence[float] = SCALES,
                 precisions: Sequence[str] = tuple(PRECISIONS)) -> tuple[list[dict], list[dict]]:
    """Rows with limits, and the table: kind, precision, largest and mean difference from fp32, values that are faulty."""
    inputs: dict[str | float, torch.Tensor] = {**masks(seed, size), **scaled(seed, size, scales)}
    exact = Reconstructor(quality, filtered=True, device="cpu", precision="fp32")
    truth = {kind: exact(packed).float() for kind, packed in inputs.items()}
    rows, table = [], []
    for precision in precisions:
        network = Reconstructor(quality, filtered=True, device="cpu", precision=precision)
        largest, mean = PRECISION_LIMITS[precision]
        for kind, packed in inputs.items():
            made = network(packed)
            raw = network.network(_planes(packed, network)).float()
            gap = (made.float() - truth[kind]).abs()
            name = kind if isinstance(kind, str) else f"scale {kind:g}"
            table.append({"kind": name, "precision": precision, "largest": float(gap.max()), "mean": float(gap.mean()),
                          "faulty": _faulty(made), "not finite before clamping": int((~raw.isfinite()).sum())})
        mine = [entry for entry in table if entry["precision"] == precision]
        rows += [
            row(f"{quality} in {precision}: largest difference from fp32", max(e["largest"] for e in mine), largest),
            row(f"{quality} in {precision}: mean difference from fp32", max(e["mean"] for e in mine), mean),
            row(f"{quality} in {precision}: values that are NaN or outside 0..1", sum(e["faulty"] for e in mine), 0),
            row(f"{quality} in {precision}: values not finite before clamping",
                sum(e["not finite before clamping"] for e in mine), 0),
        ]
    if 1.0 in truth:
        apart = max(float((truth[s] - truth[1.0]).abs().mean()) for s in scales)
        rows.append(row(f"{quality}: mean difference between scales {min(scales):g} to {max(scales):g}", apart, SCALE_LIMIT))
    return rows, table


def _planes(packed: torch.Tensor, network: Reconstructor) -> torch.Tensor:
    """(1, 5, H, W) as the network takes it (see Reconstructor)."""
    planes = packed[None, ..., :5].permute(0, 3, 1, 2)
    return planes.to(torch.float32 if network.compact else network.dtype, memory_format=torch.channels_last)
