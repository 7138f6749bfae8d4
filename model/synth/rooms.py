"""The two furnished rooms: a living room (x 0 .. 5.2) and a dining room (x 5.35 .. 9.4), joined by an opening.

Frame: metres, z up, floor at z = 0, both rooms y 0 .. 4.6 and 2.7 high; the windows are in the wall y = 4.6.  The
seed changes the palette, the placement of small objects, the books and the prints.  The floor plan is always the same.
"""

from itertools import pairwise

import numpy as np

from . import furniture as f
from .builder import Appearance, Builder, tilt
from .light import LAMP, SUN, WINDOW, Lights

WIDTH, DEPTH, HEIGHT = 9.4, 4.6, 2.7
"""Size of both rooms together along x, y and z, metres.  This and all sizes below are of an invented flat."""
PARTING = (5.2, 5.35)
"""x of both sides of the wall between the rooms, metres."""
OPENING = (1.45, 3.15, 2.2)
"""The opening in that wall: lowest y, highest y, height, metres."""
WINDOWS = ((1.2, 3.5, 0.85, 2.3), (6.7, 8.3, 0.85, 2.3))
"""Lowest x, highest x, lowest z, highest z of each window, metres."""
SUN_DIRECTION = np.array([0.42, 0.68, 0.6])
SUN_DIRECTION /= np.linalg.norm(SUN_DIRECTION)
"""(3,) unit vector towards the sun."""
LANTERN = (2.55, 2.3, 2.28)
"""Centre of the paper lantern in the living room, metres."""
SHELL = 0.25
"""Thickness of the outer walls, metres."""

_PALETTES = [
    ("#e9e2d4", "#5f7a78", "#4f6472", ("#c9772f", "#d8c9a8", "#7d8f69"), ("#8f2f28", "#27405c")),
    ("#e6e4df", "#b5694a", "#8a8578", ("#35506b", "#d9b45a", "#b5694a"), ("#27505a", "#b5552f")),
    ("#ebe5d8", "#7d8a6a", "#7a4f42", ("#d8c9a8", "#44624f", "#c98f3c"), ("#3a4a6b", "#a8433a")),
]
"""Colours of the living room's wall, accent wall, sofa, cushions and rug."""


def furnish(seed: int) -> tuple[Builder, Lights]:
    """The primitives of the place, and its lights."""
    rng = np.random.default_rng([2024, seed])
    b = Builder(seed=seed)
    # Seed 1, that of the demo scan, has the first palette.
    wall, accent, sofa, cushions, rug = _PALETTES[(seed - 1) % len(_PALETTES)]
    _shell(b, wall, accent)
    _outside(b)
    lamp_a = _living_room(b, rng, sofa, cushions, rug)
    lamp_b = _dining_room(b, rng)
    return b, _lights(lamp_a, lamp_b)


def _shell(b: Builder, wall: str, accent: str) -> None:
    """Floors, ceiling, walls with openings, skirting boards, and the frames of windows and opening."""
    x0, x1 = PARTING
    paint, white = Appearance("plaster", wall, wall), Appearance("plaster", "#efece5", "#efece5")
    b.box((-SHELL, -SHELL, -0.2), (x0 + 0.075, DEPTH + SHELL, 0), Appearance("planks", "#b58a5c", "#855b38", 0.2))
    b.box((x0 + 0.075, -SHELL, -0.2), (WIDTH + SHELL, DEPTH + SHELL, 0), Appearance("tiles", "#cfc8b8", "#3f5b66", 0.3))
    b.box((-SHELL, -SHELL, HEIGHT), (WIDTH + SHELL, DEPTH + SHELL, HEIGHT + 0.2), white)
    b.box((-SHELL, -SHELL, 0), (0, DEPTH + SHELL, HEIGHT), Appearance("plaster", accent, accent))
    b.box((WIDTH, -SHELL, 0), (WIDTH + SHELL, DEPTH + SHELL, HEIGHT), Appearance("brick", "#a5583f", "#b9b0a2"))
    b.box((0, -SHELL, 0), (x0, 0, HEIGHT), paint)
    b.box((x0, -SHELL, 0), (WIDTH, 0, HEIGHT), Appearance("plaster", "#dfe3df", "#dfe3df"))
    y0, y1, top = OPENING
    b.box((x0, 0, 0), (x1, y0, HEIGHT), paint, seed=11)
    b.box((x0, y1, 0), (x1, DEPTH, HEIGHT), paint, seed=11)
    b.box((x0, y0, top), (x1, y1, HEIGHT), paint, seed=11)
    edge = 0.0
    for wx0, wx1, wz0, wz1 in WINDOWS:
        b.box((edge, DEPTH, 0), (wx0, DEPTH + SHELL, HEIGHT), paint, seed=12)
        b.box((wx0, DEPTH, 0), (wx1, DEPTH + SHELL, wz0), paint, seed=12)
        b.box((wx0, DEPTH, wz1), (wx1, DEPTH + SHELL, HEIGHT), paint, seed=12)
        _window(b, wx0, wx1, wz0, wz1)
        edge = wx1
    b.box((edge, DEPTH, 0), (WIDTH, DEPTH + SHELL, HEIGHT), paint, seed=12)
    trim = f.WHITE
    for low, high in (((0, 0), (x0, 0.015)), ((0, 0), (0.015, DEPTH)), ((0, DEPTH - 0.015), (x0, DEPTH)),
                      ((x0 - 0.015, 0), (x0, y0)), ((x0 - 0.015, y1), (x0, DEPTH)),
                      ((x1, 0), (WIDTH, 0.015)), ((x1, DEPTH - 0.015), (WIDTH, DEPTH)),
                      ((x1, 0), (x1 + 0.015, y0)), ((x1, y1), (x1 + 0.015, DEPTH))):
        b.box((*low, 0), (*high, 0.09), trim)
    for y in (y0, y1):
        b.box((x0 - 0.02, y - 0.035, 0), (x1 + 0.02, y + 0.035, top), trim)
    b.box((x0 - 0.02, y0 - 0.035, top - 0.035), (x1 + 0.02, y1 + 0.035, top + 0.035), trim)
    b.box((x0 - 0.01, y0, -0.001), (x1 + 0.01, y1, 0.008), f.OAK)


def _window(b: Builder, x0: float, x1: float, z0: float, z1: float) -> None:
    """Frame, mullions, sill, handle, and open curtains on a rod."""
    y, w = DEPTH + 0.13, 0.055
    for low, high in (((x0, z0), (x1, z0 + w)), ((x0, z1 - w), (x1, z1)),
                      ((x0, z0), (x0 + w, z1)), ((x1 - w, z0), (x1, z1)),
                      (((x0 + x1) / 2 - w / 2, z0), ((x0 + x1) / 2 + w / 2, z1)),
                      ((x0, z1 - 0.47), (x1, z1 - 0.43))):
        b.box((low[0], y - 0.03, low[1]), (high[0], y + 0.03, high[1]), f.WHITE)
    b.cushion(((x0 + x1) / 2, DEPTH + 0.03, z0 - 0.015), ((x1 - x0) / 2 + 0.05, 0.13, 0.015), 0.01, f.WHITE)
    b.capsule(((x0 + x1) / 2, y - 0.05, z0 + 0.45), ((x0 + x1) / 2, y - 0.05, z0 + 0.57), 0.008, f.STEEL)
    b.capsule((x0 - 0.3, DEPTH - 0.09, z1 + 0.13), (x1 + 0.3, DEPTH - 0.09, z1 + 0.13), 0.011, f.BLACK)
    cloth = Appearance("weave", "#d8cfbd", "#c7bba5")
    for side in (x0 - 0.25, x1 - 0.03):
        for k in range(7):
            x = side + 0.047 * k
            dy = 0.02 * (k % 2)
            b.rod((x, DEPTH - 0.1 + dy, 0.06), (x, DEPTH - 0.1 + dy, z1 + 0.12), 0.031, cloth, end=0.026, caps=False)


def _outside(b: Builder) -> None:
    """The view out of the windows: a house across the street, a hedge and paving."""
    y = DEPTH + 7.0
    look = Appearance("facade", "#a8745c", "#b9b2a6", outdoors=True)
    b.quad((5, y, 3.5), (-13, 0, 0), (0, 0, 5.5), look)
    b.quad((5, y - 3.4, -0.6), (13, 0, 0), (0, 3.4, 0), Appearance("plaster", "#8d8b86", "#8d8b86", outdoors=True))
    rng = np.random.default_rng(5)
    for k in range(34):
        shade = ("#4b6b3a", "#57793f", "#3d5a33")[k % 3]
        spot = (-3 + 0.5 * k + rng.uniform(-0.1, 0.1), y - 2.6 + rng.uniform(-0.2, 0.2), rng.uniform(-0.1, 0.25))
        b.ball(spot, (0.42, 0.4, rng.uniform(0.55, 0.75)), Appearance("foliage", shade, "#1f2f1a", outdoors=True))


def _living_room(b: Builder, rng: np.random.Generator, sofa: str, cushions, rug) -> np.ndarray:
    """Sofa, rug, low table, bookshelf, floor lamp, plant, prints, radiator.  Returns the position of the lamp's bulb (3,)."""
    b.cushion((2.55, 2.05, 0.006), (1.3, 0.9, 0.006), 0.004, Appearance("rug", rug[0], rug[1]))
    with b.at(2.5, 0.06):
        f.sofa(b, 2.25, Appearance("weave", sofa, "#9aa7ad"), [
            Appearance("stripes", cushions[0], "#efe6d2"),
            Appearance("weave", cushions[1], "#ffffff"),
            Appearance("stripes", cushions[2], "#e9dfc7"),
        ])
    with b.at(2.55 + rng.uniform(-0.05, 0.05), 2.0, 0.012, rng.uniform(-5, 5)):
        f.table(b, 1.05, 0.58, 0.4, f.WALNUT)
        f.magazine(b, -0.28, 0.05, 0.4, 12, 3)
        f.magazine(b, -0.25, 0.03, 0.406, -14, 7)
        f.magazine(b, 0.3, -0.12, 0.4, 40, 5)
        b.rod((0.25, 0.14, 0.4), (0.25, 0.14, 0.49), 0.036, f.WHITE, end=0.042, caps=False)
        b.rod((0.02, -0.1, 0.4), (0.02, -0.1, 0.52), 0.028, Appearance("plain", "#7d9aa0", "#7d9aa0", 0.6), end=0.02)
    with b.at(0.0, 1.25):
        f.bookshelf(b, 2.2, 2.12, rng)
        for k, size in enumerate(((0.3, 0.4, 0.2), (0.26, 0.3, 0.17))):
            f.carton(b, 0.16, 0.4 + 0.55 * k, 2.12, size, rng.uniform(-6, 6), rng)
        with b.at(0.17, 1.85, 2.12):
            f.plant(b, rng, 0.52, 7, "#b5694a")
    with b.at(0.48, 0.55):
        bulb = f.floor_lamp(b, Appearance("weave", "#f1e3c4", "#e3d0a6", glow=(0.85, 0.62, 0.34)), _bulb()) + (0.48, 0.55, 0)
    b.cable(_sag((0.48, 0.5, 0.02), (0.9, 0.02, 0.25), 0.0, 6), 0.004, f.BLACK)
    with b.at(4.62, 4.05):
        f.plant(b, rng, 1.75, 12)
    for k, (x, z, w) in enumerate(((1.75, 1.62, 0.5), (2.5, 1.66, 0.56), (3.25, 1.62, 0.5))):
        f.picture(b, x, z, w, _print(b, (1, 0, 3)[k], k), (f.BLACK, f.OAK, f.BLACK)[k])
    with b.at(5.2, 0.78, yaw=90):
        f.picture(b, 0, 1.55, 0.62, _print(b, 2, 3), f.OAK)
    with b.at(2.35, DEPTH - 0.13):
        f.radiator(b, 1.4)
    with b.at(3.95, 4.15, yaw=200):  # by the window
        f.chair(b, f.BLACK, Appearance("weave", cushions[0], "#e9dfc7"))
    b.capsule((*LANTERN[:2], LANTERN[2] + 0.2), (*LANTERN[:2], HEIGHT), 0.0035, f.BLACK)
    b.ball(LANTERN, (0.21, 0.21, 0.185), Appearance("paper", "#f6ead2", "#c9b48c", glow=(1.1, 0.86, 0.56), casts=False))
    # A string of small lamps below the ceiling.
    anchors = [(0.05, 4.45, 2.55), (1.6, 4.3, 2.6), (3.3, 4.3, 2.6), (5.1, 4.4, 2.55)]
    for start, end in pairwise(anchors):
        line = _sag(start, end, 0.16, 12)
        b.cable(line, 0.003, f.BLACK)
        for p in line[1::2]:
            b.ball(p - (0, 0, 0.022), (0.014, 0.014, 0.019), Appearance("plain", "#ffdca0", "#ffdca0", 0.3, (1.6, 1.1, 0.5)))
    f.carton(b, 4.85, 0.3, 0.0, (0.42, 0.36, 0.3), 8, rng)
    f.carton(b, 4.87, 0.29, 0.3, (0.32, 0.28, 0.22), -11, rng)
    b.rod((3.95, 0.35, 0), (3.95, 0.35, 0.46), 0.2, Appearance("weave", "#b99a6b", "#7c5f3a"), end=0.22)  # basket, side table
    b.rod((3.95, 0.35, 0.46), (3.95, 0.35, 0.48), 0.23, f.OAK)
    b.ball((3.93, 0.33, 0.56), (0.075, 0.075, 0.085), Appearance("plain", "#3f6470", "#3f6470", 0.5))
    return bulb


def _dining_room(b: Builder, rng: np.random.Generator) -> np.ndarray:
    """Table with four chairs under a lamp, sideboard, railing, shelf, prints, cartons.  Returns the position of the bulb
    (3,)."""
    cx, cy = 7.45, 2.05
    with b.at(cx, cy):
        f.table(b, 1.6, 0.88)
        f.tableware(b, rng, 0.74)
        for x, y, yaw in ((-0.42, -0.62, 0), (0.42, -0.66, 0), (-0.4, 0.66, 180), (0.46, 0.8, 180)):
            with b.at(x + rng.uniform(-0.03, 0.03), y, 0, yaw + rng.uniform(-14, 14)):
                f.chair(b, f.OAK if x < 0 else f.BLACK, Appearance("weave", "#cdbf9f", "#8d7f63"))
        shade = Appearance("plain", "#2f4a4f", "#2f4a4f", 0.3)
        bulb = f.pendant(b, HEIGHT, 1.62, shade, _bulb()) + (cx, cy, 0)
    # Sideboard along the brick wall, with objects on it.
    with b.at(WIDTH, 1.0, yaw=90):
        b.box((0.0, 0.02, 0.16), (1.7, 0.44, 0.78), f.WALNUT)
        for k in range(3):
            x = 0.02 + 0.56 * k
            b.box((x, 0.44, 0.19), (x + 0.54, 0.455, 0.75), f.OAK)
            b.capsule((x + 0.22, 0.475, 0.68), (x + 0.32, 0.475, 0.68), 0.006, f.BRASS)
        for x in (0.1, 1.6):
            for y in (0.08, 0.38):
                b.rod((x, y, 0), (x, y, 0.16), 0.013, f.BLACK, end=0.02)
        b.rod((0.25, 0.24, 0.78), (0.25, 0.24, 1.0), 0.055, Appearance("plain", "#b0583c", "#b0583c", 0.5), end=0.085)
        b.rod((0.25, 0.24, 1.0), (0.25, 0.24, 1.09), 0.085, Appearance("plain", "#b0583c", "#b0583c", 0.5), end=0.035)
        b.ball((0.5, 0.22, 0.86), 0.08, Appearance("plain", "#d8d2c2", "#d8d2c2", 0.3))
        for k in range(5):
            z = 0.78 + 0.032 * k
            axes = tilt("z", 90 + rng.uniform(-10, 10)) @ f.LYING
            b.turned_box((0.85, 0.22, z + 0.015), (0.095, 0.0155, 0.13), Appearance("book"), axes=axes,
                         seed=int(rng.integers(1 << 20)))
        with b.at(1.45, 0.23, 0.78):
            f.plant(b, rng, 0.6, 8, "#e2dccd")
        f.picture(b, 0.85, 1.72, 0.56, _print(b, 0, 4), f.BLACK)
    for k, (x, w) in enumerate(((6.3, 0.5), (7.1, 0.5))):
        f.picture(b, x, 1.6, w, _print(b, (3, 1)[k], 5 + k), f.OAK)
    # A shelf on the wall y = 0 with jars, and a rail with utensils below it.
    b.box((7.75, 0, 1.62), (9.1, 0.2, 1.645), f.OAK)
    for k in range(8):
        x = 7.85 + 0.16 * k
        colour = ("#c9b79c", "#6f8f87", "#b0583c", "#e2dccd", "#7a8b5a", "#d9b45a", "#8a6a52", "#40566b")[k]
        tall = rng.uniform(0.1, 0.19)
        b.rod((x, 0.1, 1.645), (x, 0.1, 1.645 + tall), 0.042, Appearance("plain", colour, colour, 0.4))
        b.rod((x, 0.1, 1.645 + tall), (x, 0.1, 1.66 + tall), 0.03, f.STEEL)
    b.capsule((7.8, 0.07, 1.5), (9.05, 0.07, 1.5), 0.006, f.STEEL)
    for k in range(9):
        x, low = 7.88 + 0.135 * k, rng.uniform(1.18, 1.3)
        b.capsule((x, 0.07, 1.5), (x, 0.075, low), 0.004, f.STEEL if k % 2 else f.OAK)
        b.ball((x, 0.078, low - 0.02), (0.026, 0.008, 0.036), f.STEEL if k % 2 else f.OAK)
    with b.at(5.5, 3.72):
        f.railing(b, 1.5)
    with b.at(5.75, 4.25):
        f.plant(b, rng, 1.35, 10, "#8a8f86")
    f.carton(b, 6.4, 4.3, 0.0, (0.5, 0.36, 0.34), 5, rng)
    f.carton(b, 6.38, 4.3, 0.34, (0.36, 0.3, 0.24), -14, rng)
    f.carton(b, 9.12, 3.2, 0.0, (0.36, 0.42, 0.36), 4, rng)
    with b.at(7.5, DEPTH - 0.13):
        f.radiator(b, 1.1)
    # A cable below the ceiling and down the wall, and a broom that leans on the wall.
    b.cable(_sag((7.45, 2.05, 2.69), (5.4, 0.6, 2.6), 0.22, 14), 0.004, f.BLACK)
    b.cable(_sag((5.4, 0.6, 2.6), (5.37, 0.6, 0.3), 0.0, 5), 0.004, f.BLACK)
    b.capsule((8.85, 4.45, 0.05), (9.3, 4.52, 1.45), 0.011, f.OAK)
    b.cushion((8.85, 4.44, 0.06), (0.14, 0.03, 0.05), 0.02, Appearance("weave", "#b99a6b", "#7c5f3a"))
    return bulb


def _print(b: Builder, kind: int, number: int) -> int:
    """Seed of a poster.  kind: 0 shapes, 1 landscape, 2 lettering, 3 chart; number: unique within the place."""
    return kind + 4 * (10 * b.seed + number)


def _bulb() -> Appearance:
    return Appearance("plain", "#fff2d8", "#fff2d8", 0.2, (6.0, 4.8, 3.0), casts=False)


def _sag(start, end, depth: float, parts: int) -> np.ndarray:
    """(parts + 1, 3) points of a cable whose middle hangs ``depth`` metres below the line from start to end."""
    s = np.linspace(0, 1, parts + 1)[:, None]
    line = (1 - s) * np.asarray(start, float) + s * np.asarray(end, float)
    line[:, 2] -= depth * 4 * (s * (1 - s))[:, 0]
    return line


def _lights(lamp_a: np.ndarray, lamp_b: np.ndarray) -> Lights:
    """Skylight from the windows, the sun, two lamps and a paper lantern."""
    rows = []
    for x0, x1, z0, z1 in WINDOWS:
        centre, u, v = ((x0 + x1) / 2, DEPTH + 0.45, (z0 + z1) / 2), ((x1 - x0) / 1.7, 0, 0), (0, 0, (z1 - z0) / 1.7)
        area = (x1 - x0) * (z1 - z0) * (2 / 1.7) ** 2
        sky = np.array([0.86, 0.97, 1.12]) * (0.95 if x0 < PARTING[0] else 1.4)
        rows.append((WINDOW, centre, u, v, 0.0, sky * area, 14))
    zero = (0, 0, 0)
    rows.append((SUN, SUN_DIRECTION, zero, zero, 0.012, np.array([1.0, 0.86, 0.66]) * 2.6, 5))
    rows.append((LAMP, lamp_a, zero, zero, 0.06, np.array([1.0, 0.68, 0.38]) * 0.5, 5))
    rows.append((LAMP, lamp_b, zero, zero, 0.06, np.array([1.0, 0.74, 0.46]) * 0.75, 5))
    rows.append((LAMP, LANTERN, zero, zero, 0.17, np.array([1.0, 0.84, 0.62]) * 0.42, 6))
    kind, position, u, v, radius, power, samples = zip(*rows)
    return Lights(
        np.array(kind, np.int64), np.array(position, np.float64), np.array(u, np.float64), np.array(v, np.float64),
        np.array(radius), np.array(power), np.array(samples, np.int64),
    )
