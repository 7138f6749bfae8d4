"""The noise of a place from that of its grids.  Frame: file coordinates."""

from collections.abc import Sequence

import numpy as np

from ....model.appearance.noise import MAX_VOXELS, NoiseModel


def joined_noise(models: Sequence[NoiseModel | None], points: Sequence[int], bounds: np.ndarray) -> NoiseModel | None:
    """One lattice over ``bounds``, (2, 3), with the largest side of a voxel of MAX_VOXELS along the longest side, or the
    finest of the grids where that is larger.

    A voxel has the mean of the grids whose lattices contain its middle, weighted by their points; others have the overall
    value. None where a grid does not know its noise.  A place differs from one grid of the same points in this: voxels may be
    coarser, and each grid's curve counts by its neighbourhoods.
    """
    known = [(model, float(count)) for model, count in zip(models, points) if model is not None]
    if len(known) < len(models):
        return None
    sure = [(model, count) for model, count in known if model.neighbourhoods]
    if not sure:
        return known[0][0]
    weights = np.array([model.neighbourhoods for model, _ in sure], np.float64)
    curve = np.average([model.curve for model, _ in sure], axis=0, weights=weights).astype(np.float32)
    order = np.argsort([model.overall for model, _ in sure])
    total = np.cumsum(weights[order])
    overall = sure[int(order[np.searchsorted(total, total[-1] / 2)])][0].overall
    low = np.min([model.origin for model, _ in sure], axis=0)
    high = np.max([_end(model) for model, _ in sure], axis=0)
    low, high = np.maximum(low, bounds[0]), np.minimum(high, bounds[1])
    extent = float(max((high - low).max(), 1e-9))
    voxel = max(extent / MAX_VOXELS, min(model.voxel for model, _ in sure))
    shape = np.clip(np.ceil((high - low) / voxel - 1e-9), 1, MAX_VOXELS).astype(int)
    sums, weight = np.zeros(shape), np.zeros(shape)
    for model, count in sure:
        first = np.clip(np.floor((model.origin - low) / voxel), 0, shape - 1).astype(int)
        last = np.clip(np.ceil((_end(model) - low) / voxel), first + 1, shape).astype(int)
        box = tuple(slice(a, b) for a, b in zip(first, last))
        axes = [low[k] + (np.arange(first[k], last[k]) + 0.5) * voxel for k in range(3)]
        middles = np.stack(np.meshgrid(*axes, indexing="ij"))
        steps = np.floor((middles - model.origin[:, None, None, None]) / model.voxel).astype(int)
        x, y, z = (np.clip(steps[k], 0, model.sigma.shape[2 - k] - 1) for k in range(3))
        sums[box] += count * model.sigma[z, y, x]
        weight[box] += count
    sigma = np.where(weight > 0, sums / np.maximum(weight, 1.0), overall).transpose(2, 1, 0)
    return NoiseModel(low, voxel, np.ascontiguousarray(sigma, np.float32), curve, overall, int(weights.sum()))


def _end(model: NoiseModel) -> np.ndarray:
    """(3,) the corner of a lattice opposite to its origin."""
    return model.origin + model.voxel * np.array(model.sigma.shape[::-1])
