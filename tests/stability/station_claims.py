"""Measurements of view-dependent blending at extreme scales, origins and scanner positions.

Each point of the place of :mod:`pointglass.viewer.bench.cases.stability` belongs to one of several stations with different
exposures, so that a wrong weight changes the picture.  The weights of the exact picture are computed in float64 from the
original points and scanner positions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from exact_claims import Agreement, agreement, exact_picture
from frame_claims import place_at
from scenes import axis_camera

from pointglass.model.reference.station_constants import HEAVIEST
from pointglass.viewer.bench.cases import stability
from pointglass.viewer.bench.cases.stability import (
    GRAIN,
    ROOM,
    Renderers,
    arrays_of,
    different,
    direction,
    placed,
    row,
    view_inside,
    walls,
)
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import Scene
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary
from pointglass.viewer.render.renderer import RASTERISERS

LEAST = 40.0
"""Least PSNR of filled pictures against the exact ones, dB.  Weights are integers, some of which are rounded differently."""
_DULLEST = 0.5
"""Least gain of a colour channel of a station.  Chosen by hand."""


@dataclass(frozen=True)
class Scanned:
    """A scan with scanner positions.

    xyz (N, 3) float64, rgb (N, 3) uint8, scan (N,) uint8 station of each point, places (S, 3) float64, file coordinates; and
    its scene.
    """

    xyz: np.ndarray
    rgb: np.ndarray
    scan: np.ndarray
    places: np.ndarray
    scene: Scene

    def truth(self, camera):
        """The exact picture; scanner positions that the scene rejects count as unknown."""
        places = np.where(np.isnan(self.scene.station_places), np.nan, self.places[:255])
        return exact_picture(self.xyz, self.rgb, camera, self.scene.spacing, self.scan, places)

    def agreement(self, made: dict[str, np.ndarray], camera) -> Agreement:
        """Agreement of a frame with the exact picture."""
        return agreement(made["depth"], made["mask"], made["filled"], self.truth(camera), self.scene.spacing)


def standing(seed: int, stations: int) -> np.ndarray:
    """(S, 3) random scanner positions in the room, place units, multiples of 2**-20."""
    return np.round(np.random.default_rng(seed).uniform(0.1, 0.9, (stations, 3)) * ROOM * GRAIN) / GRAIN


def lit(seed: int, rgb: np.ndarray, stations: int) -> tuple[np.ndarray, np.ndarray]:
    """rgb (N, 3) with the exposure of a random station, and its number (N,) uint8; stations from the 256th share a number."""
    rng = np.random.default_rng(seed)
    scan = rng.integers(0, stations, len(rgb))
    lights = rng.uniform(_DULLEST, 1.0, (stations, 3))
    return np.rint(rgb * lights[scan]).astype(np.uint8), np.minimum(scan, 255).astype(np.uint8)


def scene_of(xyz: np.ndarray, rgb: np.ndarray, scan: np.ndarray, places: np.ndarray) -> Scene:
    """A scene with scanner positions; NaN: unknown."""
    scans = tuple(ScanSummary(f"station {number}", int((scan == number).sum()), None if np.isnan(place).any() else
                              tuple(place.tolist())) for number, place in enumerate(places))
    return scene_from_arrays(xyz, rgb, scan=scan, meta=ScanDescription(scans=scans), noise=False)  # nothing is averaged


def scanned(seed: int, scale: float = 1.0, away: float = 0.0, stations: int = 3, places: np.ndarray | None = None) -> Scanned:
    """The scanned place at a scale and origin.  places: (S, 3) place units, NaN if unknown; None: random in the room."""
    xyz, rgb, origin = place_at(seed, scale, away)
    places = (standing(seed, stations) if places is None else places) * scale + origin
    rgb, scan = lit(seed, rgb, len(places))
    return Scanned(xyz, rgb, scan, places, scene_of(xyz, rgb, scan, places))


def anywhere(renderers: Renderers, seed: int, size: tuple[int, int], scales: Sequence[float], origins: Sequence[float],
             views: int = 3) -> list[dict]:
    """PSNR of the worst filled picture over all scales, by origin, without scales that are refused as beyond float64."""
    rows = []
    for away in origins:
        worst = []
        for scale in scales:
            try:
                scan = scanned(seed, scale, away)
            except InputError:
                continue  # frame_claims.curves checks which may be refused
            cameras = [placed(view_inside(seed + n, size), scale, direction(seed) * away) for n in range(views)]
            with renderers.renderer(scan.scene) as renderer:
                found = [scan.agreement(arrays_of(renderer, camera, Settings()), camera).filled for camera in cameras]
            worst.append(float(np.median(found)))
        rows.append(row(f"weighted, filled, scales {min(scales):g} to {max(scales):g}, origin {away:g}", min(worst), LEAST,
                        least=True))
    return rows


def exactness(renderers: Renderers, seed: int, size: tuple[int, int], exponents: Sequence[int] = (-10, 20),
              shifts: Sequence[int] = (12, 30)) -> list[dict]:
    """Bytes that differ after scaling by powers of two, and after shifts by whole cells."""
    place, rgb = walls(seed)
    places, (rgb, scan) = standing(seed, 3), lit(seed, rgb, 3)

    def scene_at(factor: float, origin: np.ndarray) -> Scene:
        return scene_of(place * factor + origin, rgb, scan, places * factor + origin)

    return stability.exactness(renderers, seed, size, exponents, shifts, scene_at, "weighted, bytes changed")


def hard_places(renderers: Renderers, seed: int, size: tuple[int, int]) -> list[dict]:
    """Filled pictures with unrealistic scanner positions, and with the camera at a scanner, against the exact ones."""
    base, eye = standing(seed, 3), view_inside(seed, size)
    point = walls(seed)[0][7]
    rows = []
    for name, places in {
        "the camera in a scanner": np.vstack([eye.position, base]),
        "the next float beside a scanner": np.vstack([np.nextafter(eye.position, 9.0), base]),
        "a scanner in a point of the scan": np.vstack([point, base]),
        "a scanner ten extents away": np.vstack([base, direction(seed) * 10 * ROOM.max()]),
        "a scanner at 1e30": np.vstack([base, direction(seed) * 1e30]),
        "scanners unknown but two": np.vstack([base[:2], np.full((3, 3), np.nan)]),
        "all scanners in one line with the camera": eye.position + np.outer((-2.0, -1.0, 1.0, 2.0), direction(seed)),
        "255 scanners": standing(seed, 255),
        "400 scanners": standing(seed, 400),
    }.items():
        scan = scanned(seed, places=places)
        made = renderers.pictures(scan.scene, eye)
        rows.append(row(f"weighted, filled, {name}", scan.agreement(made, eye).filled, LEAST, least=True))
    alike = scanned(seed, places=np.repeat(base[:1], 3, axis=0))
    plain = renderers.pictures(alike.scene, eye, Settings(stations="equal"))
    rows.append(row("bytes changed by scanners at one position", different(plain, renderers.pictures(alike.scene, eye)), 0))
    return rows


def heavy(renderers: Renderers, seed: int, points: int = 1_000_000) -> list[dict]:
    """Colour errors of many white points of the largest or the smallest weight in one pixel, by rasteriser."""
    spread = np.round(np.random.default_rng(seed).uniform(-1, 1, (points, 3)) * 2**20) * 2.0**-30
    xyz, scan = np.array([0.0, 5.0, 0.0]) + spread, (np.arange(points) % 2).astype(np.uint8)
    rows = []
    for name, behind in (("heaviest", 0.0), ("least", 10.0)):  # scanners beside the camera, or behind the points
        places = np.array([[-0.01, behind, 0.0], [0.01, behind, 0.0]])
        scene = scene_of(xyz, np.full(xyz.shape, 255, np.uint8), scan, places)
        with renderers.renderer(scene) as renderer:
            for kind in RASTERISERS:
                frame = renderer.render(axis_camera((3, 3)), Settings(raster=kind), views=("raw",))
                error = 255 - int(frame.image("raw")[1, 1].min())
                alone = int(np.isfinite(frame.depth()).sum() != 1)
                rows.append(row(f"colour error of {points:,} points of the {name} weight (of {HEAVIEST}) in one pixel, {kind}",
                                error + 255 * alone, 0))
    return rows
