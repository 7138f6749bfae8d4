"""The ways of making a picture that are compared: no learning, the networks, all behind the same projected points.

A :class:`Sight` is what a method may look at: one view's points at one density in their pixels, averaged as published and, as
the viewer does, by which stations looked the way the eye looks (model/station_weights.py).  Masks and filled inputs are made
when first asked for, and shared by the methods that use them.
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from model.data.projected import Projected
from model.depth_filter import keep_mask
from model.evaluation.open3d_points import POINT_SIZES, Open3DPoints
from model.noise import NoiseModel
from model.noise_level import seen_noise
from model.projection import Raster, SoftZ, network_input
from model.unet import CompactUNet, mac_per_pixel
from model.weights import load_weights

PRESETS = {
    "no filter": "off", "paper's filter": "paper-code", "NPBG++'s visibility": "npbg++", "our filter": "auto",
}
"""Name of a mask in tables -> preset of :func:`model.depth_filter.keep_mask`."""
TRUE, OURS = "true visibility", "our filter"
WEIGHED = f"pull-push, {OURS}, stations weighed"
TIMES = 3  # a duration is the median of this many, after one to warm up


def true_visibility(depth: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """(visible, hidden) masks of projected points against a true depth picture; pixels too close to call are in neither.

    A point is visible up to 1 % + 1 cm behind the farthest true depth of its 3x3 neighbourhood, hidden beyond 2 % + 3 cm.
    """
    known = torch.where(torch.isfinite(truth), truth, torch.full_like(truth, 1e4))[None, None]
    farthest = F.max_pool2d(F.pad(known, (1, 1, 1, 1), mode="replicate"), 3, 1)[0, 0]
    hit = torch.isfinite(depth)
    return hit & (depth <= farthest * 1.01 + 0.01), hit & (depth > farthest * 1.02 + 0.03)


@dataclass(frozen=True)
class Sight:
    """A view's points at one density.  seen: the points left; raster: the same in their pixels, plainly averaged; true_depth:
    (H, W) float32, None where it is not known; unlit: black points have no colour (:class:`model.projection.SoftZ`); noise: of
    the scan, as the network is told it, None where it is not known.

    Masks depend on depth alone, so that sights that differ in colour only may share them.
    """

    seen: Projected
    raster: Raster
    true_depth: Tensor | None
    spacing: float
    masks: dict[str, Tensor] = field(default_factory=dict)
    inputs: dict[tuple[str, bool], Tensor] = field(default_factory=dict)
    rasters: dict[str, Raster] = field(default_factory=dict)
    unlit: bool = False
    noise: NoiseModel | None = None

    @property
    def weighed(self) -> Raster:
        """The raster by the weights of the stations; the plain one where the scan does not say where they stood."""
        if self.seen.weight is None:
            return self.raster
        if "weighed" not in self.rasters:
            self.rasters["weighed"] = self.seen.raster(soft_z(self.spacing, unlit=self.unlit))
        return self.rasters["weighed"]

    def mask(self, name: str) -> Tensor:
        """(H, W) bool: a key of PRESETS, or TRUE, which needs the true depth."""
        if name not in self.masks:
            depth = self.raster.depth
            if name == TRUE:
                assert self.true_depth is not None
                self.masks[name] = true_visibility(depth, self.true_depth)[0]
            else:
                kept = keep_mask(depth, PRESETS[name])
                self.masks[name] = kept & (self.raster.count > 0) if self.unlit else kept
        return self.masks[name]

    def input(self, mask: str, *, weighed: bool = False) -> Tensor:
        """(6, H, W) network input behind the named mask; its first three channels are the pull-push picture."""
        if (mask, weighed) not in self.inputs:
            raster = self.weighed if weighed else self.raster
            noise = seen_noise(self.noise, raster, self.seen)
            self.inputs[mask, weighed] = network_input(raster, self.mask(mask), self.seen.camera.fx, self.spacing, noise)
        return self.inputs[mask, weighed]

    def fresh(self) -> "Sight":
        """The same with nothing made yet, to be timed."""
        return replace(self, masks={}, inputs={}, rasters={})


def soft_z(spacing: float, *, unlit: bool = False) -> SoftZ:
    """The renderer's own.  spacing: file units."""
    return SoftZ.preset("auto", spacing, 1.0, unlit=unlit)


def sight(seen: Projected, true_depth: Tensor | None, spacing: float, masks: dict[str, Tensor] | None = None, *,
          unlit: bool = False, noise: NoiseModel | None = None) -> Sight:
    """The points ``seen``, already thinned, through our soft z-buffer.  spacing: of the thinned scan, file units."""
    raster = replace(seen, weight=None).raster(soft_z(spacing, unlit=unlit))
    return Sight(seen, raster, true_depth, spacing, {} if masks is None else masks, unlit=unlit, noise=noise)


def thinned(seen: Projected, density: float) -> Projected:
    """The points of rank < density."""
    return seen.chosen(seen.rank < density)


@dataclass(frozen=True)
class Method:
    """A way of making a picture.

    prepare: a sight -> what ``network`` takes, or the picture itself where there is no network.  network: (6, H, W) ->
    (3, H, W).  mask: the name of the one it uses, None where it has none.  mac: multiply-accumulates a pixel.  weighed: whether
    its points have the weights of their stations.
    """

    name: str
    prepare: Callable[[Sight], Tensor]
    mask: str | None
    network: Callable[[Tensor], Tensor] | None = None
    mac: float = 0.0
    weighed: bool = False

    def picture(self, sight: Sight) -> Tensor:
        """(3, H, W) in 0..1."""
        made = self.prepare(sight)
        return made if self.network is None else self.network(made)


def plain_methods() -> list[Method]:
    """Raw points, and pull-push behind every mask, averaged as published; and ours, by the weights of the stations."""
    methods = [Method("raw", lambda sight: sight.raster.colour / 255, "no filter")]
    for mask in (*PRESETS, TRUE):
        methods.append(Method(f"pull-push, {mask}", lambda sight, mask=mask: sight.input(mask)[:3], mask))
    return [*methods, Method(WEIGHED, lambda sight: sight.input(OURS, weighed=True)[:3], OURS, weighed=True)]


def network_method(name: str, path: Path) -> Method:
    """A network from a weights file, behind our filter if it was trained on filtered input, else behind none.

    The paper's gets points averaged as published.  Raises WeightsError.
    """
    network, header = load_weights(path)
    mac = mac_per_pixel(network)
    weighed = isinstance(network, CompactUNet)
    network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    mask = "no filter" if header.get("input") == "unfiltered" else OURS

    @torch.inference_mode()
    def run(x: Tensor) -> Tensor:
        return network(x[None].contiguous(memory_format=torch.channels_last))[0, :3].clamp(0, 1)

    return Method(f"network {name}", lambda sight: sight.input(mask, weighed=weighed), mask, run, mac, weighed)


class Open3DMethod:
    """Open3D's pictures of a sight, by name of a method, one a point size."""

    def __init__(self, renderer: Open3DPoints):
        self.renderer = renderer
        self.names = [f"Open3D, {size:g} px points" for size in POINT_SIZES]

    def pictures(self, sight: Sight) -> dict[str, tuple[Tensor, float]]:
        """Picture (3, H, W) in 0..1, and the milliseconds it took.

        Points are put in the middle of their pixels, which changes no picture while point sizes are odd, and before a camera
        whose principal point is the middle of the picture, the only kind that Open3D draws.
        """
        seen, camera = sight.seen, sight.seen.camera
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


def timings(methods: list[Method], view: Sight) -> dict[str, tuple[float, float | None]]:
    """Milliseconds of every method, warm, median of three: (points in view to picture, network alone or None).

    Masks are made from the plain raster at hand: its depths are those of the weighed one, which a weighed method makes itself.
    """
    raster = _median_ms(lambda: sight(view.seen, view.true_depth, view.spacing, noise=view.noise))
    prepared: dict[tuple[str | None, bool], float] = {}
    result: dict[str, tuple[float, float | None]] = {}
    for method in methods:
        key = (method.name if method.name == "raw" else method.mask), method.weighed
        if key not in prepared:
            prepared[key] = _median_ms(lambda m=method: m.prepare(view.fresh()))
        alone = None
        if method.network is not None:
            x = method.prepare(view)
            alone = _median_ms(lambda m=method, x=x: m.network(x))  # type: ignore[misc]
        rasterised = 0.0 if method.weighed and view.seen.weight is not None else raster
        result[method.name] = rasterised + prepared[key] + (alone or 0.0), alone
    return result
