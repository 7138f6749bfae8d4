"""Fine-tuning on the photographs in an E57 that are registered to its points.

Four of five photographs are for training; the fifth is held out for the evaluation.  Each photograph is first adapted to the
exposure of the scan (one gain per channel, linear light), which the network cannot know.  Frame: that of the E57, metres;
camera axes as in OpenGL.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.ndimage import binary_closing, binary_dilation, binary_erosion, gaussian_filter

from ....model.appearance.noise import NoiseModel, estimate_noise
from ....model.common.linear_light import TO_LINEAR, TO_SRGB
from ....model.common.scanner_positions import station_positions_of
from ....model.data.dataset import MemoryPicture, MergedScan
from ....model.data.images.photo_place import PhotoPlace
from ....model.data.pairs import build
from ....model.data.surfaces.projected import Projected, project_scan, raster_of, scan_spacing, seen_noise
from ....model.reference.depth_filter import keep_mask
from ....model.reference.projection import network_input
from ...common.errors import InputError
from ...common.progress import progress
from ...preprocess.point_colour import Colours
from ...preprocess.valid_positions import is_position
from ...readers.e57.e57_images import Photo, read_photographs
from ...readers.formats import open_source
from .material import DENSITIES, HELD_OUT_EVERY, HeldOutPicture, check_room

MOST_POINTS = 20_000_000
"""Largest number of points used, chosen at random from more: a limit of memory."""
MOST_PHOTOS = 120
"""Largest number of photographs used.  This and all limits below were chosen by hand."""
LONGEST = 768
"""Largest side, pixels, to which photographs are reduced: scans rarely have finer detail."""
LEAST_AGREEMENT = 0.3
"""Least correlation of fine structure between a registered photograph and the points projected into it."""
MOST_OFFSET = 2.0
"""Largest registration offset between photograph and points, pixels: a larger one would train the network to blur."""
OFFSETS = 16
"""Largest offset searched along each axis, pixels."""
LARGEST_GAIN = 4.0
"""Largest exposure gain, linear light, and inverse of the smallest."""
LARGEST_DIFFERENCE = 48.0
"""Largest local difference of a colour channel between photograph and points, 0 to 255: beyond it, something moved or
occludes."""
LEAST_SIDE = 64
"""Least side of a photograph, pixels."""


@dataclass(frozen=True)
class Agreement:
    """Agreement of a photograph with the points.

    correlation: of fine structure, -1..1; NaN if too few points are visible.  offset: pixels, of the largest cross-correlation.
    picture: the photograph in the exposure of the scan, usable where points exist and agree.  gain: (3,), linear light.
    """

    correlation: float
    offset: float
    picture: MemoryPicture
    gain: np.ndarray


def read_points(path: Path, *, most: int = MOST_POINTS, seed: int = 1) -> MergedScan:
    """The coloured points of a scan file as the viewer shows them, thinned at random to about ``most``.

    Colours are analysed over the whole file, with exposure compensation between stations and runs, as on opening.  Points
    without colour are omitted.  Raises InputError if the points have no colours or are too few.
    """
    source = open_source(path)
    colours, rng = Colours([source]), np.random.default_rng(seed)
    first, parts = 0, []
    with progress(2 * (source.count or 0), f"reading {path.name}", " points") as meter:
        for chunk in source.chunks():
            if chunk.rgb is None:
                raise InputError("its points have no colours, which are needed to compare the photographs with them", file=path)
            colours.add(0, first, chunk)
            first += len(chunk.xyz)
            meter.update(len(chunk.xyz) + chunk.invalid)
        decision = colours.decide((0.0, 1.0), {})
        share, first = min(1.0, most / max(first, 1)), 0
        for chunk in source.chunks():
            rgb = colours.apply(0, first, chunk)
            shown = rgb.any(1) if decision.colour.uncoloured else np.ones(len(rgb), bool)
            pick = np.flatnonzero(shown & is_position(chunk.xyz) & (rng.random(len(chunk.xyz)) < share))
            station = np.broadcast_to(np.minimum(chunk.scan, 255), len(chunk.xyz))[pick].astype(np.uint8)
            parts.append((chunk.xyz[pick], rgb[pick], station))
            first += len(chunk.xyz)
            meter.update(len(chunk.xyz) + chunk.invalid)
    xyz, rgb, station = (np.concatenate([part[k] for part in parts]) for k in range(3))
    if len(xyz) < 1000:
        raise InputError(f"{len(xyz)} usable points are too few for tuning", file=path)
    return MergedScan(xyz, rgb, station, station_positions_of(scan.position for scan in source.scans))


def _blurred(values: np.ndarray, weight: np.ndarray, sigma: float) -> np.ndarray:
    """Weighted Gaussian mean of values (H, W); 0 where no weight is near.  sigma: pixels."""
    total = gaussian_filter(weight, sigma, mode="constant")
    return gaussian_filter(values * weight, sigma, mode="constant") / np.maximum(total, 1e-3)


def agreement(photo: Photo, scan: MergedScan, spacing: float) -> Agreement:
    """Projects the scan into the photograph and compares them.  spacing: of the scan, metres."""
    picture = MemoryPicture(photo.picture, photo.fl, photo.camera_to_world, centre=(photo.cx, photo.cy))
    seen = project_scan(scan, picture)
    raster = raster_of(seen, torch.ones(len(seen.z), dtype=torch.bool), spacing)
    front = keep_mask(raster.depth).numpy()
    if photo.valid is not None:
        front &= photo.valid
    if front.sum() < 0.02 * front.size:
        return Agreement(float("nan"), 0.0, picture, np.ones(3))
    points, weight = raster.colour.numpy().transpose(1, 2, 0).round().astype(np.uint8), front.astype(np.float32)
    greys = [colour.astype(np.float32) @ np.array([0.3, 0.6, 0.1], np.float32) for colour in (points, photo.picture)]
    fine = [(_blurred(grey, weight, 1.5) - _blurred(grey, weight, 16.0)) * front for grey in greys]
    norm = float(np.sqrt((fine[0] ** 2).sum() * (fine[1] ** 2).sum()))
    correlation = float((fine[0] * fine[1]).sum()) / norm if norm > 0 else float("nan")
    offset = _offset(fine[0], gaussian_filter(greys[1], 1.5) - gaussian_filter(greys[1], 16.0))
    gain = _gain(points[front], photo.picture[front])
    scaled = np.rint(TO_LINEAR[photo.picture] * gain).clip(0, len(TO_SRGB) - 1).astype(np.int64)
    matched = TO_SRGB[scaled]
    apart = photo.fl * spacing / float(raster.depth[torch.from_numpy(front)].median())
    radius = int(np.clip(np.ceil(1.5 * apart), 1, 12))
    wide = np.pad(front, radius)
    known = np.asarray(binary_closing(wide, np.ones((2 * radius + 1,) * 2)), bool)[radius:-radius, radius:-radius]
    differ = np.stack([_blurred(matched[..., c].astype(np.float32) - points[..., c], weight, 3.0) for c in range(3)])
    known &= ~np.asarray(binary_dilation(np.abs(differ).max(0) > LARGEST_DIFFERENCE, iterations=2), bool)
    if gain.min() < 0.95:
        known &= photo.picture.max(2) < 254  # the photograph is clipped there
    if photo.valid is not None:
        known &= photo.valid
    known = np.asarray(binary_erosion(known, border_value=1), bool)
    picture = MemoryPicture(matched, photo.fl, photo.camera_to_world, usable=known, centre=(photo.cx, photo.cy))
    return Agreement(correlation, offset, picture, gain)


def _offset(points: np.ndarray, photo: np.ndarray) -> float:
    """Offset in pixels with the largest cross-correlation of ``photo`` and ``points``, both (H, W); ``points`` is 0 without
    points."""
    size = [n + OFFSETS for n in points.shape]
    product = np.fft.irfft2(np.conj(np.fft.rfft2(points, size)) * np.fft.rfft2(photo, size), size)
    steps = np.arange(-OFFSETS, OFFSETS + 1)
    near = product[np.ix_(steps, steps)]
    row, column = np.unravel_index(np.argmax(near), near.shape)
    return float(np.hypot(steps[row], steps[column]))


def _gain(points: np.ndarray, photo: np.ndarray) -> np.ndarray:
    """(3,) gains from the photograph to the points, linear light: medians over pixels that are neither dark nor clipped."""
    usable = (np.minimum(points, photo).min(1) >= 20) & (np.maximum(points, photo).max(1) <= 240)
    if usable.sum() < 100:
        return np.ones(3)
    ratio = np.log(TO_LINEAR[points[usable]] / TO_LINEAR[photo[usable]])
    return np.exp(np.median(ratio, 0)).clip(1 / LARGEST_GAIN, LARGEST_GAIN)


def photographs_in(path: Path) -> tuple[list[Photo], str]:
    """The photographs with camera and pose in a scan, and, without any, the reason."""
    if path.is_dir() or open_source(path).format != "E57":
        return [], f"{path}: only an E57 carries photographs with their cameras"
    photos, warnings = read_photographs(path, longest=LONGEST, most=MOST_PHOTOS)
    for line in warnings:
        print(f"pointglass: {line}")
    return photos, "" if photos else f"{path}: contains no photographs with camera and pose"


def registered_pictures(path: Path, photos: list[Photo], scan: MergedScan, spacing: float, *, say=print) -> list[MemoryPicture]:
    """The photographs of an E57 that fit its points.  say: called with a message for each photograph that is left out.

    Raises InputError if most do not fit, as they are not registered to this scan.
    """
    found = []
    with progress(len(photos), "comparing photographs with points") as meter:
        for photo in photos:
            found.append((photo.name, agreement(photo, scan, spacing)))
            meter.update(1)
    compared = [(name, a) for name, a in found
            if np.isfinite(a.correlation) and min(a.picture.width, a.picture.height) >= LEAST_SIDE]  # fmt: skip
    if not compared:
        raise InputError(f"none of its {len(photos)} photographs shows enough of its points for training", file=path)
    middle, offset = (float(np.median([getattr(a, what) for _, a in compared])) for what in ("correlation", "offset"))
    if middle < LEAST_AGREEMENT or offset > MOST_OFFSET:
        raise InputError(f"its photographs do not fit its points (median correlation {middle:.2f}, expected at least "
                         f"{LEAST_AGREEMENT}; offset {offset:.0f} pixels, expected at most {MOST_OFFSET:.0f}): they are not "
                         "registered", file=path, remedy="export the E57 with their poses")
    fitting = []
    for name, a in compared:
        if a.correlation >= LEAST_AGREEMENT and a.offset <= MOST_OFFSET:
            fitting.append(a.picture)
        else:
            why = f"correlation {a.correlation:.2f}, offset {a.offset:.0f} pixels"
            say(f"pointglass: photograph {name!r} does not fit the points ({why}); left out")
    return [picture for picture in fitting if picture.usable.any()]


@dataclass(frozen=True, eq=False)
class Photographs:
    """Photographs as training data.  noise: noise model of the scan, an input of the network.

    learned_from, held_out: registered photographs for training and for the evaluation.
    """

    scan: MergedScan
    spacing: float
    noise: NoiseModel
    learned_from: list[MemoryPicture]
    held_out: list[MemoryPicture]
    noun: str = "photographs"
    perceptual: bool = True

    @property
    def learned(self) -> int:
        return len(self.learned_from)

    @property
    def held(self) -> int:
        return len(self.held_out)

    def held_out_pictures(self) -> list[HeldOutPicture]:
        """The network's input from the cameras of the held-out photographs, at each density, as the renderer makes it."""
        made = []
        for picture in self.held_out:
            seen: Projected = project_scan(self.scan, picture)
            truth = torch.from_numpy(picture.colour).permute(2, 0, 1).float() / 255
            for density in DENSITIES:
                spacing = self.spacing / density**0.5
                raster = raster_of(seen, seen.rank < density, spacing)
                noise = seen_noise(self.noise, raster, seen)
                x = network_input(raster, keep_mask(raster.depth), picture.fl, spacing, noise)
                made.append(HeldOutPicture(x.half(), truth, torch.from_numpy(picture.usable)))
        return made

    def pairs(self, work: Path, name: str, seed: int) -> list[tuple[Path, int]]:
        """Folders of pairs, one for each picture size at full and at half resolution."""
        pictures = self.learned_from
        variants = int(np.clip(120 // len(pictures), 1, 8))
        groups: dict[tuple[int, int], list[MemoryPicture]] = {}
        for picture in pictures:
            groups.setdefault((picture.width, picture.height), []).append(picture)
        check_room(work, sum(w * h * len(g) * variants for (w, h), g in groups.items()))
        folders = []
        for number, group in enumerate(groups.values()):
            for reduce in (1, 2):  # at half resolution a pixel averages more points
                if reduce == 1 or min(group[0].width, group[0].height) >= 4 * LEAST_SIDE:
                    folders.append((work / f"pairs-{number}-{reduce}", len(group)))
                    build([PhotoPlace(name, self.scan, group)], folders[-1][0], seed=seed, scans=1, variants=variants,
                          reduce=reduce, noise=self.noise)
        return folders


def registered_photographs(path: Path, photos: list[Photo], seed: int) -> Photographs:
    """The registered photographs of an E57, with every HELD_OUT_EVERY-th held out.

    Raises InputError if the points have no colours, or if the photographs do not fit them, or fewer than two do.
    """
    points = read_points(path, seed=seed)
    spacing = scan_spacing(points)
    pictures = registered_pictures(path, photos, points, spacing)
    if len(pictures) < 2:
        raise InputError(f"{len(pictures)} registered photographs; at least two are needed, one of them held out", file=path)
    held = [p for i, p in enumerate(pictures) if i % HELD_OUT_EVERY == HELD_OUT_EVERY // 2] or pictures[-1:]
    learned = [p for p in pictures if all(p is not h for h in held)]
    return Photographs(points, spacing, estimate_noise(points.xyz, points.rgb, points.station), learned, held)
