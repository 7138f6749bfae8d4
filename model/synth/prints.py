"""Posters, book spines and magazine pages, drawn with Pillow.

An image is (H,W,3) float32, linear 0..1, row 0 at the top.  `sample` interpolates it bilinearly.
"""

from functools import lru_cache

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..common.linear_light import to_linear

PALETTES = [
    ("#f3ead7", "#c8402f", "#1d3b53", "#e3a83b"),
    ("#efe9dd", "#20484f", "#d9763d", "#8fb0a3"),
    ("#f6f1e6", "#2b2b2b", "#d94f3a", "#6d8fb5"),
    ("#e9e3d2", "#3a5a40", "#bc6c25", "#dda15e"),
    ("#f2eee8", "#5b3758", "#e07a5f", "#81b29a"),
]
WORDS = [
    "light", "field", "point", "cloud", "scan", "room", "echo", "depth", "north",
    "harbour", "garden", "winter", "letters", "music", "atlas", "river", "bridge",
]
TITLES = [
    "A HISTORY OF LIGHT", "THE ATLAS", "GARDENS", "NORTH SEA", "ON SURFACES", "COLOUR", "THE LONG ROOM", "RIVERS",
    "LETTERS", "OPTICS", "THE HOUSE", "WINTER", "FIELD NOTES", "MAPS", "TREES OF EUROPE", "BREAD", "SOUND", "FORM",
]
CLOTHS = [
    "#7a2e2a", "#23405a", "#2f4f3e", "#c9a227", "#d8d0bd", "#3b3b40", "#a6532b", "#5f6f86", "#8a3f5c", "#e4ddcc",
    "#b8c4bb", "#1f2a38", "#c65d3b", "#40706a",
]
HEADLINES = ["LICHT", "POINT", "SCAN", "RAUM", "ECHO", "DEPTH"]


def _font(size: float):
    return ImageFont.load_default(size=max(int(size), 6))


def _fitted(draw: ImageDraw.ImageDraw, text: str, width: float, size: float):
    """The default font at ``size`` pixels, reduced if ``text`` would exceed ``width`` pixels."""
    font = _font(size)
    length = draw.textlength(text, font=font)
    return font if length <= width else _font(size * width / length)


def _lines(draw, rng, x, y, width, rows, size, colour) -> None:
    """Draws a paragraph of random words in ``rows`` lines.  x, y, width, size: pixels."""
    font = _font(size)
    for row in range(rows):
        words = " ".join(rng.choice(WORDS, 12))
        fits = int(len(words) * width / draw.textlength(words, font=font))
        draw.text((x, y + row * size * 1.35), words[:fits], font=font, fill=colour)


def _shapes_poster(draw, w, h, rng, colours) -> None:
    side = 0.29 * w
    for number in range(9):
        x, y = 0.065 * w + number % 3 * side, 0.04 * h + number // 3 * side * 1.06
        ground, figure = colours[1 + number % 3], colours[(2 + number * 2) % 4]
        draw.rectangle((x, y, x + side, y + side), fill=ground)
        box, turn = (x, y, x + side, y + side), 90 * int(rng.integers(4))
        kind = (number + int(rng.integers(3))) % 4
        if kind == 0:
            inset = 0.16 * side
            draw.ellipse((x + inset, y + inset, x + side - inset, y + side - inset), fill=figure)
        elif kind == 1:
            draw.pieslice(box, turn, turn + 180, fill=figure)
        elif kind == 2:
            corners = [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]
            draw.polygon(corners[turn // 90 :][:3] + corners[: max(0, turn // 90 - 1)], fill=figure)
        else:
            for k in range(4):
                top = y + side * (0.06 + 0.25 * k)
                draw.rectangle((x, top, x + side, top + 0.12 * side), fill=figure)


def _landscape_poster(draw, w, h, rng, colours) -> None:
    draw.rectangle((0, 0, w, 0.72 * h), fill=colours[3])
    draw.ellipse((0.58 * w, 0.1 * h, 0.84 * w, 0.1 * h + 0.26 * w), fill=colours[0])
    x = np.linspace(0, w, 40)
    for layer, colour in enumerate((colours[1], colours[2])):
        ridge = 0.42 + 0.14 * layer + 0.1 * np.sin(x / w * rng.uniform(5, 9) + rng.uniform(0, 6))
        ridge += 0.03 * np.sin(x / w * 23 + layer)
        draw.polygon([(0, 0.73 * h), *zip(x, ridge * h), (w, 0.73 * h)], fill=colour)


def _chart_poster(draw, w, h, rng, colours) -> None:
    for i in range(6):
        for j in range(7):
            x, y = (0.1 + 0.135 * i) * w, (0.08 + 0.088 * j) * h
            side = 0.115 * w
            colour = colours[rng.integers(1, 4)]
            draw.rectangle((x, y, x + side, y + 0.078 * h), outline=colours[1], width=max(int(w / 160), 1))
            if rng.random() < 0.72:
                inset = rng.uniform(0.1, 0.3) * side
                box = (x + inset, y + inset, x + side - inset, y + side - inset)
                (draw.ellipse if rng.random() < 0.5 else draw.rectangle)(box, fill=colour)


def _type_poster(draw, w, h, rng, colours) -> None:
    draw.rectangle((0, 0, w, 0.73 * h), fill=colours[1])
    for row, word in enumerate(rng.permutation(HEADLINES)[:4]):
        font = _fitted(draw, word, 0.86 * w, 0.21 * h)
        draw.text((0.07 * w, (0.02 + 0.175 * row) * h), word, font=font, fill=colours[(0, 3, 2, 0)[row]])


@lru_cache(maxsize=64)
def poster(seed: int, aspect: float = 0.7) -> np.ndarray:
    """The sheet of a framed poster, 512 pixels wide.  aspect: width / height."""
    rng = np.random.default_rng([71, seed])
    w, h = 512, int(512 / aspect)
    colours = PALETTES[rng.integers(len(PALETTES))]
    image = Image.new("RGB", (w, h), colours[0])
    draw = ImageDraw.Draw(image)
    (_shapes_poster, _landscape_poster, _type_poster, _chart_poster)[seed % 4](draw, w, h, rng, colours)
    title = HEADLINES[rng.integers(len(HEADLINES))] + " " + str(rng.integers(12, 99))
    draw.text((0.07 * w, 0.745 * h), title, font=_fitted(draw, title, 0.86 * w, 0.11 * h), fill=colours[2])
    _lines(draw, rng, 0.07 * w, 0.88 * h, 0.86 * w, 3, h / 34, colours[1])
    return to_linear(np.asarray(image) / 255.0).astype(np.float32)


@lru_cache(maxsize=64)
def page(seed: int) -> np.ndarray:
    """A page of a magazine, 256 x 340 pixels: a headline, a picture and text."""
    rng = np.random.default_rng([72, seed])
    w, h = 256, 340
    image = Image.new("RGB", (w, h), "#f4f1ea")
    draw = ImageDraw.Draw(image)
    colours = PALETTES[rng.integers(len(PALETTES))]
    word = HEADLINES[rng.integers(len(HEADLINES))]
    draw.text((14, 6), word, font=_fitted(draw, word, w - 28, 60), fill=colours[1])
    draw.rectangle((14, 84, 150, 190), fill=colours[3])
    draw.polygon([(14, 190), (70, 120), (110, 170), (150, 130), (150, 190)], fill=colours[2])
    _lines(draw, rng, 160, 84, 84, 8, 10, "#333333")
    _lines(draw, rng, 14, 204, 228, 9, 10, "#333333")
    return to_linear(np.asarray(image) / 255.0).astype(np.float32)


@lru_cache(maxsize=256)
def spine(seed: int) -> np.ndarray:
    """A book's spine, 48 x 320 pixels: cloth colour, bands, and a title from top to bottom."""
    rng = np.random.default_rng([73, seed])
    cloth = CLOTHS[rng.integers(len(CLOTHS))]
    ink = "#f4ecd8" if sum(int(cloth[i : i + 2], 16) for i in (1, 3, 5)) < 420 else "#2a2622"
    image = Image.new("RGB", (320, 48), cloth)
    draw = ImageDraw.Draw(image)
    for at in rng.choice([6, 14, 24, 286, 296, 306], rng.integers(1, 4), replace=False):
        draw.rectangle((at, 0, at + rng.integers(2, 6), 48), fill=ink)
    title = TITLES[rng.integers(len(TITLES))]
    font = _fitted(draw, title, 230, rng.uniform(22, 36))
    draw.text((40, 24), title, font=font, fill=ink, anchor="lm")
    return np.rot90(to_linear(np.asarray(image) / 255.0), -1).astype(np.float32)


def sample(image: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(N,3) float64 colours at u (N,), 0 left to 1 right, and v (N,), 0 top to 1 bottom; bilinear, clamped at the edges."""
    h, w = image.shape[:2]
    x, y = np.clip(u * w - 0.5, 0, w - 1), np.clip(v * h - 0.5, 0, h - 1)
    i, j = np.minimum(x.astype(np.int64), w - 2), np.minimum(y.astype(np.int64), h - 2)
    fx, fy = (x - i)[:, None], (y - j)[:, None]
    top = image[j, i] * (1 - fx) + image[j, i + 1] * fx
    return top * (1 - fy) + (image[j + 1, i] * (1 - fx) + image[j + 1, i + 1] * fx) * fy
