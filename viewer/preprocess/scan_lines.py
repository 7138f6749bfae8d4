"""Infers scanner positions from the order of a file's points: each scan line lies in a plane through the scanner.

A scanner measures line after line, and most files keep that order, thinned or not, station after station.  Consecutive points
then belong to one line or a few, in a plane through the scanner, and the planes of a station intersect in one point.  Points in
another order form no such planes, or only those of the surfaces, which have few directions, while scan lines have many.
If the scanner turns about an axis, all its planes contain that axis.  The position along the axis follows from the steps
between
points: only as seen from the scanner they are equal in angle.  (Rows of equal elevation are cones, not planes, and give
nothing.)
Frame: the file's.  All thresholds are relative or angles.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .scan_line_kernels import through

# Constants without another origin were checked on the rooms of tests/unit/grid/test_scanner_positions.py, one at a time.
# Twice the tolerance, half of _TRIES and _JUDGES, and 0.2 and 0.6 for _SHARE find the same stations; half the tolerance, half
# and twice of _LEAST, and 0.5 and 0.9 for _MOSTLY do not.
WINDOW = 512
"""Consecutive points that are examined together."""
_WIDTHS = (16, 32, 64, 128, 256, 512)  # consecutive points that may form a plane; one of these for a whole file
_FLAT, _WIDE = 0.05, 0.15  # of a plane: largest thickness / narrow side, smallest narrow side / long side
_TOLERANCE = 0.01  # radians between a plane and the direction from it to the scanner
_TRIES, _JUDGES = 300, 400  # RANSAC: triples of planes, and planes that vote on the triples' intersections
_LEVELS = 8  # a station has at least 2**-_LEVELS of a file
_LEAST, _SHARE, _MOSTLY = 24, 0.4, 0.75
"""Planes that must agree on a station; their share where it is searched; their share between its first and last: where stations
alternate, as in a file of blocks, points of one would be assigned to the other."""
_AROUND = 31  # planes of the moving average that locates where a station begins and ends
_VARIETY = 12.0
"""Directions of the planes of a station, at least, as a number of equally frequent ones: measured 15 to 62 for stations, at
most 4 for the surfaces of a room."""
_SAME = 0.05  # of the mean distance to the points: stations closer to each other are one
_COVERED = 0.8  # share of the planes that must belong to a station
_ACROSS, _LYING = 0.3, 0.95  # cosines between normal and axis: planes below contain it, nearly; planes above are floors
_LINES, _SHORT, _HEIGHTS = 3000, 32, 41
"""Lines that are examined for a station's height, points of each, and heights tried along its axis, in each of two rounds."""


@dataclass(frozen=True)
class Station:
    """position: (3,) of the scanner.  first, last: the windows that are its sweeps."""

    position: np.ndarray
    first: int
    last: int


def find_stations(windows: np.ndarray) -> list[Station]:
    """The stations in file order; none where the order gives none.  windows: (N, WINDOW, 3) float64, stretches of consecutive
    points, evenly from the whole file."""
    if len(windows) < 2 * _LEAST:
        return []
    window, every = _lines(windows)
    middle, normal, flat = _planes(every)
    number, lines, middle, normal = np.flatnonzero(flat), every[flat], middle[flat], normal[flat]
    groups = [g for g in _groups(middle, normal, np.random.default_rng(0)) if len(g) >= _MOSTLY * (g[-1] - g[0] + 1)]
    if sum(group[-1] - group[0] + 1 for group in groups) < _COVERED * max(len(middle), 1):
        return []
    found: list[tuple[np.ndarray, np.ndarray]] = []
    for group in groups:
        place = _place(lines[group], middle[group], normal[group])
        if found and np.linalg.norm(place - found[-1][1]) < _SAME * np.linalg.norm(middle[group] - place, axis=1).mean():
            group = np.concatenate([found.pop()[0], group])  # the same station, interrupted by a stretch
            place = _place(lines[group], middle[group], normal[group])
        found.append((group, place))
    if min(_variety(normal[group]) for group, _ in found) < _VARIETY:
        return []
    first, last = ([int(number[group[end]]) for group, _ in found] for end in (0, -1))
    for station, (before, after) in enumerate(pairwise(place for _, place in found)):
        first[station + 1] = _turn(every, before, after, last[station], first[station + 1])
        last[station] = first[station + 1] - 1
    return [Station(place, int(window[a]), int(window[b])) for (_, place), a, b in zip(found, first, last, strict=True)]


def _turn(lines: np.ndarray, before: np.ndarray, after: np.ndarray, last: int, first: int) -> int:
    """The line with which the next station begins, between ``last``, of the station at ``before``, and ``first``, of the
    station at ``after``.  As seen from their own station, lines have steps of similar angles."""
    begin = max(last + 1 - _AROUND, 0)
    one, other = _log_steps(lines[begin:first], before), _log_steps(lines[last + 1 : first + _AROUND], after)
    known, between = last + 1 - begin, first - last - 1
    odd = np.minimum(np.abs(one[known:] - np.median(one[:known])), 1.0)
    odd_after = np.minimum(np.abs(other[:between] - np.median(other[between:])), 1.0)
    cost = np.append(0.0, odd.cumsum()) + np.append(odd_after[::-1].cumsum()[::-1], 0.0)
    return last + 1 + int(cost.argmin())


def _log_steps(lines: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(L,) logarithm of the median angle, seen from a position, between consecutive points of lines (L, width, 3)."""
    way = lines - place
    way /= np.maximum(np.linalg.norm(way, axis=2, keepdims=True), 1e-300)
    return np.log(np.maximum(np.median(np.linalg.norm(np.diff(way, axis=1), axis=2), axis=1), 1e-12))


def _lines(windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stretches (L, width, 3) of the width at which most are planes, and the window of each."""
    best, share = _WIDTHS[0], -1.0
    some = windows[:: -(-len(windows) // 1024)]
    for width in _WIDTHS:
        found = _planes(some[:, :width])[2].mean()
        if found > share:
            best, share = width, found
    each = min(WINDOW // best, 2)
    lines = windows[:, : each * best].reshape(-1, best, 3)
    return np.repeat(np.arange(len(windows)), each), lines


def _planes(lines: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centre and normal (L, 3) of the planes fitted to (L, width, 3) points, and whether the points form a plane."""
    middle = lines.mean(axis=1)
    around = lines - middle[:, None]
    squares, axes = np.linalg.eigh(around.transpose(0, 2, 1) @ around)
    thick, narrow, long = np.sqrt(np.maximum(squares, 0.0)).T
    return middle, axes[:, :, 0], (narrow > _WIDE * long) & (thick < _FLAT * narrow)


def _meeting(middle: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The point closest to all planes; along directions that they leave open, closest to the mean of their centres."""
    mean = middle.mean(axis=0)
    square, axes = np.linalg.eigh(normal.T @ normal / len(normal))
    determined = square > 0.01
    towards = (normal * ((middle - mean) * normal).sum(axis=1)[:, None]).mean(axis=0) @ axes
    return mean + axes[:, determined] @ (towards[determined] / square[determined])


def _through(places: np.ndarray, middle: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(K, P) bool: which planes pass through which of (K, 3) positions."""
    return through(places, middle, normal, _TOLERANCE)


def _search(middle: np.ndarray, normal: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """(P,) bool: the planes through the point through which most of them pass."""
    three = random.integers(len(middle), size=(_TRIES, 3))
    mean = middle.mean(axis=0)
    along = ((middle[three] - mean) * normal[three]).sum(axis=2)
    left, size, right = np.linalg.svd(normal[three])
    inverse = np.where(size > 0.1, 1 / np.maximum(size, 0.1), 0.0)
    places = mean + np.einsum("kji,kj->ki", right, inverse * np.einsum("kij,ki->kj", left, along))
    judges = random.integers(len(middle), size=_JUDGES)
    places = places[size[:, 1] > 0.1]
    if len(places) == 0:
        return np.zeros(len(middle), bool)
    votes = _through(places, middle[judges], normal[judges]).sum(axis=1)
    best = _through(places[[votes.argmax()]], middle, normal)[0]
    for _ in range(4):
        if best.sum() < 6:
            break
        best = _through(_meeting(middle[best], normal[best])[None], middle, normal)[0]
    return best


def _groups(middle: np.ndarray, normal: np.ndarray, random: np.random.Generator) -> list[np.ndarray]:
    """Planes that intersect, by station, in file order: searched in the whole file, then in halves, and so on."""
    count = len(middle)
    found, free = [], np.ones(count, bool)
    for level in range(_LEVELS):
        size = count >> level
        for start in range(0, count - size + 1, max(size // 2, 1)) if size >= 2 * _LEAST else ():
            here = np.flatnonzero(free[start : start + size]) + start
            if len(here) < max(size // 2, 2 * _LEAST):
                continue
            hit = _search(middle[here], normal[here], random)
            if hit.mean() >= _SHARE and len(group := _grown(here[hit], free, middle, normal)):
                found.append(group)
                free[group[0] : group[-1] + 1] = False
    return sorted(found, key=lambda group: group[0])


def _grown(group: np.ndarray, free: np.ndarray, middle: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """All planes of the station that ``group`` belongs to, from its beginning to its end; none where they are too few."""
    for _ in range(3):
        fits = _through(_meeting(middle[group], normal[group])[None], middle, normal)[0] & free
        share = fits[group[0] : group[-1] + 1].mean()
        outside = np.flatnonzero(np.convolve(fits, np.full(_AROUND, 1 / _AROUND), "same") < share / 2)
        seed = group[len(group) // 2]
        before, after = outside[outside < seed], outside[outside > seed]
        first, end = before.max(initial=-1) + 1, after.min(initial=len(fits))
        group = first + np.flatnonzero(fits[first:end])
        if len(group) < _LEAST or len(group) < _SHARE * (group[-1] - group[0] + 1):
            return group[:0]
    return group


def _variety(normal: np.ndarray) -> float:
    """The number of directions of planes: of equally frequent ones that agree by chance as often (inverse Simpson index)."""
    upward = normal * np.where(normal @ (0.1, 0.01, 1.0) < 0, -1.0, 1.0)[:, None]
    _, counts = np.unique(np.round(12 * upward).astype(int), axis=0, return_counts=True)
    return float(counts.sum() ** 2 / (counts**2).sum())


def _place(lines: np.ndarray, middle: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The scanner position of these planes."""
    tilt = np.abs(normal @ np.linalg.eigh(normal.T @ normal)[1][:, 0])
    if np.count_nonzero((tilt > _ACROSS) & (tilt < _LYING)) >= _LEAST / 2:
        return _meeting(middle[tilt < _LYING], normal[tilt < _LYING])
    across = tilt < _ACROSS
    lines, middle, normal = lines[across], middle[across], normal[across]
    place, axis = _meeting(middle, normal), np.linalg.eigh(normal.T @ normal)[1][:, 0]
    return place + axis * _height(lines - place, axis)


def _height(lines: np.ndarray, axis: np.ndarray) -> float:
    """The position along an axis through zero from which steps are most equal in angle.  lines: (L, width, 3)."""
    lines = lines.reshape(-1, min(_SHORT, lines.shape[1]), 3)
    lines = lines[:: -(-len(lines) // _LINES)]
    along = lines @ axis
    beside = np.linalg.norm(lines - along[:, :, None] * axis, axis=2)
    low, high = np.percentile(along, [1.0, 99.0])
    best = 0.0
    for _ in range(2):
        heights = np.linspace(low, high, _HEIGHTS)
        uneven = [_unevenness(np.arctan2(along - height, beside)) for height in heights]
        best, step = heights[int(np.argmin(uneven))], (high - low) / (_HEIGHTS - 1)
        low, high = best - 2 * step, best + 2 * step
    return float(best)


def _unevenness(angles: np.ndarray) -> float:
    """The spread of the mean step from line to line, in logarithms.  angles: (L, width)."""
    steps = np.abs(np.diff(angles, axis=1))
    jumps = steps > 8 * np.median(steps, axis=1, keepdims=True)  # between lines, and over directions without a return
    mean = np.where(jumps, 0.0, steps).sum(axis=1) / np.maximum((~jumps).sum(axis=1), 1)
    return float(np.subtract(*np.percentile(np.log(np.maximum(mean, 1e-12)), [80.0, 20.0])))
