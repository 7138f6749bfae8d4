"""Photographs of a scanned place as truth: lenses straightened, and the paper's recipe for pairs that fit to the pixel.

A photograph is true only where the scan has something, and registered poses are never exact.  So the paper (Vanherck et al.
2025, "Training Data Generation") takes from the projected scan nothing but depth and which pixels are hit, and colours the
points in front with the photograph itself: :meth:`PhotoPlace.photographed`.  Points behind keep the scan's colours, which is
the paper's recipe for unfiltered input, and changes nothing where the filter takes them away.

World frame: the scan's, metres.  Camera frames are OpenGL's.  A pixel spans [i, i + 1], as in COLMAP.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from PIL import Image
from scipy.ndimage import map_coordinates, maximum_filter, minimum_filter

from model.data.pairs import Projected, project_scan, raster_of, scan_spacing
from model.data.truth import DataError, Scan, TruePicture
from model.depth_filter import keep_mask
from model.project import SoftZ

MODELS = {  # focal lengths, distortion parameters (COLMAP's names and order)
    "SIMPLE_PINHOLE": (1, 0), "PINHOLE": (2, 0), "SIMPLE_RADIAL": (1, 1), "RADIAL": (1, 2), "OPENCV": (2, 4),
    "OPENCV_FISHEYE": (2, 4),
}
BRIGHTNESS, CONTRAST, SETS = 20.0, 0.2, (2, 5)
"""The paper's augmentation: 2 to 5 sets of brightness +-20 (of 255) and contrast x0.8 to x1.2, as if from as many stations."""
CLOSING = 1.5  # point spacings: smaller gaps between projected points are covered
LARGEST_CLOSING = 12  # pixels


@dataclass(frozen=True)
class Lens:
    """How a camera maps rays to pixels.  fx, fy, cx, cy: pixels.  bend: distortion in COLMAP's order (OPENCV may have a k3
    behind its four)."""

    model: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    bend: tuple[float, ...] = ()

    @staticmethod
    def colmap(where: str, model: str, width: int, height: int, parameters: Sequence[float]) -> "Lens":
        """A lens from a line of cameras.txt.  where: file and line, for the DataError that refuses it."""
        if model not in MODELS:
            raise DataError(f"{where}: camera model {model!r} is not supported ({', '.join(MODELS)} are)")
        focals, bends = MODELS[model]
        if len(parameters) != focals + 2 + bends:
            raise DataError(f"{where}: {model} has {focals + 2 + bends} parameters, not {len(parameters)}")
        fx, fy = parameters[0], parameters[focals - 1]
        if not (np.all(np.isfinite(parameters)) and fx > 0 and fy > 0 and width > 0 and height > 0):
            raise DataError(f"{where}: {width}x{height} pixels, parameters {list(parameters)}: not a camera")
        return Lens(model, width, height, fx, fy, *parameters[focals : focals + 2], bend=tuple(parameters[focals + 2 :]))

    @property
    def plain(self) -> bool:
        """A pinhole with square pixels already."""
        return not any(self.bend) and self.model != "OPENCV_FISHEYE" and abs(self.fx - self.fy) <= 1e-6 * self.fx

    @property
    def _radial(self) -> tuple[float, ...]:
        """k1, k2, ... of t (1 + k1 t^2 + k2 t^4 + ...)."""
        return (*self.bend[:2], *self.bend[4:]) if self.model == "OPENCV" else self.bend

    @cached_property
    def limit(self) -> float:
        """Largest t (a radius, for a fisheye an angle) before the picture folds back on itself; may be infinite."""
        slope = [(2 * n + 1) * k for n, k in enumerate((1.0, *self._radial))]
        roots = np.roots(slope[::-1]) if any(slope[1:]) else np.zeros(0)
        turns = roots.real[(abs(roots.imag) < 1e-9) & (roots.real > 0)]
        return float(np.sqrt(turns.min())) if len(turns) else np.inf

    def pixel(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where rays (x, y, 1), OpenCV axes, meet the picture: u, v in pixels; NaN beyond the lens's fold."""
        r = np.hypot(x, y)
        t = np.arctan(r) if self.model == "OPENCV_FISHEYE" else r
        t2 = t * t
        scale = np.ones_like(t2)
        for n, k in enumerate(self._radial):
            scale = scale + k * t2 ** (n + 1)
        if self.model == "OPENCV_FISHEYE":
            scale = np.where(r > 1e-12, scale * t / np.maximum(r, 1e-12), 1.0)
        scale = np.where(t <= self.limit, scale, np.nan)
        u, v = x * scale, y * scale
        if self.model == "OPENCV":
            p1, p2 = self.bend[2:4] if self.bend else (0.0, 0.0)
            r2 = r * r
            u, v = u + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), v + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return self.fx * u + self.cx, self.fy * v + self.cy


@lru_cache(maxsize=64)
def straight_focal(lens: Lens) -> float:
    """Focal length, pixels, of the widest pinhole of the lens's size, centred, that sees only what the lens saw."""
    w, h = lens.width, lens.height
    i, j = np.arange(w) + 0.5 - w / 2, np.arange(h) + 0.5 - h / 2
    x = np.concatenate([i, i, np.full(h, i[0]), np.full(h, i[-1])])
    y = np.concatenate([np.full(w, j[0]), np.full(w, j[-1]), j, j])

    def fits(focal: float) -> bool:
        u, v = lens.pixel(x / focal, y / focal)
        return bool(np.all((u >= 0) & (u <= w) & (v >= 0) & (v <= h)))

    low, high = np.log(lens.fx / 50), np.log(lens.fx * 50)
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (low, middle) if fits(np.exp(middle)) else (middle, high)
    if not fits(np.exp(high)):
        raise DataError(f"{lens}: no pinhole picture fits inside this lens's; is its principal point outside the picture?")
    return float(np.exp(high))


@lru_cache(maxsize=2)
def straight_map(lens: Lens) -> np.ndarray:
    """(2, H, W) float32: row and column of the lens's picture, pixel centres at whole numbers, for each straightened pixel."""
    focal = straight_focal(lens)
    y, x = np.mgrid[0 : lens.height, 0 : lens.width] + 0.5
    u, v = lens.pixel((x - lens.width / 2) / focal, (y - lens.height / 2) / focal)
    return np.stack([v - 0.5, u - 0.5]).astype(np.float32)


def straighten(picture: np.ndarray, lens: Lens) -> np.ndarray:
    """(H, W) or (H, W, C) uint8 -> the same through :func:`straight_focal`'s pinhole, bilinear."""
    layers = picture[..., None] if picture.ndim == 2 else picture
    where = straight_map(lens)
    out = [map_coordinates(layers[..., c].astype(np.float32), where, order=1, mode="nearest") for c in range(layers.shape[2])]
    return np.rint(np.stack(out, -1)).astype(np.uint8).reshape(picture.shape)


@dataclass(frozen=True, eq=False)
class Photograph:
    """A TruePicture on disk, straightened to a pinhole with square pixels when it is read.

    mask: a picture of the same size that is 255 where the photograph is usable (not anonymised), or None.
    """

    path: Path
    lens: Lens
    camera_to_world: np.ndarray
    mask: Path | None = None

    @property
    def width(self) -> int:
        return self.lens.width

    @property
    def height(self) -> int:
        return self.lens.height

    @property
    def fl(self) -> float:
        return self.lens.fx if self.lens.plain else straight_focal(self.lens)

    @property
    def cx(self) -> float:
        return self.lens.cx if self.lens.plain else self.width / 2

    @property
    def cy(self) -> float:
        return self.lens.cy if self.lens.plain else self.height / 2

    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, sRGB."""
        picture = np.asarray(Image.open(self.path).convert("RGB"))
        return picture if self.lens.plain else straighten(picture, self.lens)

    def depth(self) -> np.ndarray | None:
        """A photograph has none."""
        return None

    def coverage(self) -> np.ndarray | None:
        """A photograph shows something everywhere."""
        return None

    def known(self) -> np.ndarray | None:
        """(H, W) bool, True where the mask says usable; None without a mask."""
        if self.mask is None:
            return None
        usable = np.asarray(Image.open(self.mask).convert("L"))
        return (usable if self.lens.plain else straighten(usable, self.lens)) == 255


def check_pictures(where: Path, wanted: Iterable[tuple[Path, tuple[int, int] | None]]) -> None:
    """Decodes every picture (a torn file has a good header).  wanted: files and their (width, height), None for any.

    DataError names the first ten files that are missing, unreadable or of another size.
    """
    wanted = list(dict.fromkeys(wanted))
    with ThreadPoolExecutor() as pool:
        wrong = [text for text in pool.map(lambda item: _wrong(where, *item), wanted) if text]
    if wrong:
        more = f" and {len(wrong) - 10} more" if len(wrong) > 10 else ""
        raise DataError(f"{where}: {len(wrong)} of {len(wanted)} files cannot be used: {'; '.join(wrong[:10])}{more}; "
                        "download or extract them again")


def _wrong(where: Path, path: Path, size: tuple[int, int] | None) -> str | None:
    name = path.relative_to(where) if path.is_relative_to(where) else path
    if not path.is_file():
        return f"{name} is missing"
    try:
        if path.suffix == ".npy":
            rows, columns = np.load(path, mmap_mode="r").shape
            found = (columns, rows)
        else:
            with Image.open(path) as image:
                image.load()
                found = image.size
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        return f"{name} cannot be read ({error})"
    return None if size in (None, found) else f"{name} has {found[0]}x{found[1]} pixels, not {size[0]}x{size[1]}"


@dataclass(frozen=True)
class Tones:
    """Brightness (S,) added and contrast (S,) multiplied, one of each a station."""

    brightness: np.ndarray
    contrast: np.ndarray

    def apply(self, rgb: np.ndarray, station: np.ndarray) -> np.ndarray:
        """(N, 3) uint8 colours as the stations (N,) would have taken them."""
        changed = rgb * self.contrast[station, None] + self.brightness[station, None]
        return np.clip(np.rint(changed), 0, 255).astype(np.uint8)


class PhotoPlace:
    """A TruePlace of one scan and photographs of it.

    scan: the scan, or how to get it (then only the place used last holds its own).  Pictures are known where the whole scan,
    gaps between its points closed, has something and the photograph itself is usable; nothing is learned elsewhere.
    """

    _latest: ClassVar["tuple[PhotoPlace, Scan] | None"] = None

    def __init__(self, name: str, scan: Scan | Callable[[], Scan], photographs: Sequence[TruePicture]):
        self.name = name
        self._scan = scan
        self.views: Sequence[TruePicture] = [CoveredPicture(self, photograph) for photograph in photographs]

    def unspoiled(self) -> Scan:
        """The scan as it was taken."""
        if isinstance(self._scan, Scan):
            return self._scan
        if PhotoPlace._latest is None or PhotoPlace._latest[0] is not self:
            PhotoPlace._latest = None
            PhotoPlace._latest = (self, self._scan())
        return PhotoPlace._latest[1]

    @cached_property
    def spacing(self) -> float:
        """Median spacing of the whole scan, metres."""
        return scan_spacing(self.unspoiled())

    def scan(self, seed: int) -> Scan:
        """The scan in the tones of its stations; a scan that is one station's is divided among invented ones, each point
        more likely to the nearer, so that they meet and mix as merged scans do."""
        scan = self.unspoiled()
        if not len(scan.xyz):
            raise DataError(f"{self.name}: its scan holds no points")
        tones, own = self._tones(seed)
        station = scan.station if own else _invented(scan.xyz, len(tones.contrast), np.random.default_rng([seed, 3]))
        return replace(scan, rgb=tones.apply(scan.rgb, station), station=station)

    def _tones(self, seed: int) -> tuple[Tones, bool]:
        """Tones of each station, whose means are no change at all: a brightness that nothing in the scan could tell would
        otherwise be judged.  Also whether the stations are the scan's own."""
        rng = np.random.default_rng([seed, 2])
        stations = int(self.unspoiled().station.max(initial=0)) + 1
        count = stations if stations > 1 else int(rng.integers(SETS[0], SETS[1] + 1))
        brightness, contrast = rng.uniform(-BRIGHTNESS, BRIGHTNESS, count), 1 + rng.uniform(-CONTRAST, CONTRAST, count)
        return Tones(brightness - brightness.mean(), contrast / contrast.mean()), stations > 1

    def photographed(self, seen: Projected, view: TruePicture, seed: int, *, toned: bool = True) -> Projected:
        """The projected points of ``scan(seed)``, those in front coloured by the photograph, in their station's tones.

        seen: all points of the scan in this view (perhaps in a picture a whole number of times smaller).  toned: False where
        the stations' exposures have been matched.  In front is what the depth filter keeps of all points; the others, and
        those on unusable pixels, keep the scan's colours.
        """
        camera = seen.camera
        reduce = view.width // camera.width
        raster = raster_of(seen, torch.ones(len(seen.z), dtype=torch.bool), self.spacing)
        soft = SoftZ.preset("auto", self.spacing, 1.0)
        farthest = torch.maximum(raster.depth * (1 + soft.relative), raster.depth + soft.absolute)
        usable = view.photograph.known() if isinstance(view, CoveredPicture) else view.known()
        front = keep_mask(raster.depth)
        if usable is not None:
            front &= torch.from_numpy(_blocks(usable, reduce).min((1, 3)))
        chosen = front.flatten()[seen.index] & (seen.z <= farthest.flatten()[seen.index])
        photo = np.rint(_blocks(view.rgb(), reduce).mean((1, 3))).astype(np.uint8).reshape(-1, 3)
        tones, _ = self._tones(seed)
        rgb = seen.rgb.clone()
        colours = photo[seen.index[chosen].numpy()]
        rgb[chosen] = torch.from_numpy(tones.apply(colours, seen.station[chosen].numpy()) if toned else colours)
        return replace(seen, rgb=rgb)

    def covered(self, view: TruePicture) -> np.ndarray:
        """(H, W) bool: pixels where the whole scan has something, gaps between its points closed."""
        seen = project_scan(self.unspoiled(), view)
        hit = np.zeros(view.width * view.height, bool)
        hit[seen.index.numpy()] = True
        apart = view.fl * self.spacing / float(seen.z.median()) if len(seen.z) else 1.0
        return _closed(hit.reshape(view.height, view.width), int(np.clip(np.ceil(CLOSING * apart), 1, LARGEST_CLOSING)))


class CoveredPicture:
    """A photograph of a place, known only where the place's scan covers it."""

    def __init__(self, place: PhotoPlace, photograph: TruePicture):
        self.photograph = photograph
        self._place = place
        self._known: np.ndarray | None = None  # packed bits: there may be hundreds

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


def _blocks(picture: np.ndarray, side: int) -> np.ndarray:
    """(H, W, ...) -> (H / side, side, W / side, side, ...)."""
    h, w = picture.shape[0] // side, picture.shape[1] // side
    return picture[: h * side, : w * side].reshape(h, side, w, side, *picture.shape[2:])


def _closed(hit: np.ndarray, radius: int) -> np.ndarray:
    """Gaps of up to twice the radius closed; what lies beyond the picture opens none."""
    side = 2 * radius + 1
    return minimum_filter(maximum_filter(hit, side, mode="constant", cval=0), side, mode="constant", cval=1)


def _invented(xyz: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(N,) uint8: a station for every point, of ``count`` that stand at random points; chances fall with distance squared."""
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
