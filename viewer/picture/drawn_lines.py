"""Where lines and labels of world points lie in a picture: cut off behind the camera and beyond the edges, and no label over
another.  The window and saved pictures draw them alike.  Plain NumPy; pixels as viewer.picture.camera has them.
"""

from collections.abc import Sequence

import numpy as np

from .camera import Camera

Area = tuple[float, float, float, float]
"""Left, top, width and height."""
_SIDES = ((1, -1), (1, 1), (-1, -1), (-1, 1), (1, 0), (-1, 0), (0, -1), (0, 1))
"""Of a point, to the right and downwards, in the order in which labels are put there: its corners first."""
_BESIDE, _CLEAR = 1.5, 2.5
"""Multiples of the gap: a label farther from its point has a line to it; and so far off a place is looked for that is clearly
nearer to it than to every other mark."""
_SURE = 0.6
"""Of the distance to the nearest other mark: a label that is farther from its own than so has a line to it.  By eye: at 0.9 a
label lay over the next mark."""
_NEAR = 1e-6  # of the farthest depth of a line: where it is cut off in front of the camera


def in_front(camera: Camera, a: np.ndarray, b: np.ndarray) -> np.ndarray | None:
    """(2, 2) pixels of the part of a line between two world points that lies in front of the camera; None where none does."""
    depths = camera.project([a, b])[1]
    near = _NEAR * max(float(np.abs(depths).max()), 1e-300)
    if (depths < near).all():
        return None
    if (depths < near).any():
        share = (near - depths[0]) / (depths[1] - depths[0])
        cut = a + share * (b - a)
        a, b = (cut, b) if depths[0] < near else (a, cut)
    return camera.project([a, b])[0]


def clipped(start: np.ndarray, end: np.ndarray, area: Area, margin: float) -> tuple[list[float], list[float]] | None:
    """The part of a line within ``area`` and a margin (Liang-Barsky), or None: what draws has no use for coordinates of 1e9."""
    low = np.array(area[:2]) - margin
    high = low + np.array(area[2:]) + 2 * margin
    first, last, along = 0.0, 1.0, end - start
    for axis in (0, 1):
        if along[axis] == 0.0:
            if not low[axis] <= start[axis] <= high[axis]:
                return None
            continue
        a, b = sorted(((low[axis] - start[axis]) / along[axis], (high[axis] - start[axis]) / along[axis]))
        first, last = max(first, a), min(last, b)
    return None if first > last else ((start + first * along).tolist(), (start + last * along).tolist())


def kept_inside(left: float, top: float, size: Sequence[float], area: Area, edge: float) -> tuple[float, float]:
    """The left and top of a plate, moved so far that it lies in ``area``, ``edge`` off its borders."""
    x, y = (float(np.clip(at, low + edge, max(low + span - side - edge, low + edge)))
            for at, low, span, side in zip((left, top), area[:2], area[2:], size, strict=True))  # fmt: skip
    return x, y


def label_places(places: np.ndarray, depths: np.ndarray, sizes: Sequence[Sequence[float]], gap: float, area: Area,
                 edge: float, taken: Sequence[Area] = (), reaches: Sequence[float] = (1.0,),
                 marks: Sequence[Sequence[float]] = ()) -> dict[int, tuple[float, float]]:
    """The left and top of each label, none over another: in the first free place beside its point that is clearly nearer to it
    than to every other, else where it is most so; the nearest points first; one without a free place is left out.

    taken: where labels lie already.  reaches: multiples of the gap that are tried, one after the other.  marks: (m, 2), what
    else a label could seem to belong to.

    places: (n, 2) of the points.  depths: (n,).  sizes: width and height of each plate.  gap: from the point to the plate.
    Only points in ``area`` have labels; those behind the camera have NaN.
    """
    taken, found = list(taken), {}
    left, top, wide, high = area
    for number in np.argsort(depths).tolist():
        x, y = places[number]
        if not (left <= x <= left + wide and top <= y <= top + high and depths[number] > 0):
            continue
        width, height = sizes[number]
        others, free, least = [*places, *marks], None, np.inf
        for reach, across, down in ((reach, *side) for reach in reaches for side in _SIDES):
            if free is not None and reach > _CLEAR:
                break
            at = kept_inside(x + across * gap * reach - width * (1 - across) / 2,
                             y + down * gap * reach - height * (1 - down) / 2, (width, height), area, edge)
            if all(at[0] + width <= a or a + w <= at[0] or at[1] + height <= b or b + h <= at[1] for a, b, w, h in taken):
                share = _nearness((x, y), at, sizes[number], others)
                if share < least:
                    free, least = at, share
                if share <= _SURE:
                    break
        if free is not None:
            taken.append((*free, width, height))
            found[number] = free
    return found


def _nearness(point: Sequence[float], at: Sequence[float], size: Sequence[float], others: Sequence[Sequence[float]]) -> float:
    """The distance from the plate of a label to its point, as a share of that to the nearest of the others, (m, 2) with NaN for
    those not seen; 0 where there are none.  Others at the point itself do not count."""
    places = np.array([point, *others], np.float64)
    away = np.linalg.norm(places - np.clip(places, at, np.add(at, size)), axis=1)
    with np.errstate(invalid="ignore"):
        apart = np.abs(places - places[0]).max(axis=1) >= 1.0
    nearest = float(away[apart].min(initial=np.inf))
    return float(away[0]) / max(nearest, 1e-9)


def leader(point: Sequence[float], at: Sequence[float], size: Sequence[float], gap: float,
           others: Sequence[Sequence[float]] = ()) -> tuple[float, float] | None:
    """Where a line from a point to its label ends; None where it needs none.  others: other marks, (m, 2) with NaN for those
    not seen."""
    x, y = np.clip(point, at, np.add(at, size)).tolist()
    if max(abs(x - point[0]), abs(y - point[1])) > _BESIDE * gap or _nearness(point, at, size, others) > _SURE:
        return x, y
    return None
