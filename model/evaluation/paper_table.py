"""The paper's table (Vanherck et al. 2025, Table 1) for given places: two picture sizes, all points and 10 % of them.

Photographs and their intrinsics are cropped to 4:3 and scaled to 1920x1440 and 960x720.  Only the pixels that the scan covers
(``known()``) count: PSNR over them, SSIM over the windows that contain any, and perceptual distances with all other pixels
replaced by the true ones.  LPIPS is given twice: with input 0..1, as in the published code, and with input -1..1, as it is
defined.  Frames per second are of the reference implementation in torch, from projection to network, not of the OpenGL
renderer.

The result has figures of each picture (``pictures``), of each place (``scenes``) and of all (``rows``).  It is handed out after
every place, so that a run of hours that ends early is continued with the next place.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from ..common.errors import DataError
from ..common.system import processor_name
from ..data.dataset import MergedScan, TruePicture, TruePlace
from ..data.images.photo_place import PhotoPlace
from ..data.surfaces.projected import project_scan, scan_spacing
from ..network.reconstruct import fast_precision
from .made_with import made_with
from .methods import thinned
from .metrics.image_metrics import WINDOW, masked_psnr, ssim
from .metrics.lpips_distance import Distances
from .own_methods import OwnNetwork, OwnPicture
from .paper_methods import (
    OutsidePictures,
    OwnFunction,
    PaperMethod,
    Reconstruction,
    Shown,
    check_outside,
    network_of,
    own_reconstruction,
    scaled,
)

SIZES = ((1920, 1440), (960, 720))
"""Picture sizes of the paper, pixels."""
DENSITIES = (1.0, 0.1)
"""Shares of the points in the paper."""
NO_NETWORK = "pull-push"
"""Name of hole filling without a network."""

_KEY = ("method", "width", "height", "density")
"""Fields that identify a row among those of a place, or of all places."""


def known_ssim(made: Tensor, truth: Tensor, known: Tensor) -> float:
    """SSIM over the windows with a known pixel; unknown pixels are replaced by the truth.  known: (H, W) bool.

    Windows without a known pixel are equal, with SSIM 1, and are subtracted from the mean.
    """
    value = ssim(torch.where(known, made, truth), truth)
    hold = torch.nn.functional.max_pool2d(known[None, None].float(), WINDOW, 1)
    share = float(hold.mean())
    return (value - (1 - share)) / share if share > 0 else float("nan")


def paper_table(
    places: Sequence[TruePlace], weights: dict[str, Path], *, sizes: Sequence[tuple[int, int]] = SIZES,
    densities: Sequence[float] = DENSITIES, views: int | None = None, distance_path: Path | None = None,
    backbone: str = "vgg", device: str = "cpu", precision: str | None = None, repeats: int = 5, seed: int = 11,
    outside: dict[str, Path] | None = None, functions: Sequence[OwnPicture] = (), networks: Sequence[OwnNetwork] = (),
    earlier: dict | None = None, save: Callable[[dict], None] | None = None,
) -> dict:
    """Metrics of hole filling without a network, of each weights file (name -> file), and of the methods of others.

    views: number per place, evenly spaced (None: all).  distance_path: folder of the SqueezeNet distance's weights.  backbone:
    of LPIPS.  device: cpu or cuda.  precision: of the networks (None: the fastest of the device).  repeats: of each timing.
    seed: of simulated scans, for places without a real one, and of the points that are kept.  outside: name -> folder of
    pictures.  functions, networks: of your own.  earlier: an unfinished result; its places are not evaluated again.  save: gets
    the unfinished result after each place.
    Returns the input of :mod:`model.evaluation.paper_report`, for JSON; NaN where a metric is not available.
    Raises DataError without places or views, for two places or methods of one name, unusable pictures, or an ``earlier`` result
    of other settings; WeightsError for invalid weights.
    """
    if not places or not all(place.views for place in places):
        raise DataError("the paper's table needs places with at least one true picture each")
    precision = precision or fast_precision(device)
    others = [OutsidePictures(name, folder) for name, folder in (outside or {}).items()]
    methods: list[PaperMethod] = [
        Reconstruction(NO_NETWORK, None, device),
        *(network_of(name, path, device, precision) for name, path in weights.items()),
        *map(own_reconstruction, networks), *map(OwnFunction, functions), *others,
    ]
    _check_unique("method", [method.name for method in methods])
    _check_unique("place", [place.name for place in places])
    chosen = {place.name: _chosen(place.views, views) for place in places}
    check_outside(others, [(name, view) for name, held in chosen.items() for view in held], sizes, densities)
    distances = Distances.open(distance_path, backbone, device)
    settings = {
        **made_with(weights, seed), "methods": [method.name for method in methods], "sizes": [list(size) for size in sizes],
        "densities": list(densities), "views": views, "device": _device_name(device), "precision": precision,
        "lpips": f"LPIPS ({backbone})" if distances.lpips is not None else "not available",
        "squeeze": distance_path is not None,
    }
    if earlier is not None:
        check_earlier(earlier, settings)
    done = _unfinished(earlier)
    wanted = [place for place in places if place.name not in done["places"]]

    def result(complete: bool) -> dict:
        rows = _means(done["pictures"], done["times"])
        scenes = [{"place": name, **row} for name in done["places"] for row in _means(
            [row for row in done["pictures"] if row["place"] == name], [row for row in done["times"] if row["place"] == name])]
        return {**settings, "complete": complete, "lpips_missing": distances.missing, **done, "rows": rows, "scenes": scenes}

    steps = sum(len(chosen[place.name]) for place in wanted) * len(sizes)
    with tqdm(total=steps, desc="pictures", disable=None) as meter:
        for place in wanted:
            scan = place.original_scan() if isinstance(place, PhotoPlace) else place.scan(seed)  # real scans are not degraded
            scan = replace(scan, places=None)  # equal weights, as in the published pictures
            meter.set_postfix_str(place.name)
            found = _Place(place.name, scan, methods, densities, distances, device, seed)
            for (number, view), size in product(enumerate(chosen[place.name]), sizes):
                found.judge(view, number, size)
                meter.update(1)
            found.time(chosen[place.name][0], sizes, repeats)
            done["places"].append(place.name)
            done["points"].append(len(scan.xyz))
            done["skipped"] += found.skipped
            done["pictures"] += found.pictures
            done["times"] += found.times
            if save is not None and place is not wanted[-1]:
                save(result(False))
    return result(True)


def check_earlier(earlier: dict, settings: dict) -> None:
    """Raises DataError where an unfinished result was made with other settings."""
    different = [name for name, value in settings.items() if earlier.get(name) != value]
    if different:
        raise DataError(f"holds an unfinished table made with other {', '.join(different)}",
                        remedy="give another file, or delete this one")


def _unfinished(earlier: dict | None) -> dict[str, Any]:
    """The places, numbers of points, figures and times of an unfinished result; null in JSON is NaN."""
    empty: dict[str, Any] = {"places": [], "points": [], "skipped": 0, "pictures": [], "times": []}
    held = {} if earlier is None else {name: earlier[name] for name in empty}
    for row in held.get("pictures", ()):
        row.update({name: float("nan") for name, value in row.items() if value is None})
    return {**empty, **held}


class _Place:
    """Figures and times of all methods at one place."""

    def __init__(self, name: str, scan: MergedScan, methods: list[PaperMethod], densities: Sequence[float],
                 distances: Distances, device: str, seed: int):
        self.name, self.scan, self.methods, self.densities = name, scan, methods, densities
        self.distances, self.device, self.seed = distances, device, seed
        self.spacing = scan_spacing(scan)
        self.pictures: list[dict] = []
        self.times: list[dict] = []
        self.skipped = 0

    def judge(self, view: TruePicture, number: int, size: tuple[int, int]) -> None:
        """Figures of a view at a size; a view without a known pixel or point is skipped."""
        shot = scaled(view, *size)
        seen = project_scan(self.scan, shot, self.seed + number)
        known = torch.ones(size[::-1], dtype=torch.bool) if shot.usable is None else torch.from_numpy(shot.usable)
        if not known.any() or not len(seen.z):
            self.skipped += 1
            return
        truth = torch.from_numpy(shot.rgb()).permute(2, 0, 1).float() / 255
        for density in self.densities:
            shown = Shown(self.scan, thinned(seen, density), self.spacing / density**0.5, density, self.name, view)
            for method in self.methods:
                made = method.picture(shown)
                self.pictures.append({
                    "place": self.name, "view": view.name or str(number), **self._key(method, size, density),
                    "psnr": masked_psnr(made, truth, known), "ssim": known_ssim(made, truth, known),
                    "known": float(known.float().mean()),
                    **self.distances(torch.where(known, made, truth).to(self.device), truth.to(self.device)),
                })

    def time(self, view: TruePicture, sizes: Sequence[tuple[int, int]], repeats: int) -> None:
        """Durations of the methods in a view."""
        for size in sizes:
            seen = project_scan(self.scan, scaled(view, *size), self.seed)
            for density, method in product(self.densities, self.methods):
                shown = Shown(self.scan, thinned(seen, density), self.spacing / density**0.5, density, self.name, view)
                taken = method.seconds(shown, repeats)
                if taken is not None:
                    self.times.append({"place": self.name, **self._key(method, size, density), "frame_s": taken[0],
                                       "network_s": taken[1]})

    @staticmethod
    def _key(method: PaperMethod, size: tuple[int, int], density: float) -> dict:
        return dict(zip(_KEY, (method.name, *size, density), strict=True))


def _means(pictures: list[dict], times: list[dict]) -> list[dict]:
    """Mean figures and times of each method, size and density; null where a time was not measured."""
    def grouped(rows: list[dict]) -> dict[tuple, list[dict]]:
        groups: dict[tuple, list[dict]] = {}
        for row in rows:
            groups.setdefault(tuple(row[name] for name in _KEY), []).append(row)
        return groups

    taken = grouped(times)
    rows = []
    for key, held in grouped(pictures).items():
        figures = [name for name in held[0] if name not in (*_KEY, "place", "view")]
        means = {name: float(np.mean([row[name] for row in held])) for name in figures}
        spent = {name: float(np.mean([row[name] for row in taken[key]])) if key in taken else None
                 for name in ("frame_s", "network_s")}
        rows.append({**dict(zip(_KEY, key, strict=True)), "views": len(held), **means, **spent})
    return rows


def _chosen(held: Sequence[TruePicture], views: int | None) -> list[TruePicture]:
    count = len(held) if views is None else min(views, len(held))
    return [held[i] for i in np.linspace(0, len(held) - 1, count).astype(int)]


def _check_unique(what: str, names: list[str]) -> None:
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise DataError(f"two {what}s have the name {twice[0]!r}", remedy="rename one")


def _device_name(device: str) -> str:
    if device.startswith("cuda"):
        return torch.cuda.get_device_name(device)
    return f"{processor_name()}, {torch.get_num_threads()} threads"
