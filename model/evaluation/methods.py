"""The compared reconstruction methods, with and without a network, from the same projected points.

A :class:`ViewPoints` is the input of the methods: the points of one view at one density, averaged per pixel with equal weights,
as published, and with view-dependent blending, as in the viewer (model/reference/station_weights.py).  Masks and filled inputs
are computed on first use and shared by all methods.
"""

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from ..appearance.noise import NoiseModel
from ..data.dataset import MergedScan
from ..data.surfaces.projected import Projected, seen_noise
from ..network.levels import LEVELS, merged
from ..network.unet import CompactUNet, mac_per_pixel
from ..network.weights import load_weights
from ..reference.depth_filter import keep_mask
from ..reference.fill_constants import FOR_NETWORK, FOR_PICTURE, Averaging
from ..reference.projection import Raster, SoftZ, network_input
from .open3d_points import POINT_SIZES, Open3DPoints
from .own_methods import OwnNetwork, OwnPicture

PRESETS = {
    "no filter": "off", "paper's filter": "paper-code", "NPBG++'s visibility": "npbg++", "our filter": "auto",
}
"""Name of a mask in tables -> preset of :func:`model.reference.depth_filter.keep_mask`."""
TRUE, OURS = "true visibility", "our filter"
"""Names of the masks from the true depth and of the viewer's depth filter."""
WEIGHTED = f"pull-push, {OURS}, view-dependent blending"
"""Name of the method whose picture is the input of the viewer's networks."""
TIMES = 3
"""Runs per duration, whose median is taken, after one run to warm up: the fewest whose median leaves out one outlier."""


def true_visibility(depth: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """(visible, hidden) masks (H, W) bool of projected points by a true depth picture; undecided pixels are in neither.

    depth, truth: (H, W) metres.  A point is visible up to 1 % + 1 cm behind the farthest true depth of its 3x3 neighbourhood,
    hidden beyond 2 % + 3 cm.
    """
    known = torch.where(torch.isfinite(truth), truth, torch.full_like(truth, 1e4))[None, None]
    farthest = F.max_pool2d(F.pad(known, (1, 1, 1, 1), mode="replicate"), 3, 1)[0, 0]
    hit = torch.isfinite(depth)
    return hit & (depth <= farthest * 1.01 + 0.01), hit & (depth > farthest * 1.02 + 0.03)


@dataclass(frozen=True)
class ViewPoints:
    """The points of a view at one density.

    seen: the points; raster: their averages per pixel, with equal weights; true_depth: (H, W) float32, None if unknown;
    spacing: of the thinned scan, file units; unlit: black points count as points without colour
    (:class:`model.reference.projection.SoftZ`); noise: noise model of the scan, an input of the network, None if unknown.
    masks, inputs, rasters: caches.

    Masks depend on depth only; sights that differ only in colour may share them.
    """

    seen: Projected
    raster: Raster
    true_depth: Tensor | None
    spacing: float
    masks: dict[str, Tensor] = field(default_factory=dict)
    inputs: dict[tuple[str, bool, Averaging | None], Tensor] = field(default_factory=dict)
    rasters: dict[str, Raster] = field(default_factory=dict)
    unlit: bool = False
    noise: NoiseModel | None = None

    @property
    def weighted(self) -> Raster:
        """The raster with view-dependent blending; ``raster`` if the scanner positions are unknown."""
        if self.seen.weight is None:
            return self.raster
        if "weighted" not in self.rasters:
            self.rasters["weighted"] = self.seen.raster(soft_z(self.spacing, unlit=self.unlit))
        return self.rasters["weighted"]

    def mask(self, name: str) -> Tensor:
        """(H, W) bool: mask of a name in PRESETS, or TRUE, which requires the true depth."""
        if name not in self.masks:
            depth = self.raster.depth
            if name == TRUE:
                assert self.true_depth is not None
                self.masks[name] = true_visibility(depth, self.true_depth)[0]
            else:
                kept = keep_mask(depth, PRESETS[name])
                self.masks[name] = kept & (self.raster.count > 0) if self.unlit else kept
        return self.masks[name]

    def input(self, mask: str, *, weighted: bool = False, averaging: Averaging = FOR_NETWORK) -> Tensor:
        """(6, H, W) network input of the pixels of the named mask."""
        overall = 0.0 if self.noise is None or PRESETS.get(mask) != "auto" else self.noise.overall
        key = mask, weighted, averaging if averaging.applies(overall) else None
        if key not in self.inputs:
            raster = self.weighted if weighted else self.raster
            noise = seen_noise(self.noise, raster, self.seen)
            self.inputs[key] = network_input(raster, self.mask(mask), self.seen.camera.fx, self.spacing, noise, overall,
                                             averaging)
        return self.inputs[key]

    def filled(self, mask: str, *, weighted: bool = False) -> Tensor:
        """(3, H, W) pull-push picture of the pixels of the named mask, as it is shown."""
        return self.input(mask, weighted=weighted, averaging=FOR_PICTURE)[:3]

    def fresh(self) -> "ViewPoints":
        """A copy with empty caches, for timing."""
        return replace(self, masks={}, inputs={}, rasters={})


def soft_z(spacing: float, *, unlit: bool = False) -> SoftZ:
    """The renderer's soft z-buffer.  spacing: file units."""
    return SoftZ.preset("auto", spacing, 1.0, unlit=unlit)


def view_points(seen: Projected, true_depth: Tensor | None, spacing: float, masks: dict[str, Tensor] | None = None, *,
                unlit: bool = False, noise: NoiseModel | None = None) -> ViewPoints:
    """``seen``, already thinned, through the soft z-buffer.  spacing: of the thinned scan, file units."""
    raster = replace(seen, weight=None).raster(soft_z(spacing, unlit=unlit))
    return ViewPoints(seen, raster, true_depth, spacing, {} if masks is None else masks, unlit=unlit, noise=noise)


def thinned(seen: Projected, density: float) -> Projected:
    """The points of rank < density."""
    return seen.chosen(seen.rank < density)


@dataclass(frozen=True)
class Method:
    """A reconstruction method.

    prepare: view points -> the input (6, H, W) of ``network``, or the picture (3, H, W) without a network.  network: (6, H, W)
    -> (3, H, W).  mask: name of its mask, None without one.  mac: multiply-accumulate operations per pixel.  weighted: whether
    it uses view-dependent blending.
    """

    name: str
    prepare: Callable[[ViewPoints], Tensor]
    mask: str | None
    network: Callable[[Tensor], Tensor] | None = None
    mac: float = 0.0
    weighted: bool = False

    def picture(self, view_points: ViewPoints) -> Tensor:
        """(3, H, W) in 0..1."""
        made = self.prepare(view_points)
        return made if self.network is None else self.network(made)


def plain_methods() -> list[Method]:
    """Methods without a network: raw points; pull-push with each mask and equal weights; and with view-dependent blending."""
    methods = [Method("raw", lambda view_points: view_points.raster.colour / 255, "no filter")]
    for mask in (*PRESETS, TRUE):
        methods.append(Method(f"pull-push, {mask}", lambda view_points, mask=mask: view_points.filled(mask), mask))
    return [*methods, Method(WEIGHTED, lambda view_points: view_points.filled(OURS, weighted=True), OURS, weighted=True)]


def network_method(name: str, path: Path) -> Method:
    """A network from a weights file, with our filter if it was trained on filtered input, else without a filter.

    The paper's network takes points averaged with equal weights, as published; ours also sees coarser sizes where points are
    sparse, as in the viewer.  Raises WeightsError.
    """
    network, header = load_weights(path)
    mac = mac_per_pixel(network)
    weighted = isinstance(network, CompactUNet)
    network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    mask = "no filter" if header.get("input") == "unfiltered" else OURS

    def once(x: Tensor) -> Tensor:
        return network(x.contiguous(memory_format=torch.channels_last))[:, :3].clamp(0, 1)

    @torch.inference_mode()
    def run(x: Tensor) -> Tensor:
        return merged(once, x[None], LEVELS if weighted else 0)[0]

    return Method(f"network {name}", lambda view_points: view_points.input(mask, weighted=weighted), mask, run, mac, weighted)


def own_network_method(network: OwnNetwork) -> Method:
    """A network of your own, with our filter and view-dependent blending."""
    return Method(network.name, lambda view_points: view_points.input(OURS, weighted=True), OURS, network, math.nan, True)


def own_method(function: OwnPicture, scan: MergedScan) -> Method:
    """A function of your own, of the points of ``scan`` that are in view."""
    return Method(function.name, lambda view_points: function.picture(scan, view_points.seen), None)


class Open3DMethod:
    """Open3D's point rendering, as one method per point size."""

    def __init__(self, renderer: Open3DPoints):
        self.renderer = renderer
        self.names = [f"Open3D, {size:g} px points" for size in POINT_SIZES]

    def pictures(self, view_points: ViewPoints) -> dict[str, tuple[Tensor, float]]:
        """Method name -> (picture (3, H, W) in 0..1, milliseconds).

        Open3D requires the principal point at the centre of the picture, so points are moved into the frame of such a camera.
        Each point is moved to the centre of its pixel, which does not change the picture for odd point sizes.
        """
        seen, camera = view_points.seen, view_points.seen.camera
        index, z = seen.index.numpy(), seen.z.numpy().astype(np.float64)
        row, column = np.divmod(index, camera.width)
        x, y = column + 0.5 - camera.width / 2, row + 0.5 - camera.height / 2
        xyz = np.stack([x / camera.fx * z, y / camera.fx * z, z], 1).astype(np.float32)
        made, spent = self.renderer.draw(xyz, seen.rgb.numpy(), (camera.width, camera.height), camera.fx)
        return {
            name: (torch.from_numpy(picture.copy()).permute(2, 0, 1) / 255, ms)
            for name, picture, ms in zip(self.names, made, spent, strict=True)
        }


def _median_ms(work: Callable[[], object]) -> float:
    spent = []
    for _ in range(TIMES + 1):
        start = time.perf_counter()
        work()
        spent.append(1000 * (time.perf_counter() - start))
    return statistics.median(spent[1:])


def timings(methods: list[Method], view: ViewPoints) -> dict[str, tuple[float, float | None]]:
    """Milliseconds of each method after warm-up, median of TIMES: (points in view to picture, network only or None).

    Masks come from the raster with equal weights, whose depths are the same.  Methods with view-dependent blending compute
    their own raster, which is part of their time.
    """
    raster = _median_ms(lambda: view_points(view.seen, view.true_depth, view.spacing, noise=view.noise))
    prepared: dict[tuple[str | None, bool], float] = {}
    result: dict[str, tuple[float, float | None]] = {}
    for method in methods:
        key = (method.name if method.name == "raw" or method.mask is None else method.mask), method.weighted
        if key not in prepared:
            prepared[key] = _median_ms(lambda m=method: m.prepare(view.fresh()))
        alone = None
        if method.network is not None:
            x = method.prepare(view)
            alone = _median_ms(lambda m=method, x=x: m.network(x))  # type: ignore[misc]
        rasterised = 0.0 if method.weighted and view.seen.weight is not None else raster
        result[method.name] = rasterised + prepared[key] + (alone or 0.0), alone
    return result
