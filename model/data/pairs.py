"""Training pairs: what the renderer would show the network from a pose, and the true picture from there.

Scans made from the stations of a scene are projected into its true views by :mod:`model.project` at many densities,
spoiled as real scans are (other exposures, a station missing, patches without points, thinned patches), filtered and
filled.  They are made once, ahead of training, into two memory-mapped arrays, so that a crop costs a read:
``inputs.npy`` (P, 5, H, W) float16 and ``truth.npy`` (P, 3, H, W) uint8, with ``pairs.json`` saying where each came from.
"""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import torch
from torch import Tensor

from model.data.spacing import median_spacing
from model.data.stations import Scan, Shot, StationScene, load_scene, scan_stations
from model.depth_filter import keep_mask
from model.project import SoftZ, network_input, pixels, rasterise


@dataclass(frozen=True)
class Projected:
    """A scan seen from a shot, before decimation: the points inside the picture, in random order.

    index (M,) int64 pixel, z (M,) float32, rgb (M, 3) uint8, station (M,) uint8, rank (M,) float32 in 0..1: a decimation to a
    share s keeps the points of rank < s.
    """

    index: Tensor
    z: Tensor
    rgb: Tensor
    station: Tensor
    rank: Tensor
    camera: SimpleNamespace


def project_scan(scan: Scan, shot: Shot, seed: int = 0, reduce: int = 1) -> Projected:
    """Projects a scan in float64, then float32 as the renderer does, into a picture ``reduce`` times smaller."""
    matrix = shot.camera_to_world
    view = torch.from_numpy(((scan.xyz - matrix[:3, 3]) @ (matrix[:3, :3] * (1.0, -1.0, -1.0))).astype(np.float32))
    width, height, fl = shot.width // reduce, shot.height // reduce, shot.fl / reduce
    camera = SimpleNamespace(width=width, height=height, fx=fl, fy=fl, cx=width / 2, cy=height / 2)
    x, y, z = view.unbind(1)
    index, inside = pixels(x, y, z, camera)
    rank = torch.rand(len(view), generator=torch.Generator().manual_seed(seed))
    return Projected(
        index, z[inside], torch.from_numpy(scan.rgb)[inside], torch.from_numpy(scan.station)[inside], rank[inside], camera
    )


def picture(seen: Projected, keep: Tensor, spacing: float, preset: str = "auto", strength: float = 1.0) -> Tensor:
    """(5, H, W) network input from the points selected by ``keep``.  spacing: of the decimated scan, file units."""
    camera = seen.camera
    soft = SoftZ.preset("auto", spacing, 1.0)
    raster = rasterise(seen.index[keep], seen.z[keep], seen.rgb[keep], camera.width, camera.height, soft)
    return network_input(raster, keep_mask(raster.depth, preset, strength=strength), camera.fx, spacing)


def spoil(seen: Projected, density: float, rng: np.random.Generator) -> Tensor:
    """(M,) bool: the points left at ``density`` after removing what a real scan might lack (paper, "Training Data
    Generation": patches removed, dense and sparse clusters)."""
    width, height = seen.camera.width, seen.camera.height
    share = np.full((height, width), density, np.float32)
    rows, columns = np.mgrid[0:height, 0:width]
    for _ in range(rng.integers(0, 5)):  # convex patches: an ellipse cut by two half planes
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        rx, ry = np.exp(rng.uniform(np.log(6), np.log(70), 2))
        dx, dy = (columns - x) / rx, (rows - y) / ry
        inside = dx * dx + dy * dy < 1
        for _ in range(2):
            a = rng.uniform(0, 2 * np.pi)
            inside &= dx * np.cos(a) + dy * np.sin(a) < 0.6
        share[inside] *= rng.choice([0.0, 0.0, 0.15, 0.4])
    keep = seen.rank < torch.from_numpy(share.ravel())[seen.index]
    if rng.random() < 0.2:
        keep &= seen.station != int(rng.integers(0, int(seen.station.max()) + 1)) if len(seen.station) else True
    return keep


def _density(rng: np.random.Generator) -> float:
    return float(rng.choice([1.0, 0.1]) if rng.random() < 0.35 else np.exp(rng.uniform(np.log(0.03), 0)))


def _reduced(picture: np.ndarray, reduce: int) -> np.ndarray:
    """(3, H / reduce, W / reduce) uint8 of (H, W, 3) uint8, averaged over blocks of pixels."""
    h, w = picture.shape[0] // reduce, picture.shape[1] // reduce
    blocks = picture[: h * reduce, : w * reduce].reshape(h, reduce, w, reduce, 3).astype(np.float32)
    return np.ascontiguousarray(np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8).transpose(2, 0, 1))


def scene_pairs(
    scene: StationScene, *, seed: int, scans: int, variants: int, preset: str, reduce: int = 1
) -> Iterator[tuple[dict, np.ndarray, np.ndarray]]:
    """Yields (what it is, (5, H, W) float16 input, (3, H, W) uint8 truth): ``variants`` densities of ``scans`` scans.

    reduce: pictures this much smaller, so that many points meet in a pixel: without such pairs the network blurs what
    a dense scan shows sharply.
    """
    rng = np.random.default_rng(seed)
    for number in range(scans):
        scan = scan_stations(scene, seed * 1000 + number)
        pick = rng.choice(len(scan.xyz), min(len(scan.xyz), 2_000_000), replace=False)
        spacing = median_spacing(scan.xyz[pick]) * float(np.sqrt(len(pick) / len(scan.xyz)))
        for index, shot in enumerate(scene.views):
            seen = project_scan(scan, shot, seed=int(rng.integers(2**31)), reduce=reduce)
            truth = _reduced(shot.rgb(), reduce)
            for _ in range(variants):
                density = _density(rng)
                keep = spoil(seen, density, rng)
                strength = float(np.exp(rng.uniform(-0.4, 0.4)))
                made = picture(seen, keep, spacing / density**0.5, preset, strength)
                where = {"scene": scene.name, "view": index, "scan": number, "density": density}
                yield where, made.numpy().astype(np.float16), truth


def build(folders: list[Path], out: Path, *, seed: int = 1, scans: int = 3, variants: int = 2, preset: str = "auto",
          reduce: int = 1) -> int:
    """Makes the pairs of all scenes into ``out`` (written beside and renamed).  Returns how many."""
    scenes = [load_scene(folder) for folder in folders]
    count = sum(len(s.views) for s in scenes) * scans * variants
    height, width = scenes[0].views[0].height // reduce, scenes[0].views[0].width // reduce
    beside = out.with_name(f"{out.name}.{os.getpid()}.partial")
    beside.mkdir(parents=True)
    inputs = np.lib.format.open_memmap(beside / "inputs.npy", "w+", np.float16, (count, 5, height, width))
    truth = np.lib.format.open_memmap(beside / "truth.npy", "w+", np.uint8, (count, 3, height, width))
    table = []
    for number, scene in enumerate(scenes):
        made_here = scene_pairs(
            scene, seed=seed + number, scans=scans, variants=variants, preset=preset, reduce=reduce
        )
        for where, made, true in made_here:
            inputs[len(table)], truth[len(table)] = made, true
            table.append(where)
            if len(table) % 30 == 0:
                print(f"{len(table)} of {count} pairs", flush=True)
    inputs.flush()
    truth.flush()
    (beside / "pairs.json").write_text(json.dumps({"preset": preset, "seed": seed, "pairs": table}))
    beside.rename(out)
    return count
