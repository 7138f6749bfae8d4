"""Procedural training data: furnished rooms, streets under a sky, and single objects against a background; unlimited and
seeded.

World frame: metres, z up.  Pictures and scans are computed on demand and cached, because those of hundreds of places would not
fit in memory.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ..synth.demo import camera_towards, exposures
from ..synth.outdoors import OpenPlace, single_object, street
from ..synth.panorama import Passer, with_passers
from ..synth.place import Place
from ..synth.rooms import DEPTH, WIDTH
from ..synth.scanner import ScannerModel, VirtualScanner
from .dataset import MemoryPicture, MergedScan, TruePicture

KINDS = ("room", "street", "thing")
CLEAR = 0.35
"""Free distance around a camera or scanner, metres.  This and the share below are those of the shipped weights' training
(assets/weights/README.md)."""
PASSER_SHARE = 0.25
"""Share of the stations in rooms and streets with people passing by."""
_PICTURES = 256
"""Cached pictures, of 3.4 MB each: those of 32 places."""
_SCANS = 3
"""Cached scans, of up to 60 MB each: those of one place."""


@dataclass(eq=False)
class ProceduralPlace:
    """A TruePlace generated from (kind, seed).

    count: number of views.  size: of their pictures, pixels.  pulses: laser pulses of each station.  samples: along a side of a
    pixel.
    """

    kind: str
    seed: int
    count: int = 8
    size: tuple[int, int] = (640, 480)
    pulses: int = 500_000
    samples: int = 2

    @property
    def name(self) -> str:
        return f"{self.kind} {self.seed}"

    @cached_property
    def place(self) -> Place | OpenPlace:
        """The geometry and materials."""
        return {"room": lambda: Place(self.seed, probe_rays=24), "street": lambda: street(self.seed),
                "thing": lambda: single_object(self.seed)}[self.kind]()

    @property
    def views(self) -> Sequence[TruePicture]:
        """Pictures from random positions at eye height in free space, directed at the place."""
        return [ProceduralPicture(self, number) for number in range(self.count)]

    @cached_property
    def lenses(self) -> list[tuple[np.ndarray, float]]:
        """camera_to_world (4, 4) and focal length, pixels, of each view."""
        rng = np.random.default_rng([41, KINDS.index(self.kind), self.seed])
        found: list[tuple[np.ndarray, float]] = []
        while len(found) < self.count:
            eye, target = self._spot(rng), self._target(rng)
            if np.linalg.norm(target - eye) < 0.5 or not self._free(eye, rng):
                continue
            found.append((camera_towards(eye, target), self.size[1] / (2 * np.tan(np.radians(rng.uniform(38, 72)) / 2))))
        return found

    def scan(self, seed: int) -> MergedScan:
        """A scan of two to four stations (objects: two or three) with exposures within 12 % of their mean, cached."""
        return _scan(self, seed)

    def traced(self, seed: int) -> MergedScan:
        """The same, not cached."""
        rng = np.random.default_rng([43, KINDS.index(self.kind), self.seed, seed])
        count = int(rng.integers(2, 4 if self.kind == "thing" else 5))
        spots: list[np.ndarray] = []
        while len(spots) < count:
            spot = self._spot(rng)
            if self._free(spot, rng):
                spots.append(spot)
        # a single object fills little of the field of view; a narrower, denser field gives it a realistic number of points
        field = {"lowest": -60.0, "highest": 60.0} if self.kind == "thing" else {}
        model = ScannerModel(farthest=80.0, colour_noise=float(rng.uniform(0.2, 1.5)), **field)
        gains, parts = exposures(int(rng.integers(2**31)), count), []
        for number, spot in enumerate(spots):
            passers = self._passers(spot, rng) if self.kind != "thing" and rng.random() < PASSER_SHARE else []
            trace = with_passers(self.place.trace, passers)
            ranges = None if passers else self.place.ranges
            scanner = VirtualScanner(trace, model, ranges)
            xyz, rgb, _, station, _ = scanner.station(spot, self.pulses, rng, gains[number], number)
            parts.append((xyz, rgb, station))
        xyz, rgb, station = (np.concatenate([part[k] for part in parts]) for k in range(3))
        return MergedScan(xyz, rgb, station, np.stack(spots))

    def picture(self, number: int) -> MemoryPicture:
        """The view of a number, not cached."""
        (pose, fl), (width, height) = self.lenses[number], self.size
        if isinstance(self.place, OpenPlace):
            rgb, depth, coverage = self.place.picture(pose, fl, width, height, self.samples)
            return MemoryPicture(rgb, fl, pose, depth, coverage)
        rgb, depth = self.place.render(pose, fl, fl, width / 2, height / 2, width, height, samples=self.samples)
        return MemoryPicture(rgb, fl, pose, depth)

    def _spot(self, rng: np.random.Generator) -> np.ndarray:
        """A random position of a camera or scanner."""
        if self.kind == "room":
            return np.array([rng.uniform(0.5, WIDTH - 0.5), rng.uniform(0.5, DEPTH - 0.5), rng.uniform(1.2, 1.8)])
        if self.kind == "street":
            return np.array([rng.uniform(-15, 15), rng.uniform(-3.5, 3.5), rng.uniform(1.4, 2.2)])
        angle, away = rng.uniform(0, 2 * np.pi), rng.uniform(1.5, 3.2)
        return np.array([away * np.cos(angle), away * np.sin(angle), rng.uniform(0.4, 1.9)])

    def _target(self, rng: np.random.Generator) -> np.ndarray:
        """A random point that a camera looks at."""
        if self.kind == "room":
            return np.array([rng.uniform(0, WIDTH), rng.uniform(0, DEPTH), rng.uniform(0.4, 1.6)])
        if self.kind == "street":
            return np.array([rng.uniform(-18, 18), rng.choice([-1, 1]) * rng.uniform(0, 7), rng.uniform(0.5, 5.0)])
        return np.array([*rng.normal(0, 0.15, 2), rng.uniform(0.3, 0.8)])

    def _free(self, spot: np.ndarray, rng: np.random.Generator) -> bool:
        rays = rng.normal(size=(64, 3))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        return bool(self.place.ranges(np.broadcast_to(spot, rays.shape).copy(), rays).min() > CLEAR)

    def _passers(self, spot: np.ndarray, rng: np.random.Generator) -> list[Passer]:
        angle, away = rng.uniform(0, 2 * np.pi), rng.uniform(1.2, 3.0)
        foot = np.array([spot[0] + away * np.cos(angle), spot[1] + away * np.sin(angle), 0.02])
        return [Passer(foot, float(rng.uniform(1.5, 1.9)), float(rng.uniform(0.15, 0.28)), rng.uniform(0.1, 0.7) + np.zeros(3))]


@dataclass(frozen=True)
class ProceduralPicture:
    """A TruePicture of a place by its number; it is rendered when its pixels are read, not for its size."""

    place: ProceduralPlace
    number: int

    @property
    def width(self) -> int:
        return self.place.size[0]

    @property
    def height(self) -> int:
        return self.place.size[1]

    @property
    def cx(self) -> float:
        return self.width / 2

    @property
    def cy(self) -> float:
        return self.height / 2

    @property
    def name(self) -> str:
        """Of its number."""
        return f"view{self.number:03d}"

    @property
    def camera_to_world(self) -> np.ndarray:
        return self.place.lenses[self.number][0]

    @property
    def fl(self) -> float:
        return self.place.lenses[self.number][1]

    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, sRGB."""
        return _picture(self).rgb()

    def depth(self) -> np.ndarray | None:
        """(H, W) float32."""
        return _picture(self).depth()

    def coverage(self) -> np.ndarray | None:
        """(H, W) float32; None in a room."""
        return _picture(self).coverage()

    def known(self) -> np.ndarray | None:
        """None: all pixels are valid."""
        return None


@lru_cache(maxsize=_PICTURES)
def _picture(shot: ProceduralPicture) -> MemoryPicture:
    return shot.place.picture(shot.number)


@lru_cache(maxsize=_SCANS)
def _scan(place: ProceduralPlace, seed: int) -> MergedScan:
    return place.traced(seed)


def procedural_place(number: int) -> ProceduralPlace:
    """The place of a number: kinds in turn; a quarter are rooms, which take longest."""
    return ProceduralPlace(("street", "thing", "room", "thing")[number % 4], number)


def procedural_places(seeds: Iterable[int]) -> Iterator[ProceduralPlace]:
    """The places of the given numbers."""
    return map(procedural_place, seeds)
