"""Furniture and clutter.  Each function adds one piece to a `Builder`, in the piece's local frame.

Frame: metres, z up from the floor; the front of a piece faces +y unless its docstring says otherwise.
"""

import numpy as np

from .builder import Appearance, Builder, frame_along, tilt

OAK = Appearance("wood", "#b98a58", "#8a5f37", 0.15)
WALNUT = Appearance("wood", "#7a5236", "#4f3220", 0.2)
BLACK = Appearance("plain", "#34343a", "#34343a", 0.25)
STEEL = Appearance("plain", "#a9acb0", "#a9acb0", 0.8)
WHITE = Appearance("plain", "#e6e4de", "#e6e4de", 0.2)
BRASS = Appearance("plain", "#b08a45", "#b08a45", 0.7)
LYING = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""(3, 3) local axes, in columns, of a book that lies flat: its spine faces +x and its thickness is along z."""
LEAF = Appearance("leaf", "#5d9450", "#b2cc8a", 0.25)


def table(b: Builder, width: float, depth: float, height: float = 0.74, look: Appearance = OAK) -> None:
    """A table centred on the origin, with tapered legs and an apron."""
    x, y = width / 2, depth / 2
    b.cushion((0, 0, height - 0.016), (x, y, 0.016), 0.006, look)
    for sx in (-1, 1):
        b.box((sx * (x - 0.09) - 0.01, -y + 0.1, height - 0.1), (sx * (x - 0.09) + 0.01, y - 0.1, height - 0.032), look)
        for sy in (-1, 1):
            b.rod((sx * (x - 0.05), sy * (y - 0.05), 0), (sx * (x - 0.09), sy * (y - 0.09), height - 0.03), 0.014, look,
                  end=0.026)
    for sy in (-1, 1):
        b.box((-x + 0.1, sy * (y - 0.09) - 0.01, height - 0.1), (x - 0.1, sy * (y - 0.09) + 0.01, height - 0.032), look)


def chair(b: Builder, frame: Appearance, seat: Appearance) -> None:
    """A dining chair with thin legs and a spindle back."""
    b.cushion((0, 0, 0.455), (0.21, 0.205, 0.022), 0.02, seat)
    for sx in (-1, 1):
        b.rod((sx * 0.2, 0.2, 0), (sx * 0.165, 0.16, 0.44), 0.009, frame, end=0.013)
        b.rod((sx * 0.2, -0.23, 0), (sx * 0.165, -0.16, 0.44), 0.009, frame, end=0.013)
        b.capsule((sx * 0.175, -0.17, 0.45), (sx * 0.195, -0.25, 0.84), 0.011, frame)
        b.capsule((sx * 0.185, 0.18, 0.19), (sx * 0.185, -0.2, 0.19), 0.006, frame)
    b.capsule((-0.185, 0, 0.19), (0.185, 0, 0.19), 0.006, frame)
    for x in np.linspace(-0.12, 0.12, 5):
        b.capsule((x * 0.9, -0.175, 0.46), (x, -0.25, 0.82), 0.005, frame)
    b.cushion((0, -0.252, 0.84), (0.215, 0.012, 0.04), 0.01, frame)


def sofa(b: Builder, width: float, cloth: Appearance, pillows: list[Appearance]) -> None:
    """A sofa whose back is at y = 0 and whose seat ends at y = 0.9."""
    w = width / 2
    b.cushion((0, 0.46, 0.24), (w, 0.42, 0.1), 0.04, cloth)
    b.cushion((0, 0.12, 0.52), (w, 0.11, 0.32), 0.07, cloth)
    for sx in (-1, 1):
        b.cushion((sx * (w - 0.09), 0.45, 0.4), (0.1, 0.44, 0.22), 0.07, cloth)
        half = (w - 0.2) / 2
        b.cushion((sx * half, 0.53, 0.41), (half - 0.006, 0.36, 0.08), 0.05, cloth)
        b.cushion((sx * half, 0.3, 0.62), (half - 0.02, 0.09, 0.2), 0.08, cloth, axes=tilt("x", 12))
        for y in (0.12, 0.82):
            b.rod((sx * (w - 0.1), y, 0.0), (sx * (w - 0.12), y, 0.15), 0.014, OAK, end=0.02)
    for k, look in enumerate(pillows):
        x = (-w + 0.38, w - 0.4, w - 0.72)[k % 3]
        axes = tilt("z", (-14, 12, 6)[k % 3]) @ tilt("x", 24)
        b.cushion((x, 0.47 + 0.05 * (k == 2), 0.65), (0.21, 0.06, 0.2), 0.058, look, axes=axes)


def bookshelf(b: Builder, width: float, height: float, rng: np.random.Generator, look: Appearance = WALNUT) -> None:
    """Shelves of books whose backs are at x = 0 and whose fronts face +x; y is 0 to ``width`` along a shelf."""
    depth, board = 0.29, 0.022
    b.box((0, 0, 0), (depth, board, height), look)
    b.box((0, width - board, 0), (depth, width, height), look)
    b.box((0, width / 2 - board / 2, 0.06), (depth - 0.01, width / 2 + board / 2, height), look)
    b.box((0, 0, 0.05), (0.008, width, height), look)
    levels = np.linspace(0.06, height - board, 6)
    for z in levels:
        b.box((0.008, board, z), (depth - 0.005, width - board, z + board), look)
    for shelf, z in enumerate(levels[:-1]):
        for bay in (0, 1):
            start = board + 0.012 + bay * (width / 2 - board / 2)
            stop = start + width / 2 - 1.5 * board - 0.03
            _fill_shelf(b, start, stop, z + board, levels[1] - levels[0] - board, depth, rng, (2 * shelf + bay) % 4)


def _fill_shelf(b: Builder, start, stop, z, room, depth, rng, kind: int) -> None:
    """Upright books from ``start`` to ``stop`` along y.

    kind: 0 books only, 1 with a vase, 2 with a pile of books, 3 with a box at the end; for 1 to 3, the last book leans.
    """
    end = stop - (0.0, 0.22, 0.3, 0.16)[kind]
    y = start
    while y < end - 0.05:
        thick, tall, deep = rng.uniform(0.014, 0.048), room * rng.uniform(0.62, 0.93), depth * rng.uniform(0.55, 0.78)
        front = depth - 0.03 - rng.uniform(0, 0.025)
        if y + thick > end:
            break
        book = Appearance("book", "#ffffff", "#ffffff", 0.15)
        b.box((front - deep, y, z), (front, y + thick - 0.0015, z + tall), book, seed=int(rng.integers(1 << 20)))
        y += thick
    if kind and y < end + 0.1:  # a leaning book
        axes = tilt("x", 13)
        thick, tall = 0.012, room * 0.36
        centre = (depth - 0.13, y + 0.018 + tall * np.sin(np.radians(13)), z + tall * np.cos(np.radians(13)) + 0.003)
        b.turned_box(centre, (0.085, thick, tall), Appearance("book"), axes=axes, seed=int(rng.integers(1 << 20)))
    at = (stop - 0.09, depth / 2 + 0.02)
    if kind == 1:
        colour = str(rng.choice(["#c9b79c", "#5b7f86", "#b0583c"]))
        b.ball((at[1], at[0], z + 0.075), (0.06, 0.06, 0.075), Appearance("plain", colour, colour, 0.5))
        b.rod((at[1], at[0], z + 0.135), (at[1], at[0], z + 0.2), 0.018, Appearance("plain", colour, colour, 0.5), end=0.027)
    elif kind == 2:
        for k in range(4):
            b.turned_box((depth / 2 + 0.02, stop - 0.13, z + 0.018 + 0.036 * k), (0.085, 0.017, 0.11 - 0.008 * k),
                         Appearance("book"), axes=tilt("z", rng.uniform(-8, 8)) @ LYING, seed=int(rng.integers(1 << 20)))
    elif kind == 3:
        colour = str(rng.choice(["#d9c9a3", "#8b9a86", "#35506b"]))
        b.box((0.05, stop - 0.14, z), (depth - 0.04, stop, z + 0.16), Appearance("weave", colour, "#efe6d2"))


def floor_lamp(b: Builder, shade: Appearance, bulb: Appearance) -> np.ndarray:
    """A floor lamp on three thin rods.  Returns the bulb's local position (3,)."""
    for angle in np.radians([20, 140, 260]):
        foot = (0.24 * np.cos(angle), 0.24 * np.sin(angle), 0)
        b.rod(foot, (0.015 * np.cos(angle), 0.015 * np.sin(angle), 1.3), 0.009, OAK)
    b.rod((0, 0, 1.27), (0, 0, 1.4), 0.012, BRASS)
    b.rod((0, 0, 1.36), (0, 0, 1.66), 0.21, shade, end=0.15, caps=False)
    b.ball((0, 0, 1.48), 0.04, bulb)
    return np.array([0, 0, 1.48])


def pendant(b: Builder, ceiling: float, height: float, shade: Appearance, bulb: Appearance) -> np.ndarray:
    """A lamp on a cable from ``ceiling``.  height: of the lamp.  Returns the bulb's local position (3,)."""
    b.rod((0, 0, ceiling - 0.025), (0, 0, ceiling), 0.05, BLACK)
    b.capsule((0, 0, height + 0.2), (0, 0, ceiling - 0.02), 0.0035, BLACK)
    b.rod((0, 0, height + 0.13), (0, 0, height + 0.21), 0.042, BRASS, end=0.02)
    b.rod((0, 0, height - 0.04), (0, 0, height + 0.15), 0.22, shade, end=0.035, caps=False)
    b.ball((0, 0, height + 0.03), 0.045, bulb)
    return np.array([0, 0, height + 0.03])


def plant(b: Builder, rng: np.random.Generator, height: float = 1.5, stems: int = 11, pot: str = "#c9c2b4") -> None:
    """A potted plant: thin bent stems with pointed leaves."""
    look = Appearance("plain", pot, pot, 0.3)
    b.rod((0, 0, 0), (0, 0, 0.32), 0.13, look, end=0.18, caps=False)
    b.rod((0, 0, 0.27), (0, 0, 0.29), 0.17, Appearance("plaster", "#3b2b20", "#3b2b20"))
    stem = Appearance("plain", "#5c7a3f", "#5c7a3f")
    for k in range(stems):
        angle = 2 * np.pi * (k + rng.uniform(-0.3, 0.3)) / stems
        out = np.array([np.cos(angle), np.sin(angle), 0])
        tall, reach = height * rng.uniform(0.55, 1.0), rng.uniform(0.12, 0.42)
        s = np.linspace(0, 1, 6)
        line = np.array([0, 0, 0.28]) + np.outer(s**1.8 * reach, out) + np.outer(s * (tall - 0.28), [0, 0, 1.0])
        line[1:] += rng.normal(0, 0.012, (5, 3))
        b.cable(line, 0.0045, stem)
        for i in range(2, 6):
            for side in (-1, 1):
                spread = angle + side * rng.uniform(0.4, 1.4)
                along = np.array([np.cos(spread), np.sin(spread), rng.uniform(-0.5, 0.35)])
                axes = frame_along(along)
                size = rng.uniform(0.09, 0.16) * min(1.0, 0.45 + 0.4 * height)
                right = axes[:, 2] * size
                up = axes[:, 0] * size * 0.36 if abs(axes[2, 0]) < 0.5 else axes[:, 1] * size * 0.36
                b.quad(line[i] + right, right, up, LEAF, outline=2, seed=int(rng.integers(1 << 20)))


def railing(b: Builder, length: float, height: float = 0.95, pitch: float = 0.095) -> None:
    """A balustrade along +x from the origin: round bars, 12 mm in diameter, two rails and two end posts."""
    for x in np.arange(pitch, length - 0.5 * pitch, pitch):
        b.rod((x, 0, 0.08), (x, 0, height - 0.02), 0.006, BLACK, caps=False)
    b.capsule((0, 0, 0.08), (length, 0, 0.08), 0.01, BLACK)
    b.cushion((length / 2, 0, height), (length / 2 + 0.03, 0.03, 0.018), 0.015, OAK)
    for x in (0.0, length):
        b.rod((x, 0, 0), (x, 0, height), 0.017, BLACK)


def radiator(b: Builder, width: float) -> None:
    """A column radiator along x, centred at x = 0, from y = 0 to 0.1."""
    for x in np.arange(-width / 2, width / 2 + 1e-6, 0.055):
        b.capsule((x, 0.02, 0.13), (x, 0.02, 0.63), 0.011, WHITE)
        b.capsule((x, 0.08, 0.13), (x, 0.08, 0.63), 0.011, WHITE)
    for z in (0.13, 0.63):
        b.capsule((-width / 2, 0.05, z), (width / 2, 0.05, z), 0.022, WHITE)
    b.rod((width / 2 + 0.05, 0.05, 0), (width / 2 + 0.05, 0.05, 0.13), 0.009, STEEL)


def picture(b: Builder, x: float, z: float, width: float, seed: int, frame: Appearance = BLACK, margin: float = 0.05) -> None:
    """A framed print on the wall y = 0 centred at (x, z), facing +y.  width: of the printed sheet; width / height is 0.7."""
    hx, hz, t = width / 2, width / 1.4, 0.014
    b.quad((x, 0.012, z), (-hx, 0, 0), (0, 0, hz), Appearance("poster", shininess=0.1), seed=seed)
    b.box((x - hx - margin, 0, z - hz - margin), (x + hx + margin, 0.009, z + hz + margin), WHITE)
    ox, oz = hx + margin, hz + margin
    for low, high in (((-ox - t, -oz - t), (ox + t, -oz)), ((-ox - t, oz), (ox + t, oz + t)),
                      ((-ox - t, -oz), (-ox, oz)), ((ox, -oz), (ox + t, oz))):
        b.box((x + low[0], 0, z + low[1]), (x + high[0], 0.025, z + high[1]), frame)


def carton(b: Builder, x: float, y: float, z: float, size, yaw: float, rng: np.random.Generator) -> None:
    """A taped cardboard box whose bottom is at z.  size: (3,) metres; yaw: degrees."""
    half = np.asarray(size) / 2
    b.turned_box((x, y, z + half[2]), half, Appearance("carton", "#b48a5a", "#d9b98c"), axes=tilt("z", yaw),
                 seed=int(rng.integers(1 << 20)))


def tableware(b: Builder, rng: np.random.Generator, z: float) -> None:
    """A bowl of fruit, mugs, plates, a jug with twigs and a magazine, around the origin on a table top at height z."""
    bowl = Appearance("plain", "#3f6470", "#3f6470", 0.4)
    b.rod((0.1, 0.02, z), (0.1, 0.02, z + 0.08), 0.06, bowl, end=0.14, caps=False)
    for k, colour in enumerate(("#c8412c", "#d98a2b", "#8fa63a", "#d9b23c")):
        a = 1.57 * k + 0.4
        b.ball((0.1 + 0.055 * np.cos(a), 0.02 + 0.055 * np.sin(a), z + 0.075), 0.04, Appearance("plain", colour, colour, 0.3))
    for x, y, colour in ((-0.45, -0.22, "#e8e3d6"), (0.5, 0.22, "#c46a43"), (-0.52, 0.2, "#e8e3d6")):
        cup = Appearance("plain", colour, colour, 0.4)
        b.rod((x, y, z), (x, y, z + 0.095), 0.036, cup, end=0.041, caps=False)
        b.rod((x, y, z + 0.06), (x, y, z + 0.062), 0.037, Appearance("plain", "#3a2216", "#3a2216", 0.4))
        angle = rng.uniform(0, 6.28)
        u = np.array([np.cos(angle), np.sin(angle), 0])
        ring = [np.array([x, y, z + 0.05]) + u * (0.04 + 0.024 * np.sin(s)) + np.array([0, 0, 0.026 * np.cos(s)])
                for s in np.linspace(0, np.pi, 5)]
        b.cable(np.array(ring), 0.005, cup)
    for x, y in ((-0.25, 0.24), (0.3, -0.24)):
        b.rod((x, y, z), (x, y, z + 0.012), 0.07, WHITE, end=0.125)
    jug = Appearance("plain", "#dcd5c4", "#dcd5c4", 0.3)
    b.rod((-0.18, 0.0, z), (-0.18, 0.0, z + 0.12), 0.05, jug, end=0.06, caps=False)
    b.rod((-0.18, 0.0, z + 0.12), (-0.18, 0.0, z + 0.2), 0.06, jug, end=0.035, caps=False)
    twig = Appearance("plain", "#5a4030", "#5a4030")
    for k in range(7):
        a, lean = 0.9 * k + rng.uniform(-0.2, 0.2), rng.uniform(0.05, 0.17)
        tip = np.array([-0.18 + lean * np.cos(a), lean * np.sin(a), z + rng.uniform(0.4, 0.55)])
        root = np.array([-0.18, 0, z + 0.1])
        b.cable(np.array([root, (root + tip) / 2 + rng.normal(0, 0.015, 3), tip]), 0.0028, twig)
        for s in (0.7, 0.85, 1.0):
            spot = root + (tip - root) * s + rng.normal(0, 0.012, 3)
            b.ball(spot, 0.011, Appearance("plain", "#d9d3c0" if k % 2 else "#b9483c", "#b9483c"))
    magazine(b, 0.42, -0.06, z, 25, int(rng.integers(1000)))


def magazine(b: Builder, x: float, y: float, z: float, yaw: float, seed: int) -> None:
    """A magazine that lies at height z.  yaw: degrees."""
    axes = tilt("z", yaw)
    b.turned_box((x, y, z + 0.003), (0.105, 0.14, 0.003), Appearance("page", shininess=0.3), axes=axes, seed=seed)
