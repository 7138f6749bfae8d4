"""Fine-tuning on withheld points, without photographs (Noise2Noise, Lehtinen et al. 2018).

A tenth of the points is held out for the evaluation, from viewpoints that are not used for training.  Of the others, another
tenth is withheld from each training picture, and the loss is computed at the pixels where these points are visible.  As their
noise is independent of the picture's, the network learns the noise-free mean.
Frame: file coordinates, file units.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ....model.appearance.noise import NoiseModel
from ....model.data.dataset import MergedScan
from ....model.data.heldout import HELD_OUT, Targets, targets
from ....model.data.surfaces.projected import Projected, project_scan, seen_noise
from ....model.evaluation.heldout import Viewpoint
from ....model.evaluation.methods import OURS, ViewPoints, soft_z, view_points
from ....model.reference.projection import measured_input, rasterise
from ...common.errors import InputError
from ...common.progress import progress
from .material import DENSITIES, HELD_OUT_EVERY, HeldOutPicture, check_room

VIEWPOINTS = 30
"""Number of cameras, for training and held out: the benches' eight views, the others along their path.  With one in five held
out, 24 are for training and 6 are not."""
SIZE = (640, 480)
"""Picture size, pixels: that of the larger pairs from which the shipped weights learned."""
MOST_POINTS = 8_000_000
"""Largest number of points used: a view of 640x480 does not show more, and each point is projected into each picture."""
PICTURES = 75
"""Number of training pictures, split evenly between the viewpoints: three of each, and four of three of them."""
LEAST_DENSITY = min(DENSITIES)
"""Least share of the points in every other training picture, that of the evaluation; the other pictures use all points."""
LEAST_SEEN = 500
"""Least number of visible withheld points for a view to be used: the RMS of so many errors has a standard error of
1 / sqrt(1000), 3 %, or 0.3 dB of PSNR."""


@dataclass(frozen=True, eq=False)
class WithheldPoints:
    """Withheld points as training data.

    scan, spacing: of all points, file units.  unlit: black points count as points without colour.  noise: noise model of the
    scan, an input of the network.  apart: (N,) bool, points held out for the evaluation.  views: for training.  judges: for the
    evaluation.
    """

    scan: MergedScan
    spacing: float
    unlit: bool
    noise: NoiseModel | None
    apart: np.ndarray
    views: Sequence[Viewpoint]
    judges: Sequence[Viewpoint]
    noun: str = "viewpoints"
    perceptual: bool = False

    @property
    def learned(self) -> int:
        return len(self.views)

    @property
    def held(self) -> int:
        return len(self.judges)

    def _view_points(self, seen: Projected, keep: Tensor, share: float) -> ViewPoints:
        """The points ``keep`` (M,) bool, which are a share ``share`` of all points."""
        return view_points(seen.chosen(keep), None, self.spacing / share**0.5, unlit=self.unlit, noise=self.noise)

    def held_out_pictures(self) -> list[HeldOutPicture]:
        """Pictures without the held-out points, whose mean colours are the truth."""
        made, soft = [], soft_z(self.spacing, unlit=self.unlit)
        for viewpoint in self.judges:
            seen = project_scan(self.scan, viewpoint.picture)
            held = torch.from_numpy(self.apart)[seen.point]
            wanted = targets(seen, held, soft)
            if len(wanted.index) < LEAST_SEEN:
                continue
            truth, known = pixels_of(seen, wanted)
            for density in DENSITIES:
                share = density * (1.0 - HELD_OUT)
                x = self._view_points(seen, ~held & (seen.rank < density), share).input(OURS, weighted=True)
                made.append(HeldOutPicture(x.half(), truth.float() / 255, known))
        if not made:
            raise _too_sparse(len(self.judges))
        return made

    def pairs(self, work: Path, name: str, seed: int) -> list[tuple[Path, int]]:
        """One folder of pairs in the format of :mod:`model.data.pairs`, with truth at the pixels of visible withheld points."""
        variants = max(1, PICTURES // max(len(self.views), 1))
        width, height = self.views[0].picture.width, self.views[0].picture.height
        check_room(work, width * height * variants * len(self.views))
        rest = np.flatnonzero(~self.apart)
        scan = replace(self.scan, xyz=self.scan.xyz[rest], rgb=self.scan.rgb[rest], station=self.scan.station[rest])
        soft = soft_z(self.spacing / (1.0 - HELD_OUT) ** 0.5, unlit=self.unlit)
        rng, folder = np.random.default_rng(seed), work / "pairs-0-1"
        found: dict[str, list[np.ndarray]] = {"measured": [], "noise": [], "truth": []}
        table = []
        with progress(len(self.views), "making training pictures", " views") as meter:
            for number, viewpoint in enumerate(self.views):
                drawn = int(rng.integers(2**31))
                seen = project_scan(scan, viewpoint.picture, drawn)
                for variant in range(variants):
                    rank = torch.remainder(seen.rank + variant / variants, 1.0)  # each variant withholds different points
                    held = rank >= 1.0 - HELD_OUT
                    wanted = targets(seen, held, soft)
                    if len(wanted.index) >= LEAST_SEEN:
                        density = float(np.exp(rng.uniform(np.log(LEAST_DENSITY), 0.0))) if variant % 2 else 1.0
                        share = density * (1.0 - HELD_OUT)
                        view = self._view_points(seen, rank < share, share * (1.0 - HELD_OUT))
                        mask, noise = view.mask(OURS), seen_noise(self.noise, view.weighted, view.seen)
                        measured = measured_input(view.weighted, mask, view.seen.camera.fx, view.spacing)
                        found["measured"].append(measured.half().numpy())
                        found["noise"].append(noise[None].half().numpy())
                        found["truth"].append(truth_bytes(*pixels_of(seen, wanted)))
                        table.append({"scene": name, "view": number, "density": density})
                meter.update(1)
        if not table:
            raise _too_sparse(len(self.views))
        folder.mkdir()
        for array, pictures in found.items():
            np.save(folder / f"{array}.npy", np.stack(pictures))
        overall = 0.0 if self.noise is None else self.noise.overall
        facts = {"preset": "auto", "seed": seed, "reduce": 1, "overall": overall, "pairs": table}
        (folder / "pairs.json").write_text(json.dumps(facts))
        return [(folder, len(self.views))]


def _too_sparse(views: int) -> InputError:
    return InputError(f"none of {views} viewpoints shows {LEAST_SEEN} withheld points: the scan is too sparse to be tuned on")


def pixels_of(seen: Projected, wanted: Targets) -> tuple[Tensor, Tensor]:
    """(3, H, W) uint8 mean colour in linear light of the withheld points in each pixel, and (H, W) bool, pixels with any."""
    camera = seen.camera
    level = torch.ones(len(wanted.index))  # equal depths, as no visible point occludes another
    raster = rasterise(wanted.index, level, wanted.rgb, camera.width, camera.height, soft_z(0.0))
    return raster.colour.to(torch.uint8), raster.count > 0


def truth_bytes(colour: Tensor, known: Tensor) -> np.ndarray:
    """(5, H, W) uint8 truth as stored in pairs: colour, coverage, known."""
    full = torch.full_like(known, 255, dtype=torch.uint8)
    return torch.cat([colour, full[None], (known.to(torch.uint8) * 255)[None]]).numpy()


def withheld_points(path: Path, seed: int) -> WithheldPoints:
    """Opens a scan for tuning.  Raises InputError if its points have no colours or are too few."""
    from ...grid.open_scene import open_scene
    from ..heldout.judged_viewpoints import judged_viewpoints
    from ..heldout.scan_points import points_of

    scene = open_scene(path)
    scan, spacing = points_of(scene, path, most=MOST_POINTS, seed=seed)
    viewpoints = judged_viewpoints(scene, SIZE, VIEWPOINTS)
    apart = np.random.default_rng([seed, 1]).random(len(scan.xyz)) < HELD_OUT
    judges = [v for i, v in enumerate(viewpoints) if i % HELD_OUT_EVERY == HELD_OUT_EVERY // 2]
    views = [v for i, v in enumerate(viewpoints) if i % HELD_OUT_EVERY != HELD_OUT_EVERY // 2]
    return WithheldPoints(scan, spacing, scene.unlit, scene.noise, apart, views, judges)
