"""Training pairs: the renderer's measured picture from a pose, and the true picture from the same pose.

Scans of a place are projected into its true views by :mod:`model.reference.projection` at many densities, degraded as real
scans are (different exposures, a missing station, patches without or with few points) and filtered.  Pairs are made once,
before the training, and stored as memory-mapped arrays, so that drawing a crop is only a read.  Filling and noise are applied
when a crop is drawn (:mod:`model.data.crops`) and are therefore not fixed in the pairs.

- ``measured.npy`` (P, 6, H, W) float16: see :func:`model.reference.projection.measured_input`.
- ``truth.npy`` (P, 5, H, W) uint8: colour, coverage, and 255 where the truth is valid.
- ``neighbours.npy`` (P, 6, H, W) float16, with neighbours only: measured from a slightly moved camera.
- ``flow.npy`` (P, 2, H, W) float16, with neighbours only: optical flow from each true pixel to that picture, pixels, NaN where
  the pixel is not visible there, or where the input lacks points that the neighbour has.
- ``noise.npy`` (P, 1, H, W) float16, where points keep their own noise, as in tuning: its standard deviation at each pixel.
- ``pairs.json``: the origin of each pair; ``overall``, where points keep their own noise: that of the scan.

Colours are of two kinds.  *Scanned*: as the stations recorded them, with exposures and gloss that differ from the truth by 16
to 29 dB even without noise.  *Diffuse*: points in front have the truth's colours, so that pairs without noise really have
none.  Photographic textures are painted on about half of the pairs of either kind (:mod:`model.data.surfaces.painting`).
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from ..appearance.exposure import match_exposures
from ..appearance.noise import NoiseModel
from ..common.errors import DataError
from ..common.files.temporary import temporary_folder
from ..reference.depth_filter import keep_mask
from ..reference.projection import MEASURED_CHANNELS, measured_input
from .dataset import MergedScan, TruePicture, TruePlace
from .images.downsample import reduced_colour, reduced_share
from .surfaces.diffuse import diffuse
from .surfaces.painting import Painting, make_painting, paint_picture, painted
from .surfaces.projected import Projected, project_scan, raster_of, scan_spacing, seen_noise

MATCHED_SHARE = 0.7
"""Share of the scans with exposure compensation, as the viewer applies it.  This and the values below are
those of the shipped weights' training (assets/weights/README.md)."""
PLACED_SHARE = 0.7
"""Share of the scans with known scanner positions that use them; many LAS and PLY files have none."""
DIFFUSE_SHARE = 0.5
"""Share of diffuse pairs among those of places with known depth."""
PAINTED_SHARE = 0.6
"""Share of painted pairs, where textures are given.  A painting covers about half of a place."""
POINT_FOOTPRINT = 0.5
"""Footprint of a laser beam over which a texture is averaged, in point spacings."""
NEIGHBOUR_SHIFT = 0.012
"""Standard deviation of a neighbouring camera's shift along each axis, as a share of the median depth."""
NEIGHBOUR_TURN = 0.5
"""Standard deviation of its rotation about each axis, degrees."""
MAX_FLOW = 24.0
"""Largest optical flow, pixels, that is compared."""
BEHIND = 1.02
"""Depth, relative to the front surface, beyond which a pixel counts as occluded in the neighbour."""


@dataclass(frozen=True)
class Degradation:
    """Degradation of a scan as seen in one picture; shares multiply.

    density: share of all points.  patches (H, W): share at each pixel, 1 outside the patches.  stations (S,): share of each
    station's points, 0 for a missing station.
    """

    density: float
    patches: np.ndarray
    stations: np.ndarray

    def keep(self, seen: Projected, *, patches: bool = True) -> Tensor:
        """(M,) bool: the remaining points.  patches: False for another picture, in which the patches would be elsewhere."""
        share = torch.from_numpy(self.stations)[seen.station.long()] * self.density
        if patches:
            share = share * torch.from_numpy(self.patches).flatten()[seen.index]
        return seen.rank < share


def degrade(width: int, height: int, stations: int, density: float, rng: np.random.Generator) -> Degradation:
    """Random degradation: patches removed or thinned, a station missing or thinned (paper, "Training Data Generation")."""
    share = np.ones((height, width), np.float32)
    rows, columns = np.mgrid[0:height, 0:width]
    for _ in range(rng.integers(0, 5)):  # convex patches: an ellipse cut by two half-planes
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        rx, ry = np.exp(rng.uniform(np.log(6), np.log(70), 2))
        dx, dy = (columns - x) / rx, (rows - y) / ry
        inside = dx * dx + dy * dy < 1
        for _ in range(2):
            a = rng.uniform(0, 2 * np.pi)
            inside &= dx * np.cos(a) + dy * np.sin(a) < 0.6
        share[inside] *= rng.choice([0.0, 0.0, 0.15, 0.4])
    weights = np.ones(stations, np.float32)
    if stations > 1 and rng.random() < 0.5:  # missing, or thinned to single points on other stations' surfaces
        thin = 0.0 if rng.random() < 0.4 else np.exp(rng.uniform(np.log(0.03), np.log(0.5)))
        weights[rng.integers(stations)] = thin
    return Degradation(density, share, weights)


def _density(rng: np.random.Generator) -> float:
    return float(rng.choice([1.0, 0.1]) if rng.random() < 0.35 else np.exp(rng.uniform(np.log(0.03), 0)))


def _truth(view: TruePicture, reduce: int, rgb: np.ndarray | None = None) -> np.ndarray:
    """(5, H / reduce, W / reduce) uint8: colour, coverage, known.  rgb: replaces the view's colours."""
    colour, coverage, known = view.rgb() if rgb is None else rgb, view.coverage(), view.known()
    full = np.ones(colour.shape[:2], bool)
    shares = [reduced_share(full if share is None else share, reduce) for share in (coverage, known)]
    return np.ascontiguousarray(np.dstack([reduced_colour(colour, coverage, reduce), *shares]).transpose(2, 0, 1))


def _neighbour_pose(view: TruePicture, middle: float, rng: np.random.Generator) -> np.ndarray:
    """camera_to_world of a neighbouring camera, slightly moved and rotated.  middle: median depth of the picture."""
    turn = np.radians(NEIGHBOUR_TURN) * rng.normal(size=3)
    x, y, z = turn
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    moved = view.camera_to_world.copy()
    left, _, right = np.linalg.svd(moved[:3, :3] @ (np.eye(3) + skew))
    moved[:3, :3] = left @ right
    moved[:3, 3] += NEIGHBOUR_SHIFT * middle * rng.normal(size=3)
    return moved


def flow_to(view: TruePicture, pose: np.ndarray, camera: SimpleNamespace, reduce: int) -> np.ndarray:
    """(2, H, W) float16: optical flow, pixels, from each true pixel to the picture from ``pose``.

    NaN where there is no surface, where it leaves the picture, moves more than MAX_FLOW pixels, or is occluded there by another
    surface of the true picture.
    """
    depth = view.depth()
    if depth is None:
        return np.full((2, camera.height, camera.width), np.nan, np.float16)
    z = depth[reduce // 2 :: reduce, reduce // 2 :: reduce][: camera.height, : camera.width].astype(np.float64)
    j, i = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
    local = np.stack([(i - camera.cx) / camera.fx * z, -(j - camera.cy) / camera.fy * z, -z], -1)
    with np.errstate(invalid="ignore", divide="ignore"):
        world = local @ view.camera_to_world[:3, :3].T + view.camera_to_world[:3, 3]
        there = (world - pose[:3, 3]) @ (pose[:3, :3] * (1.0, -1.0, -1.0))
        u = camera.fx * there[..., 0] / there[..., 2] + camera.cx
        v = camera.fy * there[..., 1] / there[..., 2] + camera.cy
        good = np.isfinite(z) & (there[..., 2] > 0) & (u > 1) & (v > 1) & (u < camera.width - 1) & (v < camera.height - 1)
        good &= np.maximum(np.abs(u - i), np.abs(v - j)) < MAX_FLOW
    column, row = np.where(good, u, 0).astype(int), np.where(good, v, 0).astype(int)
    front = np.full((camera.height, camera.width), np.inf)
    np.minimum.at(front, (row[good], column[good]), there[..., 2][good])
    around = np.pad(front, 1, constant_values=np.inf)  # closes the gaps of a surface that is stretched
    for shift in ((0, 1), (1, 0), (2, 1), (1, 2)):
        front = np.minimum(front, around[shift[0] : shift[0] + camera.height, shift[1] : shift[1] + camera.width])
    good &= there[..., 2] <= BEHIND * front[row, column]
    return np.where(good, np.stack([u - i, v - j]), np.nan).astype(np.float16)


@dataclass(frozen=True)
class Pair:
    """One training pair.  where: its origin.  neighbour, flow and noise are None unless requested."""

    where: dict
    measured: np.ndarray
    truth: np.ndarray
    neighbour: np.ndarray | None = None
    flow: np.ndarray | None = None
    noise: np.ndarray | None = None


@runtime_checkable
class PhotographedPlace(Protocol):
    """A place whose truth is photographs, which colour the points in front (paper, "Training Data Generation")."""

    def photographed(self, seen: Projected, view: Any, seed: int, *, toned: bool = True) -> Projected: ...


@dataclass(frozen=True)
class _Colouring:
    """The colours of one picture's points and truth.  painting: of the place; None: not painted."""

    scan: MergedScan
    view: TruePicture
    spacing: float
    diffuse: bool
    painting: Painting | None

    def truth(self) -> np.ndarray:
        """(H, W, 3) uint8."""
        return self.view.rgb() if self.painting is None else paint_picture(self.painting, self.view)

    def coloured(self, seen: Projected) -> Projected:
        """The points with their colours."""
        if self.diffuse:
            seen = diffuse(seen, self.scan, self.view)
        if self.painting is not None:
            xyz = self.scan.xyz[seen.point.numpy()]
            gain = self.painting.gain(xyz, np.full(len(xyz), POINT_FOOTPRINT * self.spacing))
            seen = replace(seen, rgb=torch.from_numpy(painted(seen.rgb.numpy(), gain)))
        return seen


def place_pairs(place: TruePlace, *, seed: int, scans: int, variants: int, preset: str, reduce: int = 1,
                neighbours: bool = False, textures: Sequence[np.ndarray] = (),
                noise: NoiseModel | None = None) -> Iterator[Pair]:
    """Yields pairs of every view of a place: ``scans`` scans, each at ``variants`` densities.

    preset: of the depth filter.  reduce: factor by which pictures are smaller, so that several points fall into a pixel;
    without such pairs the network blurs dense scans.  neighbours: also make neighbouring cameras.  textures: of
    :func:`model.data.surfaces.painting.load_textures`; photographed places are neither painted nor diffuse.  noise: of the
    scan, where its points keep their own noise.
    """
    rng = np.random.default_rng(seed)
    photographs = isinstance(place, PhotographedPlace)
    for number in range(scans):
        scan = place.scan(seed * 1000 + number)
        spacing = scan_spacing(scan)
        matched = bool(rng.random() < MATCHED_SHARE)
        if matched:
            scan = replace(scan, rgb=match_exposures(scan.xyz, scan.rgb, scan.station))
        placed = bool(rng.random() < PLACED_SHARE) and scan.places is not None
        if not placed:
            scan = replace(scan, places=None)
        stations = int(scan.station.max(initial=0)) + 1
        paint = make_painting(textures, scan.xyz, rng) if len(textures) and len(scan.xyz) and not photographs else None
        for index, view in enumerate(place.views):
            rank_seed = int(rng.integers(2**31))
            is_diffuse = not photographs and bool(rng.random() < DIFFUSE_SHARE)
            painting = paint if rng.random() < PAINTED_SHARE else None
            colouring = _Colouring(scan, view, spacing, is_diffuse, painting)
            seen = colouring.coloured(project_scan(scan, view, rank_seed, reduce))
            if isinstance(place, PhotographedPlace):
                seen = place.photographed(seen, view, seed * 1000 + number, toned=not matched)
            truth = _truth(view, reduce, colouring.truth())
            camera = seen.camera
            for _ in range(variants):
                density = _density(rng)
                degradation = degrade(camera.width, camera.height, stations, density, rng)
                strength = float(np.exp(rng.uniform(-0.4, 0.4)))
                apart = spacing / density**0.5
                raster = raster_of(seen, degradation.keep(seen), apart)
                made = measured_input(raster, keep_mask(raster.depth, preset, strength=strength), camera.fx, apart)
                where = {"scene": place.name, "view": index, "scan": number, "density": density, "matched": matched,
                         "placed": placed, "diffuse": is_diffuse, "painted": painting is not None}
                if not neighbours:
                    sigma = None if noise is None else seen_noise(noise, raster, seen)[None].numpy().astype(np.float16)
                    yield Pair(where, made.numpy().astype(np.float16), truth, noise=sigma)
                    continue
                finite = raster.depth[torch.isfinite(raster.depth)]
                pose = _neighbour_pose(view, float(finite.median()) if len(finite) else 1.0, rng)
                # with this picture's colours: a difference in colour would count as instability of the network
                beside = project_scan(scan, view, rank_seed, reduce, pose).coloured_as(seen)
                other = raster_of(beside, degradation.keep(beside, patches=False), apart)
                kept = keep_mask(other.depth, preset, strength=strength)
                flow = flow_to(view, pose, camera, reduce)
                flow[:, degradation.patches < 1] = np.nan  # only one of the two pictures has the patch
                yield Pair(where, made.numpy().astype(np.float16), truth,
                           measured_input(other, kept, camera.fx, apart).numpy().astype(np.float16), flow)


def by_size(places: Sequence[TruePlace]) -> list[list[TruePlace]]:
    """Groups the places by the size of their pictures: a folder of pairs has one size."""
    groups: dict[tuple[int, int], list[TruePlace]] = {}
    for place in places:
        sizes = {(view.width, view.height) for view in place.views}
        if len(sizes) != 1:
            raise DataError(f"{place.name}: its pictures have {len(sizes)} sizes", remedy="split it into places of one size")
        groups.setdefault(sizes.pop(), []).append(place)
    return list(groups.values())


def build(places: Sequence[TruePlace], out: Path, *, seed: int = 1, scans: int = 3, variants: int = 2, preset: str = "auto",
          reduce: int = 1, neighbours: bool = False, textures: Sequence[np.ndarray] = (),
          noise: NoiseModel | None = None) -> int:
    """Makes the pairs of all places in the new folder ``out``, atomically.  Returns their number.

    Arguments as in :func:`place_pairs`.  Raises DataError where the places' pictures differ in size.
    """
    from tqdm import tqdm

    sizes = {(view.height // reduce, view.width // reduce) for place in places for view in place.views}
    if len(sizes) != 1:
        raise DataError(f"true pictures of several sizes ({sorted(sizes)})", file=out,
                        remedy="make the pairs of each size separately")
    ((height, width),) = sizes
    count = sum(len(place.views) for place in places) * scans * variants
    out.parent.mkdir(parents=True, exist_ok=True)
    with temporary_folder(out) as partial:

        def allocate(name: str, kind: type, channels: int) -> np.ndarray:
            return np.lib.format.open_memmap(partial / f"{name}.npy", "w+", kind, (count, channels, height, width))

        arrays = {"measured": allocate("measured", np.float16, MEASURED_CHANNELS), "truth": allocate("truth", np.uint8, 5)}
        if neighbours:
            arrays |= {"neighbour": allocate("neighbours", np.float16, MEASURED_CHANNELS),
                       "flow": allocate("flow", np.float16, 2)}
        if noise is not None:
            arrays["noise"] = allocate("noise", np.float16, 1)
        table = []
        with tqdm(total=count, desc=out.name, unit=" pairs", disable=None) as meter:
            for number, place in enumerate(places):
                for pair in place_pairs(place, seed=seed + number, scans=scans, variants=variants, preset=preset,
                                        reduce=reduce, neighbours=neighbours, textures=textures, noise=noise):
                    for name, array in arrays.items():
                        array[len(table)] = getattr(pair, name)
                    table.append(pair.where)
                    meter.update(1)
        for array in arrays.values():
            array.flush()  # type: ignore[attr-defined]  # they are memory maps
        facts = {"preset": preset, "seed": seed, "reduce": reduce, "pairs": table}
        if noise is not None:
            facts["overall"] = noise.overall
        (partial / "pairs.json").write_text(json.dumps(facts))
        partial.rename(out)
    return count
