"""Photographs of a scanned place as ground truth, with the paper's method for pixel-exact pairs.

A photograph is valid only where the scan has points, and registered poses are never exact.  The paper (Vanherck et al. 2025,
"Training Data Generation") therefore takes only depth and the set of hit pixels from the projected scan and colours the points
in front with the photograph itself: :meth:`PhotoPlace.photographed`.  Points behind keep the scan's colours, as in the paper's
unfiltered input; the filter removes them otherwise.

World frame: the scan's, metres.  Camera frames are OpenGL's.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
import torch
from scipy.ndimage import maximum_filter, minimum_filter

from ...common.errors import DataError
from ...reference.depth_filter import keep_mask
from ...reference.projection import SoftZ
from ..dataset import MergedScan, TruePicture
from ..surfaces.projected import Projected, project_scan, raster_of, scan_spacing
from .downsample import in_blocks, reduced_colour

BRIGHTNESS, CONTRAST, SETS = 20.0, 0.2, (2, 5)
"""The paper's augmentation: 2 to 5 sets of brightness +-20 (of 255) and contrast x0.8 to x1.2, one for each station."""
CLOSING = 1.5
"""Half the width, in point spacings, of gaps between projected points that count as covered: on a surface with
random points a place is farther from all of them with exp(-pi 1.5**2), 0.09 %."""
MAX_CLOSING = 12
"""Largest such half width, pixels.  Chosen by hand."""


@dataclass(frozen=True)
class Tones:
    """Brightness (S,), added, and contrast (S,), multiplied, of each station."""

    brightness: np.ndarray
    contrast: np.ndarray

    def apply(self, rgb: np.ndarray, station: np.ndarray) -> np.ndarray:
        """(N, 3) uint8 colours with the tones of the stations (N,)."""
        changed = rgb * self.contrast[station, None] + self.brightness[station, None]
        return np.clip(np.rint(changed), 0, 255).astype(np.uint8)


class PhotoPlace:
    """A TruePlace of one scan and photographs of it.

    scan: the scan, or a function that loads it; a loaded scan is kept only for the place used last.  Pictures are valid where
    the full scan has points, with gaps between them closed, and the photograph is usable; other pixels are ignored in training.
    """

    _latest: ClassVar["tuple[PhotoPlace, MergedScan] | None"] = None

    def __init__(self, name: str, scan: MergedScan | Callable[[], MergedScan], photographs: Sequence[TruePicture]):
        self.name = name
        self._scan = scan
        self.views: Sequence[TruePicture] = [CoveredPicture(self, photograph) for photograph in photographs]

    def original_scan(self) -> MergedScan:
        """The scan with its original colours."""
        if isinstance(self._scan, MergedScan):
            return self._scan
        if PhotoPlace._latest is None or PhotoPlace._latest[0] is not self:
            PhotoPlace._latest = None
            PhotoPlace._latest = (self, self._scan())
        return PhotoPlace._latest[1]

    @cached_property
    def spacing(self) -> float:
        """Median point spacing of the full scan, metres."""
        return scan_spacing(self.original_scan())

    def scan(self, seed: int) -> MergedScan:
        """The scan with random tones of its stations.  A scan of one station is divided among artificial stations, where near
        stations are more likely, so that they overlap as in merged scans."""
        scan = self.original_scan()
        if not len(scan.xyz):
            raise DataError(f"{self.name}: its scan has no points; do its depth pictures, lenses and poses belong together?")
        tones, own = self._tones(seed)
        station = scan.station if own else _invented(scan.xyz, len(tones.contrast), np.random.default_rng([seed, 3]))
        return replace(scan, rgb=tones.apply(scan.rgb, station), station=station, places=scan.places if own else None)

    def _tones(self, seed: int) -> tuple[Tones, bool]:
        """Tones of each station, and whether the stations are the scan's own.

        The means of the tones are neutral; otherwise the network would be judged by a brightness that it cannot know."""
        rng = np.random.default_rng([seed, 2])
        stations = int(self.original_scan().station.max(initial=0)) + 1
        count = stations if stations > 1 else int(rng.integers(SETS[0], SETS[1] + 1))
        brightness, contrast = rng.uniform(-BRIGHTNESS, BRIGHTNESS, count), 1 + rng.uniform(-CONTRAST, CONTRAST, count)
        return Tones(brightness - brightness.mean(), contrast / contrast.mean()), stations > 1

    def photographed(self, seen: Projected, view: TruePicture, seed: int, *, toned: bool = True) -> Projected:
        """The projected points of ``scan(seed)``, with those in front coloured by the photograph in their station's tones.

        seen: all points of the scan in this view, perhaps downsampled by an integer factor.  toned: False where exposures have
        been compensated.  Points in front are those that the depth filter keeps; the others, and those at unusable pixels, keep
        the scan's colours.
        """
        camera = seen.camera
        reduce = view.width // camera.width
        raster = raster_of(seen, torch.ones(len(seen.z), dtype=torch.bool), self.spacing)
        soft = SoftZ.preset("auto", self.spacing, 1.0)
        farthest = torch.maximum(raster.depth * (1 + soft.relative), raster.depth + soft.absolute)
        usable = view.photograph.known() if isinstance(view, CoveredPicture) else view.known()
        front = keep_mask(raster.depth)
        if usable is not None:
            front &= torch.from_numpy(in_blocks(usable, reduce).min((1, 3)))
        chosen = front.flatten()[seen.index] & (seen.z <= farthest.flatten()[seen.index])
        photo = reduced_colour(view.rgb(), None, reduce).reshape(-1, 3)  # downsampled like the truth
        tones, _ = self._tones(seed)
        rgb = seen.rgb.clone()
        colours = photo[seen.index[chosen].numpy()]
        rgb[chosen] = torch.from_numpy(tones.apply(colours, seen.station[chosen].numpy()) if toned else colours)
        return replace(seen, rgb=rgb)

    def covered(self, view: TruePicture) -> np.ndarray:
        """(H, W) bool: pixels where the full scan has points, with gaps between them closed."""
        seen = project_scan(self.original_scan(), view)
        hit = np.zeros(view.width * view.height, bool)
        hit[seen.index.numpy()] = True
        apart = view.fl * self.spacing / float(seen.z.median()) if len(seen.z) else 1.0
        return _closed(hit.reshape(view.height, view.width), int(np.clip(np.ceil(CLOSING * apart), 1, MAX_CLOSING)))


class CoveredPicture:
    """A photograph of a place, valid only where the place's scan covers it."""

    def __init__(self, place: PhotoPlace, photograph: TruePicture):
        self.photograph = photograph
        self._place = place
        self._known: np.ndarray | None = None  # packed bits: a place may have hundreds of photographs

    @property
    def name(self) -> str:
        """The photograph's."""
        return self.photograph.name

    @property
    def width(self) -> int:
        return self.photograph.width

    @property
    def height(self) -> int:
        return self.photograph.height

    @property
    def fl(self) -> float:
        return self.photograph.fl

    @property
    def cx(self) -> float:
        return self.photograph.cx

    @property
    def cy(self) -> float:
        return self.photograph.cy

    @property
    def camera_to_world(self) -> np.ndarray:
        return self.photograph.camera_to_world

    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, sRGB."""
        return self.photograph.rgb()

    def depth(self) -> np.ndarray | None:
        """(H, W) float32 metres or None."""
        return self.photograph.depth()

    def coverage(self) -> np.ndarray | None:
        """(H, W) float32 or None."""
        return self.photograph.coverage()

    def known(self) -> np.ndarray:
        """(H, W) bool."""
        if self._known is None:
            usable = self.photograph.known()
            covered = self._place.covered(self.photograph)
            self._known = np.packbits(covered if usable is None else covered & usable)
        shape = self.photograph.height, self.photograph.width
        return np.unpackbits(self._known, count=shape[0] * shape[1]).astype(bool).reshape(shape)


def _closed(hit: np.ndarray, radius: int) -> np.ndarray:
    """Morphological closing of gaps up to twice the radius wide; the border of the picture opens no gap."""
    side = 2 * radius + 1
    return minimum_filter(maximum_filter(hit, side, mode="constant", cval=0), side, mode="constant", cval=1)


def _invented(xyz: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(N,) uint8: a random station for every point, of ``count`` at random points; probability falls with squared distance."""
    centres = xyz[rng.choice(len(xyz), count)]
    softening = 1e-3 * float(np.ptp(xyz, axis=0).max()) ** 2 + 1e-12
    best = np.full(len(xyz), -np.inf, np.float32)
    station = np.zeros(len(xyz), np.uint8)
    for number, centre in enumerate(centres):
        score = -np.log(((xyz - centre) ** 2).sum(1) + softening).astype(np.float32)
        score += rng.gumbel(size=len(xyz)).astype(np.float32)
        better = score > best
        best[better], station[better] = score[better], number
    return station
