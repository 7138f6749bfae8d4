"""From a click to a surface: a start, then a piece that grows while its points lie on one surface, and its fit.

The window that is looked at doubles until the piece ends inside it.  A point belongs to the piece where it lies within
``WITHIN`` standard deviations of the surface, faces as it does, and is joined to the click along it
(viewer.work.fits.connected).
Frame: relative to the click, axes of the file, file units.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from ...common.errors import PointglassError
from .connected import connected
from .halves import with_halves
from .least_squares import Fitted, fitted, nearest
from .local import noise_of, normals_of, spacing_of, tree_of
from .measured import InBox, Points
from .noise_direction import without_noise_bias
from .starts import FLATTEST, cylinder_start
from .surfaces import Circle, Cylinder, Plane, Surface, frame_of

WITHIN = 3.5
"""Standard deviations within which points belong to a surface: a normal distribution has one in two thousand beyond."""
CREEP = 1.6
"""How much larger than at the click the scatter may become while the piece grows, before it lies on another surface."""
LOOSEST = 2.0
"""Scatter around a cylinder, in that at the click, from which it is none: one laid into a corner of two walls had 2.5 times the
noise.  A plane may be as rough as it is."""
UNSURE = 0.5
"""Uncertainty of a radius, as a share of it, from which it is not stated."""
FEWEST = 30
"""Points of a fit at least."""
_BALLS = (8.0, 14.0, 25.0, 45.0, 80.0)
"""Half sides of the boxes around the click in which a cylinder's start is looked for, in point spacings."""
_CELL = 3.0
"""Side of a cell that joins points, in spacings of those looked at: random points leave 1 in e^9 such cells empty."""
SETTLED = 0.01
"""Change of the piece's area from one round to the next at which it is taken to be found."""
_ROUNDS = 20
_SAME, _COMPARED = 0.05, 200
"""Distance between two surfaces, in the noise, up to which a start is dropped that leads to what another has found: of a clear
pipe, all five do.  At so many points of each piece, about.  With 0.1 and more, starts are dropped whose pieces
differ: of 192 synthetic pipes one had another radius."""
_FACING = np.cos(np.radians(35.0))
_START_POINTS, _FACING_POINTS = 1500, 3000
_FLAT = "nothing round here: the surface is flat, or too few points show its bend"


class NoFit(PointglassError):
    """Nothing of this kind lies at the click; the message says what was found."""


@dataclass(frozen=True, eq=False)
class Grown:
    """fit: of the surface.  points: of the piece, relative to the click.  noise: at the click."""

    fit: Fitted
    points: Points
    noise: float
    spacing: float


@dataclass(frozen=True, eq=False)
class _Around:
    """The points around the click and what they say."""

    points: Points
    tree: KDTree
    spacing: float
    noise: float


def grown_plane(in_box: InBox, spacing: float, floor: float) -> Grown:
    """The plane at the click.  spacing: of points there, file units, about.  floor: rounding of coordinates.
    Raises NoFit."""
    around = _around(in_box, spacing, floor)
    near = around.points.xyz
    near = near[np.argsort(np.linalg.norm(near, axis=1))[: max(len(near) // 4, FEWEST)]]
    middle = near.mean(axis=0)
    normal = np.linalg.svd(near - middle, full_matrices=False)[2][2]
    try:
        first, _ = nearest(Plane(middle, normal), near, around.noise)
        return _grow(in_box, first, around, 8.0 * around.spacing)
    except (ValueError, NoFit) as error:
        raise NoFit(f"no plane here: {error}") from None


def grown_cylinder(in_box: InBox, spacing: float, floor: float, longest: float | None = None,
                   loosest: float = LOOSEST) -> Grown:  # fmt: skip
    """The cylinder at the click.  longest: how far from the click it may reach along its axis, in radii; None: as far as it
    goes.  loosest: as LOOSEST.  Raises NoFit."""
    around = _around(in_box, spacing, floor)
    rng = np.random.default_rng(0)  # the same click gives the same pipe
    best: tuple[float, Grown] | None = None
    known: list[Grown] = []
    for start, half in _starts(in_box, around, rng):
        try:
            made = _grow(in_box, start.cylinder, around, half, longest, known)
        except (ValueError, NoFit):
            continue  # this start leads nowhere new; where all do, the message below says so
        known.append(made)
        if made.fit.sigma > loosest * around.noise:
            continue
        worth = len(made.points) / made.points.share * (around.noise / made.fit.sigma) ** 3 / made.fit.structure
        if best is None or worth > best[0]:
            best = worth, made
    if best is None:
        raise NoFit(_FLAT)
    found = _corrected(best[1])
    surface = found.fit.surface
    assert isinstance(surface, Cylinder)
    if found.fit.expanded("radius") > UNSURE * surface.radius:
        raise NoFit("nothing round here: the surface bends too little, beside its noise, to tell a diameter")
    return found


def circle_of(pipe: Grown) -> Grown:
    """The cross-section of a pipe at the click: the circle through the points near the plane across its axis.  The pipe may
    be a cone or a bend, around which points scatter more than around the circle.  Raises NoFit."""
    cylinder = pipe.fit.surface
    assert isinstance(cylinder, Cylinder)
    along = pipe.points.xyz @ cylinder.direction
    half = max(2.0 * pipe.spacing, 0.1 * cylinder.radius)
    points = pipe.points.where(np.abs(along) <= half)
    if len(points) < FEWEST:
        raise NoFit(f"no circle here: {len(points)} points in the cross-section, {FEWEST} are needed")
    foot = cylinder.place - (cylinder.place @ cylinder.direction) * cylinder.direction
    try:
        fit = fitted(Circle(foot, cylinder.direction, cylinder.radius), points.xyz, pipe.noise * 0.25, pipe.fit.sigma)
    except ValueError as error:
        raise NoFit(f"no circle here: {error}") from None
    if fit.sigma > LOOSEST * pipe.noise:
        raise NoFit(_FLAT)
    return _corrected(replace(pipe, fit=fit, points=points))


def _corrected(grown: Grown) -> Grown:
    try:
        return replace(grown, fit=without_noise_bias(grown.fit, grown.points.xyz))
    except ValueError as error:
        raise NoFit(f"nothing round here: {error}") from None


def _around(in_box: InBox, spacing: float, floor: float) -> _Around:
    points = in_box(np.zeros(3), np.eye(3), np.full(3, _BALLS[0] * spacing))
    if len(points) < FEWEST:
        raise NoFit(f"nothing can be fitted here: {len(points)} measured points around the click, {FEWEST} are needed")
    tree = KDTree(points.xyz)
    here = spacing_of(points.xyz, tree)
    near = points.xyz[np.argsort(np.linalg.norm(points.xyz, axis=1))[: max(len(points) // 3, FEWEST)]]
    return _Around(points, tree, max(here, 1e-300), max(noise_of(points.xyz, tree, near), floor, 1e-300))


def _starts(in_box: InBox, around: _Around, rng: np.random.Generator):
    """Starts of several sizes, and the half side of the box of each."""
    for ball in _BALLS:
        half = ball * around.spacing
        points = in_box(np.zeros(3), np.eye(3), np.full(3, half))
        chosen = points.xyz
        if len(chosen) > _START_POINTS:
            chosen = chosen[rng.permutation(len(chosen))[:_START_POINTS]]
        if len(chosen) < FEWEST:
            continue
        tree = KDTree(chosen)
        here = spacing_of(chosen, tree)
        normals = normals_of(chosen, tree, max(2.5 * here, 3.0 * around.noise), here)
        near = np.asarray(tree.query(np.zeros(3), min(12, len(chosen)))[1])
        start = cylinder_start(chosen, normals, near, WITHIN * around.noise, half, rng)
        if start is not None:
            yield start, half


def _grow(in_box: InBox, surface: Surface, around: _Around, half: float, longest: float | None = None,
          known: Sequence[Grown] = ()) -> Grown:
    """The piece around the click that lies on a surface near ``surface``.  half: of the first window.
    Raises NoFit, of a piece that is one of ``known``, too; ValueError."""
    sigma, most = around.noise, CREEP * around.noise
    before, points, cell = 0.0, around.points, _CELL * around.spacing
    for _ in range(_ROUNDS):
        tolerance = WITHIN * sigma
        points, at, border = _window(in_box, surface, half, tolerance)
        cell = max(_CELL * spacing_of(points.xyz), 0.004 * half)
        points = points.where(np.abs(surface.distances(points.xyz)) <= tolerance)
        piece = connected(surface.unrolled(points.xyz), at, cell, surface.circumference, border)
        points = points.where(piece.of_points)
        if len(points) < FEWEST:
            raise NoFit(f"{len(points)} points lie on it, {FEWEST} are needed")
        surface, scatter = nearest(surface, points.xyz, 0.25 * around.noise, sigma)
        if isinstance(surface, Cylinder) and surface.radius > FLATTEST * half:
            raise NoFit("the surface is flat")
        sigma = float(np.clip(scatter, 0.5 * around.noise, most))
        if abs(surface.distances(np.zeros((1, 3)))[0]) > 2 * WITHIN * around.noise:
            raise NoFit("the surface found leads away from the click")
        if any(_same(surface, points, one, around.noise) for one in known):
            raise NoFit("another start has found this surface")
        limit = longest * surface.radius if longest is not None and isinstance(surface, Cylinder) else np.inf
        if any(piece.open_ends) and half <= limit:
            half *= 2.0
        elif abs(piece.area - before) <= SETTLED * piece.area:
            break
        before = piece.area
    return _facing(in_box, surface, points, cell, half, around, sigma)


def _same(surface: Surface, points: Points, other: Grown, noise: float) -> bool:
    """Whether a surface and that of another piece are one, on the points of both pieces."""
    for xyz in (points.xyz, other.points.xyz):
        some = xyz[:: max(len(xyz) // _COMPARED, 1)]
        if np.abs(surface.distances(some) - other.fit.surface.distances(some)).max() > _SAME * noise:
            return False
    return True


def _facing(in_box: InBox, surface: Surface, points: Points, cell: float, half: float, around: _Around, sigma: float) -> Grown:
    """Leaves out the points of a piece that lie on something else that crosses or touches the surface, whose normals differ,
    and what is joined to the click through them only.  Raises NoFit, ValueError."""
    # Normals of all that is there: those of the piece alone would be its own, in the strip of a wall beside a floor, too.
    everything = _window(in_box, surface, half, max(cell, WITHIN * sigma))[0].xyz
    tree, some = tree_of(everything), points.xyz[:: max(len(points) // _FACING_POINTS, 1)]
    here = spacing_of(everything, tree)
    normals = normals_of(everything, tree, max(2.5 * here, 3.0 * sigma), here, some)
    faces = np.abs(np.einsum("ni,ni->n", normals, surface.normals(some))) > _FACING
    points = points.where(faces[np.asarray(tree_of(some).query(points.xyz)[1])])
    at = surface.unrolled(np.zeros((1, 3)))[0]
    points = points.where(connected(surface.unrolled(points.xyz), at, cell, surface.circumference, (np.inf, np.inf)).of_points)
    if len(points) < FEWEST:
        raise NoFit(f"{len(points)} points lie on it, {FEWEST} are needed")
    if isinstance(surface, Plane):
        surface = surface.at(points.xyz.mean(axis=0))
    fit = fitted(surface, points.xyz, 0.25 * around.noise, sigma)
    if isinstance(fit.surface, Plane):
        fit = with_halves(fit, points.xyz, 0.25 * around.noise)
    return Grown(fit, points, around.noise, around.spacing)


def _window(in_box: InBox, surface: Surface, half: float, tolerance: float):
    """The points near a surface around the click; the click, unrolled; and how far the window reaches."""
    axes = frame_of(surface.direction)
    click = np.zeros((1, 3))
    if isinstance(surface, Cylinder):
        reach = surface.radius + tolerance
        along = float((click[0] - surface.place) @ surface.direction)
        centre = surface.place + along * surface.direction
        return in_box(centre, axes, np.array([reach, reach, half])), surface.unrolled(click)[0], (np.inf, half)
    foot = click[0] - surface.distances(click)[0] * surface.direction
    return in_box(foot, axes, np.array([half, half, tolerance])), surface.unrolled(click)[0], (half, half)
