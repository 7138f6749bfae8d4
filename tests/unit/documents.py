"""Random documents with every field set, for tests of history and project files."""

from dataclasses import replace

import numpy as np
from untyped import any_typed

from pointglass.viewer.common.rigid_transform import Rows, rigid, rotation_about
from pointglass.viewer.picture.camera import look_at
from pointglass.viewer.picture.clip import Box, Slab, vector
from pointglass.viewer.picture.colour_modes import COLOUR_BY, RAMPS
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.work.document import CameraPath, Document, FilmFormat, Keyframe, ScanFile
from pointglass.viewer.work.fits.fit import Fit
from pointglass.viewer.work.measuring.measurement import KINDS, MeasuredPoint, Measurement
from pointglass.viewer.work.measuring.profile import Profile
from pointglass.viewer.work.measuring.volume import Volume
from pointglass.viewer.work.notes.annotation import STATUSES, Annotation
from pointglass.viewer.work.viewpoint import Viewpoint


def random_view(random, name: str) -> Viewpoint:
    place = random.uniform(-1e6, 1e6, 3)
    matrix = look_at(place, place + random.normal(size=3))
    return Viewpoint(name, any_typed(tuple(tuple(map(float, row)) for row in matrix)), float(random.uniform(5, 120)))


def random_fit(random, kind: str) -> Fit:
    direction = random.normal(size=3)
    low, high, seen, sigma = map(float, random.uniform([-2, 1, 0, 0], [-1, 2, 360, 0.01]))
    place, axis = vector(random.uniform(-1e6, 1e6, 3)), vector(direction / np.linalg.norm(direction))
    radius, unsure, tilt = map(float, random.random(3))
    return Fit(kind, place, axis, radius, low, high, seen, sigma, int(random.integers(30, 10_000)), unsure, tilt,
               float(random.random()) if kind == "plane" else 0.0)


def random_fits(random, kind: str) -> list[Fit | None]:
    """What is fitted at the points of a measurement of a kind of KINDS, None where nothing is."""
    surfaces = [KINDS[kind].surface(number) for number in range(KINDS[kind].fewest)]
    found: list[Fit | None] = [None if surface is None else random_fit(random, surface) for surface in surfaces]
    if kind == "corner":  # three planes that meet in a place
        axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
        found = [replace(fit, direction=vector(axis)) for fit, axis in zip(found, axes, strict=True) if fit is not None]
    return found


def random_volume(random, kind: str) -> Volume | None:
    """What a measurement of a kind of KINDS has found inside its polygon."""
    if kind != "volume":
        return None
    values = (*random.random(5).tolist(), vector(random.uniform(-1e6, 1e6, 3)), vector(random.normal(size=3)),
              *random.random(4).tolist(), int(random.integers(30, 10_000)))
    return Volume(*any_typed(values))


def random_profile(random, kind: str) -> Profile | None:
    """What a measurement of a kind of KINDS has found along its line."""
    if kind != "profile":
        return None
    count = int(random.integers(2, 30))
    return Profile(0.1, 0.05, tuple(map(float, np.arange(count) * 0.05)), tuple(map(float, random.normal(size=count))),
                   tuple(map(int, random.integers(1, 99, count))))


def random_motion(random) -> Rows | None:
    """A transformation of a scan, of two in three."""
    if random.random() < 1 / 3:
        return None
    return rigid(rotation_about(random.normal(size=3), random.uniform(-180, 180)), random.uniform(-1e6, 1e6, 3))


def random_note(random, text: str, picture: str = "") -> Annotation:
    return Annotation(text, vector(random.uniform(-1e6, 1e6, 3)), str(random.choice(list(STATUSES))),
                      f"https://example.org/{random.integers(1000)}", picture, random_view(random, "note é"),
                      f"2026-11-{random.integers(10, 29)}T12:00:00Z")


def random_document(random, scans: list[str]) -> Document:
    def point() -> MeasuredPoint:
        return MeasuredPoint(vector(random.uniform(-1e6, 1e6, 3)), float(random.random()), float(random.random()), "scan é 1")

    def points(kind: str) -> tuple[MeasuredPoint, ...]:
        found = [replace(point(), fit=fit) for fit in random_fits(random, kind)]
        return tuple(item if item.fit or random.random() < 0.5 else replace(item, beyond=vector(random.normal(size=3)))
                     for item in found)

    kinds = list(KINDS)
    measurements = [Measurement(kind, points(kind), f"M {i}", volume=random_volume(random, kind),
                                profile=random_profile(random, kind))
                    for i, kind in enumerate(random.choice(kinds, 4))]
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    rows = vector(axes[0]), vector(axes[1]), vector(axes[2])
    return Document(
        scans=tuple(ScanFile(path, bool(random.random() < 0.5), 0.3048, "EPSG:25832", random_motion(random)) for path in scans),
        hidden_stations=tuple(map(int, random.integers(0, 256, 3))),
        up=vector(axes[1]),
        view=random_view(random, "last view"),
        viewpoints=tuple(random_view(random, f"view {i}") for i in range(3)),
        path=CameraPath(tuple(Keyframe(i + float(random.random()), random_view(random, ""), float(i)) for i in range(5)), 25.0,
                        True, True, format=FilmFormat((320, 180), True, view="filled", quality="best", supersample=2)),
        clips=(Box(vector(random.normal(size=3)), vector(random.random(3) + 0.1), rows, True),
               Slab(vector(random.normal(size=3)), rows[2], 0.5, active=False)),
        measurements=tuple(measurements),
        annotations=(random_note(random, "crack\nsee \"photo\""), Annotation("", vector(random.normal(size=3)))),
        look=Look(str(random.choice(list(COLOUR_BY))), str(random.choice(list(RAMPS))), float(random.normal()), None, 1.5, -0.5,
                  point_size=3, edl=0.4),
        settings=Settings(view="filled", lod=1.5, filter_strength=2.0, weights=None),
        background="sky",
        lock_measured=True,
    )
