"""Straight lines that meet, as polylines: corners at the intersection of both lines, continuations in one line.

The last step of :func:`viewer.work.sheets.cut_lines.trace`.  Frame: paper coordinates (right, up), float64, file units.
"""

from dataclasses import dataclass, replace

import numpy as np

_CORNER = np.sin(np.radians(10.0))
"""Sine of the angle between two lines from which they meet at their intersection; below, it is too uncertain along them."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of a line.  place: (2,) on it.  direction: (2,) unit.  low, high: its ends along ``direction``, from ``place``."""

    place: np.ndarray
    direction: np.ndarray
    low: float
    high: float

    @property
    def across(self) -> np.ndarray:
        """(2,) unit vector at right angles, to the left."""
        return np.array([-self.direction[1], self.direction[0]])

    @property
    def length(self) -> float:
        return self.high - self.low

    @property
    def middle(self) -> np.ndarray:
        """(2,)"""
        return self.at((self.low + self.high) / 2)

    def at(self, along: float) -> np.ndarray:
        """(2,): the place so far along the line."""
        return self.place + along * self.direction

    def coordinates(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n,) along the line and (n,) to its left, of places (n, 2)."""
        way = places - self.place
        return way @ self.direction, way @ self.across

    def moved_to(self, other: "Segment") -> "Segment":
        """This line with the direction and the ends of ``other``, measured along this one."""
        line = self if self.direction @ other.direction >= 0 else replace(self, direction=-self.direction)
        low, high = line.coordinates(np.array([other.at(other.low), other.at(other.high)]))[0]
        return replace(line, low=float(low), high=float(high))


def joined(segments: list[Segment], reach: float, tolerance: float) -> list[tuple[np.ndarray, bool]]:
    """Polylines (vertices (k, 2), closed) of segments.

    reach: how far a corner may lie from the ends that it joins.  tolerance: how far two lines that continue each other may lie
    apart, and how far a vertex that is left out may lie from the line.
    """
    ends = np.array([segment.at(value) for segment in segments for value in (segment.low, segment.high)]).reshape(-1, 2)
    partner = np.full(len(ends), -1)
    for _, first, second, place in sorted(_meetings(segments, ends, reach, tolerance), key=lambda each: each[:3]):
        if partner[first] < 0 and partner[second] < 0:
            partner[first], partner[second] = second, first
            ends[first] = ends[second] = place
    _meet_in_between(segments, ends, partner, reach)
    return [(_simplified(np.array(vertices), closed, tolerance), closed) for vertices, closed in _chains(ends, partner)]


def _meetings(segments: list[Segment], ends: np.ndarray, reach: float,
              tolerance: float) -> list[tuple[float, int, int, np.ndarray]]:  # fmt: skip
    """(distance moved, end, end, place) of every two ends that may be joined.  Ends 2 i and 2 i + 1 are those of segment i."""
    from scipy.spatial import KDTree

    found = []
    if not len(ends):
        return found
    for first, second in sorted(KDTree(ends).query_pairs(2.0 * reach)):
        one, other = segments[first // 2], segments[second // 2]
        if one is other:
            continue
        sine = one.direction @ other.across
        if abs(sine) >= _CORNER:
            place = one.at(float((other.place - one.place) @ other.across / sine))
            away = [float(np.linalg.norm(place - ends[end])) for end in (first, second)]
            if max(away) <= reach:
                found.append((sum(away), first, second, place))
            continue
        apart = ends[second] - ends[first]
        outward = one.direction * (1 if first % 2 else -1)
        opposite = (other.direction * (1 if second % 2 else -1)) @ outward < 0
        if opposite and np.linalg.norm(apart) <= reach and abs(apart @ one.across) <= 2 * tolerance:
            found.append((float(np.linalg.norm(apart)), first, second, (ends[first] + ends[second]) / 2))
    return found


def _meet_in_between(segments: list[Segment], ends: np.ndarray, partner: np.ndarray, reach: float) -> None:
    """Moves free ends to a line that they meet between its ends, where that is within reach."""
    if not segments:
        return
    places, directions, low, high = (np.array([getattr(segment, name) for segment in segments])
                                     for name in ("place", "direction", "low", "high"))  # fmt: skip
    across = np.stack([-directions[:, 1], directions[:, 0]], axis=1)
    for end in np.flatnonzero(partner < 0):
        own = segments[end // 2]
        sine = across @ own.direction
        with np.errstate(divide="ignore", invalid="ignore"):
            way = -((ends[end] - places) * across).sum(axis=1) / sine
        along = ((ends[end] + way[:, None] * own.direction - places) * directions).sum(axis=1)
        meets = (np.abs(sine) >= _CORNER) & (np.abs(way) <= reach) & (along > low) & (along < high)
        if meets.any():
            nearest = np.flatnonzero(meets)[np.argmin(np.abs(way[meets]))]
            ends[end] = ends[end] + way[nearest] * own.direction


def _chains(ends: np.ndarray, partner: np.ndarray) -> list[tuple[list[np.ndarray], bool]]:
    """Walks from end to end; those of a closed chain begin anywhere."""
    chains, seen = [], np.zeros(len(ends) // 2, bool)
    for start in [*np.flatnonzero(partner < 0), *np.flatnonzero(partner >= 0)]:
        if seen[start // 2]:
            continue
        vertices, end = [ends[start]], int(start)
        while not seen[end // 2]:
            seen[end // 2] = True
            other = end ^ 1
            vertices.append(ends[other])
            end = int(partner[other])
            if end < 0:
                break
        closed = end >= 0
        chains.append((vertices[:-1] if closed else vertices, closed and len(vertices) > 3))
    return chains


def _simplified(vertices: np.ndarray, closed: bool, tolerance: float) -> np.ndarray:
    """Without the vertices that lie within ``tolerance`` of the line that stays (Douglas and Peucker)."""
    if closed:
        ring = np.concatenate([vertices, vertices[:1]])
        far = int(np.argmax(np.linalg.norm(vertices - vertices[0], axis=1)))
        halves = [_simplified(ring[: far + 1], False, tolerance), _simplified(ring[far:], False, tolerance)]
        return np.concatenate([halves[0][:-1], halves[1][:-1]])
    keep = np.zeros(len(vertices), bool)
    keep[[0, -1]] = True
    parts = [(0, len(vertices) - 1)]
    while parts:
        first, last = parts.pop()
        if last - first < 2:
            continue
        way = vertices[last] - vertices[first]
        length = np.linalg.norm(way)
        between = vertices[first + 1 : last] - vertices[first]
        away = (np.abs(between[:, 0] * way[1] - between[:, 1] * way[0]) / length if length > 0
                else np.linalg.norm(between, axis=1))  # fmt: skip
        at = int(np.argmax(away))
        if away[at] > tolerance:
            middle = first + 1 + at
            keep[middle] = True
            parts += [(first, middle), (middle, last)]
    return vertices[keep]
