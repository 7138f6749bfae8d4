"""Simulation of a terrestrial laser scanner in any scene that can be ray traced.

Simulated errors of real instruments: range noise that grows with range and incidence angle; mixed pixels, that is points
between foreground and background where one beam hits both; missing returns from dark, shiny or grazing surfaces; a blind cone
below the tripod; a colour camera whose exposure and white balance differ between stations; and registration errors of a few
millimetres.

Frame: world metres, z up; the scanner is upright at its station.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..common.linear_light import to_linear, to_srgb


@dataclass(frozen=True)
class ScannerModel:
    """Parameters of an invented instrument.  Angles in degrees, lengths in metres.

    lowest, highest: elevation limits; directions below ``lowest`` are the blind cone of the tripod.
    nearest, farthest: limits of the range.
    noise, noise_per_metre: noise standard deviation of the range at normal incidence, constant and per metre of range;
    grazing: relative increase per unit of 1 / cosine - 1.
    divergence: angle between the two simulated rays of one beam.  mixed_span: largest depth step that gives a mixed point; for
    a larger one, the instrument separates the returns.
    dropout: smallest probability that a pulse does not return.
    turn, shift: standard deviations of the registration error, for all stations but the first.
    white_balance: largest relative gain error of red and blue.  colour_noise: standard deviation, 8-bit levels.
    """

    lowest: float = -62.0
    highest: float = 82.0
    nearest: float = 0.35
    farthest: float = 40.0
    noise: float = 0.0009
    noise_per_metre: float = 0.00025
    grazing: float = 0.35
    divergence: float = 0.045
    mixed_span: float = 0.9
    dropout: float = 0.004
    turn: float = 0.012
    shift: float = 0.0015
    white_balance: float = 0.025
    colour_noise: float = 0.8


IDEAL = ScannerModel(
    noise=0, noise_per_metre=0, divergence=0, dropout=0, turn=0, shift=0, white_balance=0, colour_noise=0
)
"""A scanner without errors."""


@dataclass(frozen=True)
class SimulatedScan:
    """A simulated scan of N points from S stations.

    xyz (N,3) float64 metres; rgb (N,3) uint8; intensity (N,) uint16; station (N,) uint8, from 0; positions (S,3) metres;
    exposures (S,) gains of the colour camera, linear light; mixed (N,) bool: ground truth, points between two surfaces.
    """

    xyz: np.ndarray
    rgb: np.ndarray
    intensity: np.ndarray
    station: np.ndarray
    positions: np.ndarray
    exposures: np.ndarray
    mixed: np.ndarray = field(repr=False)

    def __len__(self) -> int:
        return len(self.xyz)

    def taken(self, keep: np.ndarray) -> "SimulatedScan":
        """The scan of the points ``keep`` (indices or a mask)."""
        return SimulatedScan(self.xyz[keep], self.rgb[keep], self.intensity[keep], self.station[keep], self.positions,
                    self.exposures, self.mixed[keep])


def directions(pitch: float, model: ScannerModel) -> np.ndarray:
    """(N,3) unit directions of the pulses, in rings of equal elevation.

    pitch: angle between rings, and between the pulses of a ring, radians.  All rings start at azimuth 0, so that successive
    pulses are neighbours in space.
    """
    low, high = np.radians(model.lowest), np.radians(model.highest)
    rings = max(int((high - low) / pitch), 1)
    elevation = low + (np.arange(rings) + 0.5) * (high - low) / rings
    pulses = np.maximum((2 * np.pi * np.cos(elevation) / pitch).astype(int), 1)
    elevations = np.repeat(elevation, pulses)
    number = np.arange(pulses.sum()) - np.repeat(np.cumsum(pulses) - pulses, pulses)
    azimuth = 2 * np.pi * number / np.repeat(pulses, pulses)
    flat = np.cos(elevations)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevations)], 1)


def pitch_for(pulses: float, model: ScannerModel) -> float:
    """Angle between neighbouring pulses, radians, at which `directions` returns about ``pulses`` of them."""
    area = 2 * np.pi * (np.sin(np.radians(model.highest)) - np.sin(np.radians(model.lowest)))
    return float(np.sqrt(area / pulses))


class VirtualScanner:
    """Scans a scene.

    trace: (origins (N,3), directions (N,3)) -> an object with t (N,), rgb (N,3) sRGB 0..1, normal (N,3),
    shininess (N,), darkness (N,), as `place.Hits`.  ranges: (origins, directions) -> t only, if that is cheaper.
    snap: (N,3) directions of the pulses -> (M,3) those supported, for a scene of discrete directions (`panorama.Panorama`).
    """

    def __init__(self, trace: Callable, model: ScannerModel | None = None, ranges: Callable | None = None,
                 snap: Callable | None = None):
        self.trace, self.snap = trace, snap
        self.model = model or ScannerModel()
        self.ranges = ranges or (lambda origins, rays: trace(origins, rays).t)

    def scan(self, positions, pulses: int, rng: np.random.Generator, exposures=None) -> SimulatedScan:
        """Scans from stations at ``positions`` (S,3), with about ``pulses`` pulses each.

        exposures (S,): camera gains, 1 by default.  The points are ordered by station, then by ring.
        """
        places = np.asarray(positions, np.float64)
        exposures = np.ones(len(places)) if exposures is None else np.asarray(exposures, np.float64)
        parts = [self.station(p, pulses, rng, e, n) for n, (p, e) in enumerate(zip(places, exposures))]
        xyz, rgb, intensity, station, mixed = (np.concatenate(column) for column in zip(*parts))
        return SimulatedScan(xyz, rgb, intensity, station, places, exposures, mixed)

    def station(self, position, pulses: int, rng: np.random.Generator, exposure: float, number: int):
        """Scan of one station: xyz (N,3), rgb (N,3) uint8, intensity (N,) uint16, station (N,) uint8, mixed (N,) bool."""
        m = self.model
        # A random heading, so that the grids of two stations differ.
        heading = rng.uniform(0, 2 * np.pi)
        c, s = np.cos(heading), np.sin(heading)
        rays = directions(pitch_for(pulses, m), m) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        if self.snap is not None:
            rays = self.snap(rays)
        origins = np.broadcast_to(position, rays.shape).copy()
        hits = self.trace(origins, rays)
        t, rgb, mixed = hits.t.copy(), hits.rgb.copy(), np.zeros(len(rays), bool)
        cosine = np.minimum(np.abs(np.einsum("ij,ij->i", hits.normal, rays)), 1)
        if m.divergence > 0:
            self._mix(origins, rays, t, rgb, mixed, rng)
        kept = np.isfinite(t) & (t > m.nearest) & (t < m.farthest)
        kept &= rng.random(len(t)) >= self._loss(cosine, hits.shininess, hits.darkness)
        t, rgb, mixed, cosine, rays = t[kept], rgb[kept], mixed[kept], cosine[kept], rays[kept]
        ranges = t + self.range_sigma(t, cosine) * rng.normal(size=len(t))
        xyz = position + ranges[:, None] * rays
        if number > 0:  # the others are registered to the first station
            turn, shift = np.radians(m.turn) * rng.normal(size=3), m.shift * rng.normal(size=3)
            xyz = xyz + np.cross(turn, xyz - position) + shift
        intensity = self._intensity(hits.darkness[kept], hits.shininess[kept], cosine, t, rng)
        colour = self._photograph(rgb, exposure, rng)
        return xyz, colour, intensity, np.full(len(t), number, np.uint8), mixed

    def _mix(self, origins, rays, t, rgb, mixed, rng) -> None:
        """Mixed pixels: where a second ray of the beam hits another depth, range and colour become a weighted mean (in
        place)."""
        m = self.model
        aside = np.cross(rays, rng.normal(size=rays.shape))
        aside /= np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-12)
        second = rays + np.radians(m.divergence) * aside
        second /= np.linalg.norm(second, axis=1, keepdims=True)
        other = self.ranges(origins, second)
        both = np.isfinite(t) & np.isfinite(other)
        step = np.abs(np.where(both, other - np.where(both, t, 0), 0))
        at = np.flatnonzero((step > 0.02) & (step < m.mixed_span))
        if not len(at):
            return
        share = rng.beta(1.2, 1.2, len(at))
        t[at] += share * (other[at] - t[at])
        rgb[at] += share[:, None] * (self.trace(origins[at], second[at]).rgb - rgb[at])
        mixed[at] = True

    def range_sigma(self, t: np.ndarray, cosine: np.ndarray) -> np.ndarray:
        """(N,) noise standard deviation, metres, of ranges t (N,), metres.  cosine (N,): of the incidence angle."""
        m = self.model
        return (m.noise + m.noise_per_metre * t) * (1 + m.grazing * (1 / np.maximum(cosine, 0.1) - 1))

    def _loss(self, cosine, shininess, darkness) -> np.ndarray:
        """(N,) probability that a pulse does not return."""
        if self.model.dropout == 0:
            return np.zeros(len(cosine))
        dark = 0.4 * np.clip((darkness - 0.9) / 0.1, 0, 1) ** 2
        mirror = 0.8 * shininess**2 * (1 - cosine) ** 0.5
        graze = np.clip((0.09 - cosine) / 0.07, 0, 1)
        return 1 - (1 - self.model.dropout) * (1 - dark) * (1 - mirror) * (1 - graze)

    def _intensity(self, darkness, shininess, cosine, t, rng) -> np.ndarray:
        """(N,) uint16 return intensity, quantised to 96 levels as by real instruments.

        It is the reflectance times a function of the incidence angle, plus a highlight at normal incidence, and decreases
        slowly with the range.
        """
        strength = (0.15 + 0.85 * (1 - darkness)) * (0.35 + 0.65 * cosine) + 0.3 * shininess * cosine**24
        strength = strength * (1 + 0.02 * rng.normal(size=len(t)) * (self.model.colour_noise > 0)) / (1 + 0.02 * t)
        return (np.clip(np.round(strength * 96), 1, 96) * 680).astype(np.uint16)

    def _photograph(self, rgb, exposure: float, rng) -> np.ndarray:
        """(N,3) uint8 colours as the station's camera records them: gain, white balance error, noise.  rgb: (N,3) sRGB 0..1."""
        m = self.model
        gains = exposure * (1 + m.white_balance * rng.uniform(-1, 1, 3) * np.array([1, 0, 1]))
        seen = rgb if np.all(gains == 1) else to_srgb(to_linear(rgb) * gains)
        # Sensor noise is mostly in brightness.
        noise = m.colour_noise * (rng.normal(size=(len(rgb), 1)) + 0.3 * rng.normal(size=rgb.shape))
        return np.clip(np.round(seen * 255 + noise), 0, 255).astype(np.uint8)
