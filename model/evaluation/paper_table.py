"""The paper's table (Vanherck et al. 2025, Table 1) for given places: two picture sizes, all points and 10 % of them.

Photographs and their intrinsics are cropped to 4:3 and scaled to 1920x1440 and 960x720.  Only the pixels that the scan covers
(``known()``) count: PSNR over them, SSIM over the windows that contain any, and perceptual distances with all other pixels
replaced by the true ones.  LPIPS is given twice: with input 0..1, as in the published code, and with input -1..1, as it is
defined.  Frames per second are of the reference implementation in torch, from projection to network, not of the OpenGL
renderer.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace

import numpy as np
import torch
from PIL import Image
from torch import Tensor, nn

from ..common.errors import DataError
from ..common.system import processor_name
from ..data.dataset import MemoryPicture, Scan, TruePicture, TruePlace
from ..data.images.photo_place import PhotoPlace
from ..data.surfaces.projected import Projected, project_scan, raster_of, scan_spacing
from ..network.reconstruct import PRECISIONS, fast_precision
from ..network.unet import CompactUNet
from ..network.weights import load_weights
from ..reference.depth_filter import keep_mask
from ..reference.projection import SoftZ, network_input, pixels, rasterise
from .metrics.image_metrics import WINDOW, masked_psnr, ssim
from .metrics.perceptual import SqueezeDistance

_log = logging.getLogger(__name__)

SIZES = ((1920, 1440), (960, 720))
"""Picture sizes of the paper, pixels."""
DENSITIES = (1.0, 0.1)
"""Shares of the points in the paper."""
NO_NETWORK = "pull-push"
"""Name of hole filling without a network."""
PUBLISHED = (
    ("paper", 1920, 1440, 16.10, 0.34, 0.74, 13.63), ("paper", 960, 720, 16.29, 0.34, 0.71, 49.71),
    ("Pointersect (paper)", 1920, 1440, 14.94, 0.49, 0.60, 0.006), ("Pointersect (paper)", 960, 720, 14.97, 0.48, 0.55, 0.021),
)
"""Rows of the paper: method, width, height, PSNR, LPIPS as published, SSIM, frames/s on an RTX 4090; 55 scenes of ScanNet++ v2,
all points."""

_Key = tuple[str, int, int, float]
"""Method, width, height, density."""


def scaled(view: TruePicture, width: int, height: int) -> MemoryPicture:
    """The view, cropped around its centre to the aspect ratio and resampled to the size in pixels, with adapted intrinsics.

    A pixel is known if all source pixels are known.
    """
    scale = max(width / view.width, height / view.height)
    left, top = (view.width - width / scale) / 2, (view.height - height / scale) / 2
    box = (left, top, left + width / scale, top + height / scale)
    colour = Image.fromarray(view.rgb()).resize((width, height), Image.Resampling.LANCZOS, box=box)
    known = view.known()
    if known is not None:
        share = Image.fromarray(known.astype(np.float32)).resize((width, height), Image.Resampling.BILINEAR, box=box)
        known = np.asarray(share) > 0.999
    centre = ((view.cx - left) * scale, (view.cy - top) * scale)
    return MemoryPicture(np.array(colour), view.fl * scale, view.camera_to_world, usable=known, centre=centre)


def _from_lpips(backbone: str) -> nn.Module:
    import lpips  # type: ignore[import-not-found]

    return lpips.LPIPS(net=backbone, verbose=False)


def _from_torchmetrics(backbone: str) -> nn.Module:
    from torchmetrics.functional.image.lpips import _LPIPS  # type: ignore[import-not-found]

    return _LPIPS(pretrained=True, net=backbone)


@dataclass(frozen=True)
class _Distances:
    """LPIPS and the SqueezeNet distance; each is None if it or its weights are not available.  missing: the reasons for
    LPIPS."""

    lpips: nn.Module | None
    squeeze: nn.Module | None
    missing: str

    @staticmethod
    def open(path: Path | None, backbone: str, device: str) -> "_Distances":
        squeeze = None if path is None else SqueezeDistance(path).eval().to(device)
        reasons = []
        for make in (_from_lpips, _from_torchmetrics):
            try:
                return _Distances(make(backbone).eval().to(device), squeeze, "")
            except (ImportError, OSError, RuntimeError) as error:  # not installed, or its weights cannot be fetched
                _log.info("LPIPS is not available: %s", error)
                reasons.append(str(error).splitlines()[0] if str(error) else type(error).__name__)
        return _Distances(None, squeeze, "; ".join(reasons))

    @torch.inference_mode()
    def __call__(self, made: Tensor, truth: Tensor) -> dict[str, float]:
        """Distances by name.  made, truth: (3, H, W), 0..1."""
        a, b = made[None], truth[None]
        nan = float("nan")
        return {
            "lpips_published": nan if self.lpips is None else float(self.lpips(a, b, normalize=False).mean()),
            "lpips": nan if self.lpips is None else float(self.lpips(a, b, normalize=True).mean()),
            "squeeze": nan if self.squeeze is None else float(self.squeeze(a, b)),
        }


def known_ssim(made: Tensor, truth: Tensor, known: Tensor) -> float:
    """SSIM over the windows with a known pixel; unknown pixels are replaced by the truth.  known: (H, W) bool.

    Windows without a known pixel are equal, with SSIM 1, and are subtracted from the mean.
    """
    value = ssim(torch.where(known, made, truth), truth)
    hold = torch.nn.functional.max_pool2d(known[None, None].float(), WINDOW, 1)
    share = float(hold.mean())
    return (value - (1 - share)) / share if share > 0 else float("nan")


class _Method:
    """A reconstruction method.  path: weights file of its network; None: hole filling only."""

    def __init__(self, name: str, path: Path | None, device: str, precision: str):
        self.name, self.filtered, self.network, self.dtype = name, True, None, torch.float32
        if path is not None:
            network, header = load_weights(path)
            self.filtered = header.get("input") != "unfiltered"
            dtype = PRECISIONS[precision]
            self.network = network.to(device, dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
            self.dtype = torch.float32 if isinstance(network, CompactUNet) else dtype

    @torch.inference_mode()
    def reconstruct(self, made: Tensor) -> Tensor:
        """(5, H, W) network input -> (3, H, W) in 0..1."""
        if self.network is None:
            return made[:3].clamp(0, 1)
        x = made[None].to(self.dtype, memory_format=torch.channels_last)
        return self.network(x)[0, :3].float().clamp(0, 1)

    def mask(self, depth: Tensor) -> Tensor:
        return keep_mask(depth, "auto" if self.filtered else "off")


def paper_table(
    places: Sequence[TruePlace], weights: dict[str, Path], *, sizes: Sequence[tuple[int, int]] = SIZES,
    densities: Sequence[float] = DENSITIES, views: int | None = None, distance_path: Path | None = None,
    backbone: str = "vgg", device: str = "cpu", precision: str | None = None, repeats: int = 5, seed: int = 11,
) -> dict:
    """Metrics of each weights file (name -> file) and of hole filling without a network.

    views: number per place, evenly spaced (None: all).  distance_path: folder of the SqueezeNet distance's weights.  backbone:
    of LPIPS.  device: cpu or cuda.  precision: of the networks (None: the fastest of the device).  repeats: of each timing.
    seed: of simulated scans, for places without a real one.
    Returns the input of :func:`format_paper_table`, for JSON; NaN where a metric is not available.
    Raises DataError without places or views, WeightsError for invalid weights.
    """
    if not places or not all(place.views for place in places):
        raise DataError("the paper's table needs places with at least one true picture each")
    precision = precision or fast_precision(device)
    methods = [_Method(name, path, device, precision) for name, path in {NO_NETWORK: None, **weights}.items()]
    distances = _Distances.open(distance_path, backbone, device)
    figures: dict[_Key, list[dict[str, float]]] = {}
    seconds: dict[_Key, list[tuple[float, float]]] = {}
    skipped, points = 0, []
    for place in places:
        scan = place.original_scan() if isinstance(place, PhotoPlace) else place.scan(seed)  # real scans are not degraded
        scan = replace(scan, places=None)  # equal weights, as in the published pictures
        points.append(len(scan.xyz))
        spacing = scan_spacing(scan)
        count = len(place.views) if views is None else min(views, len(place.views))
        chosen = [place.views[i] for i in np.linspace(0, len(place.views) - 1, count).astype(int)]
        for (number, view), size in product(enumerate(chosen), sizes):
            shot = scaled(view, *size)
            seen = project_scan(scan, shot, seed + number)
            known = torch.ones(size[::-1], dtype=torch.bool) if shot.usable is None else torch.from_numpy(shot.usable)
            if not known.any() or not len(seen.z):
                skipped += 1
                continue
            truth = torch.from_numpy(shot.rgb()).permute(2, 0, 1).float() / 255
            for density, method in product(densities, methods):
                made = _picture(seen, seen.rank < density, spacing / density**0.5, method, device).cpu()
                figures.setdefault((method.name, *size, density), []).append({
                    "psnr": masked_psnr(made, truth, known), "ssim": known_ssim(made, truth, known),
                    "known": float(known.float().mean()),
                    **distances(torch.where(known, made, truth).to(device), truth.to(device)),
                })
        for size, density, method in product(sizes, densities, methods):
            camera = scaled_camera(chosen[0], *size)
            taken = _times(scan, camera, method, density, spacing, device, repeats)
            seconds.setdefault((method.name, *size, density), []).append(taken)
    rows = []
    for key, values in figures.items():
        name, width, height, density = key
        means = {figure: float(np.mean([v[figure] for v in values])) for figure in values[0]}
        whole, alone = np.mean(seconds[key], axis=0).tolist()
        rows.append({"method": name, "width": width, "height": height, "density": density, "views": len(values), **means,
                     "frame_s": whole, "network_s": alone})
    return {
        "places": [place.name for place in places], "points": points, "device": _device_name(device), "precision": precision,
        "skipped": skipped, "lpips": f"LPIPS ({backbone})" if distances.lpips is not None else "not available",
        "lpips_missing": distances.missing, "squeeze": distance_path is not None, "rows": rows,
    }


def _picture(seen: Projected, keep: Tensor, spacing: float, method: _Method, device: str) -> Tensor:
    raster = raster_of(seen, keep, spacing)
    made = network_input(raster, method.mask(raster.depth), seen.camera.fx, spacing)
    return method.reconstruct(made.to(device))


def scaled_camera(view: TruePicture, width: int, height: int) -> SimpleNamespace:
    """The camera of :func:`scaled`, without the picture."""
    scale = max(width / view.width, height / view.height)
    cx, cy = (view.cx - view.width / 2) * scale + width / 2, (view.cy - view.height / 2) * scale + height / 2
    fl = view.fl * scale
    return SimpleNamespace(width=width, height=height, fx=fl, fy=fl, cx=cx, cy=cy, camera_to_world=view.camera_to_world)


@torch.inference_mode()
def _times(scan: Scan, camera: SimpleNamespace, method: _Method, density: float, spacing: float, device: str,
           repeats: int) -> tuple[float, float]:
    """Median seconds of a frame, from points on the device to the picture, and of the network alone (0 without one)."""
    chosen = np.random.default_rng(0).random(len(scan.xyz)) < density
    origin = camera.camera_to_world[:3, 3]
    xyz = torch.from_numpy((scan.xyz[chosen] - origin).astype(np.float32)).to(device)
    rgb = torch.from_numpy(scan.rgb[chosen]).to(device)
    rotation = torch.from_numpy((camera.camera_to_world[:3, :3] * (1.0, -1.0, -1.0)).astype(np.float32)).to(device)
    apart = spacing / density**0.5
    soft = SoftZ.preset("auto", apart, 1.0)

    def frame() -> Tensor:
        x, y, z = (xyz @ rotation).unbind(1)
        index, inside = pixels(x, y, z, camera)
        raster = rasterise(index, z[inside], rgb[inside], camera.width, camera.height, soft)
        return network_input(raster, method.mask(raster.depth), camera.fx, apart)

    made = frame()
    whole = _median_seconds(lambda: method.reconstruct(frame()), device, repeats)
    alone = 0.0 if method.network is None else _median_seconds(lambda: method.reconstruct(made), device, repeats)
    return whole, alone


def _median_seconds(work: Callable[[], Tensor], device: str, repeats: int) -> float:
    taken = []
    for number in range(repeats + 1):
        begun = perf_counter()
        work()
        if device.startswith("cuda"):
            torch.cuda.synchronize()
        if number:  # the first run warms up
            taken.append(perf_counter() - begun)
    return float(np.median(taken))


def _device_name(device: str) -> str:
    if device.startswith("cuda"):
        return torch.cuda.get_device_name(device)
    return f"{processor_name()}, {torch.get_num_threads()} threads"


def format_paper_table(result: dict) -> str:
    """The result as text, followed by the published rows."""
    def figure(value: float, digits: int) -> str:
        return "-" if np.isnan(value) else f"{value:.{digits}f}"

    points = ", ".join(f"{n / 1e6:.2f}M" for n in result["points"][:5]) + (", ..." if len(result["points"]) > 5 else "")
    lines = [
        f"{len(result['places'])} places ({points} points); only pixels the scan covers count (their share: column known)",
        f"frames/s: reference implementation in torch, projection to picture; network/s: the network alone; "
        f"{result['device']}, {result['precision']}",
        f"LPIPS: {result['lpips']}" + (f" ({result['lpips_missing']})" if result["lpips_missing"] else "")
        + "; [0,1] as in the published code, [-1,1] as defined",
    ]
    if result["skipped"]:
        lines.append(f"{result['skipped']} pictures left out, as the scan covers none of their pixels")
    head = (f"{'method':24} {'size':>10} {'points':>7} {'PSNR':>6} {'LPIPS[0,1]':>13} {'LPIPS[-1,1]':>13} {'SqueezeNet':>13} "
            f"{'SSIM':>6} {'frames/s':>9} {'network/s':>9} {'known':>6}")
    lines.append(head)
    no_lpips, no_squeeze = result["lpips"] == "not available", not result["squeeze"]

    def distance(value: float, absent: bool) -> str:
        return "not available" if absent else figure(value, 3)

    for row in sorted(result["rows"], key=lambda r: (-r["width"], -r["density"], r["method"] != NO_NETWORK, r["method"])):
        network = "-" if row["method"] == NO_NETWORK else f"{1 / row['network_s']:.2f}"
        lines.append(
            f"{row['method']:24} {row['width']:>5}x{row['height']:<4} {row['density']:>7.0%} {figure(row['psnr'], 2):>6} "
            f"{distance(row['lpips_published'], no_lpips):>13} {distance(row['lpips'], no_lpips):>13} "
            f"{distance(row['squeeze'], no_squeeze):>13} {figure(row['ssim'], 3):>6} {1 / row['frame_s']:>9.2f} {network:>9} "
            f"{row['known']:>6.0%}"
        )
    for name, width, height, psnr, lpips, similar, rate in PUBLISHED:
        lines.append(f"{name:24} {width:>5}x{height:<4} {'100%':>7} {psnr:>6.2f} {lpips:>13.2f} {'-':>13} {'-':>13} "
                     f"{similar:>6.2f} {rate:>9.4g} {'-':>9} {'-':>6}")
    lines.append("published rows: RTX 4090, 55 scenes of ScanNet++ v2, which may differ from the places above")
    return "\n".join(lines)
