"""The exact cut of a plane through a mesh, as polylines: each triangle gives the segment in which the plane meets it.

A vertex in the plane counts as behind it, so that a closed mesh gives closed lines and a face in the plane its outline at most
once.  Segments are joined where triangles share an edge, edges of vertices at one place being one; vertices along straight
parts are left out.  Frame: paper coordinates (right, up, depth) as viewer.commands.section.cut, float64, file units.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from .cut_lines import Polyline

_STRAIGHT = 1e-9
"""Of the mesh's extent: a vertex nearer to the line between its neighbours is left out.  Ten times what rounding adds."""


class Segments(NamedTuple):
    """ends: (n, 2, 2) paper coordinates.  nodes: (n, 2) int64, equal where segments meet."""

    ends: np.ndarray
    nodes: np.ndarray


def cut_segments(vertices: np.ndarray, faces: np.ndarray, depth: float) -> Segments:
    """Where triangles meet the plane at ``depth``.  vertices: (V, 3) paper coordinates.  faces: (F, 3) int."""
    behind = vertices[:, 2] >= depth
    sides = behind[faces]
    crossed = faces[sides.any(axis=1) & ~sides.all(axis=1)]
    if not len(crossed):
        return Segments(np.zeros((0, 2, 2)), np.zeros((0, 2), np.int64))
    used, crossed = np.unique(crossed, return_inverse=True)
    places, same = np.unique(vertices[used], axis=0, return_inverse=True)
    crossed = same.reshape(-1)[crossed.reshape(-1, 3)]
    behind = places[:, 2] >= depth
    edges = np.sort(np.stack([crossed, np.roll(crossed, -1, axis=1)], axis=2), axis=2)  # (n, 3 edges, 2)
    pairs = edges[behind[edges[..., 0]] != behind[edges[..., 1]]]  # two of each triangle
    between, nodes = np.unique(pairs, axis=0, return_inverse=True)
    one, other = places[between[:, 0]], places[between[:, 1]]
    share = (depth - one[:, 2]) / (other[:, 2] - one[:, 2])
    at = one[:, :2] + share[:, None] * (other[:, :2] - one[:, :2])
    exact = (one[:, 2] == depth)[:, None] | (other[:, 2] == depth)[:, None]
    at = np.where(exact, np.where((one[:, 2] == depth)[:, None], one[:, :2], other[:, :2]), at)
    at, same = np.unique(at, axis=0, return_inverse=True)  # a vertex in the plane ends several edges
    nodes = same.reshape(-1)[nodes.reshape(-1)].reshape(-1, 2)
    nodes = nodes[nodes[:, 0] != nodes[:, 1]]
    nodes = np.unique(np.sort(nodes, axis=1), axis=0)  # two faces on one edge of the plane
    return Segments(at[nodes], nodes)


def parts_kept(segments: Segments, crossings: np.ndarray, keeps: Callable[[np.ndarray], np.ndarray]) -> Segments:
    """The parts of segments that are kept.

    crossings: (n, p) float64, where along each segment (0 to 1) it may change; values outside count as none, NaN too.
    keeps: tells of (m, 2) paper coordinates (m,) bool.
    """
    count = len(segments.ends)
    if not count:
        return segments
    inner = np.clip(np.nan_to_num(crossings, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    stops = np.concatenate([np.zeros((count, 1)), np.sort(inner, axis=1), np.ones((count, 1))], axis=1)
    start, way = segments.ends[:, None, 0], (segments.ends[:, 1] - segments.ends[:, 0])[:, None]
    middles = start + ((stops[:, :-1] + stops[:, 1:]) / 2)[..., None] * way
    kept = (stops[:, 1:] > stops[:, :-1]) & keeps(middles.reshape(-1, 2)).reshape(count, -1)
    fresh = int(segments.nodes.max()) + 1 + np.arange(stops.size).reshape(stops.shape)
    names = np.where(stops == 0.0, segments.nodes[:, :1], np.where(stops == 1.0, segments.nodes[:, 1:], fresh))
    for column in range(1, names.shape[1]):  # of equal stops the first names the place
        again = stops[:, column] == stops[:, column - 1]
        names[:, column] = np.where(again, names[:, column - 1], names[:, column])
    at = start + stops[..., None] * way
    ends = np.stack([at[:, :-1], at[:, 1:]], axis=2)
    return Segments(ends[kept], np.stack([names[:, :-1], names[:, 1:]], axis=2)[kept])


def joined_lines(segments: Segments, tolerance: float) -> list[Polyline]:
    """Segments as polylines, longest first.  Where more than two meet, lines end.  tolerance: file units within which a vertex
    counts as on the line between its neighbours."""
    nodes, first = np.unique(segments.nodes, return_index=True)
    places = segments.ends.reshape(-1, 2)[first]
    pairs = np.searchsorted(nodes, segments.nodes)
    around: list[list[int]] = [[] for _ in nodes]
    for number, (one, other) in enumerate(pairs.tolist()):
        around[one].append(number)
        around[other].append(number)
    left = np.ones(len(pairs), bool)
    ends = [node for node, touching in enumerate(around) if len(touching) != 2]
    lines = []
    for start in (*ends, *range(len(nodes))):
        for begin in around[start]:
            if left[begin]:
                chain = _walked(start, begin, pairs, around, left)
                lines.append(_straightened(places[chain], tolerance))
    return sorted((line for line in lines if line is not None), key=lambda line: -line.length)


def _walked(start: int, segment: int, pairs: np.ndarray, around: list[list[int]], left: np.ndarray) -> list[int]:
    """The nodes from one on, along segments that are left, to an end or back."""
    chain = [start]
    while True:
        left[segment] = False
        one, other = pairs[segment].tolist()
        chain.append(other if one == chain[-1] else one)
        touching = around[chain[-1]]
        if len(touching) != 2 or chain[-1] == start:
            return chain
        following = touching[0] if touching[1] == segment else touching[1]
        if not left[following]:
            return chain
        segment = following


def _straightened(places: np.ndarray, tolerance: float) -> Polyline | None:
    """The line without vertices along its straight parts; None where nothing is left of it."""
    closed = len(places) > 3 and bool((places[0] == places[-1]).all())
    kept = [places[0]]
    for place, following in pairwise(places[1:]):
        if not _between(kept[-1], place, following, tolerance):
            kept.append(place)
    kept.append(places[-1])
    if closed:
        kept.pop()
        if len(kept) > 3 and _between(kept[-1], kept[0], kept[1], tolerance):
            kept = kept[1:]
    if len(kept) < (3 if closed else 2):
        return None
    return Polyline(np.array(kept), closed)


def _between(one: np.ndarray, place: np.ndarray, other: np.ndarray, tolerance: float) -> bool:
    way, to = other - one, place - one
    length = float(np.hypot(*way))
    if length <= tolerance:
        return False
    return abs(way[0] * to[1] - way[1] * to[0]) <= tolerance * length and 0.0 <= float(way @ to) <= length * length


def tolerance_of(vertices: np.ndarray) -> float:
    """For :func:`joined_lines`, of (V, 3) vertices."""
    return _STRAIGHT * float(np.ptp(vertices, axis=0).max()) + 4 * np.finfo(np.float64).eps * float(np.abs(vertices).max())
