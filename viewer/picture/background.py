"""What is behind a picture where nothing was measured or filled: the entries of viewer.picture.settings.BACKGROUNDS, in whole
numbers.

Pictures are sRGB premultiplied by alpha and blended in sRGB.  The window's last pass (shaders/present.frag) gives the same
bytes.  A background is a vertical gradient fixed to the picture, not to the world.
"""

import numpy as np

Colour = tuple[int, int, int]

PLAIN: Colour = (23, 25, 29)
"""sRGB, dark and neutral, so that it lends no colour to what is beside it."""
COLOURS: dict[str, tuple[Colour, Colour]] = {
    "black": ((0, 0, 0), (0, 0, 0)),
    "plain": (PLAIN, PLAIN),
    "gradient": ((70, 76, 86), (18, 20, 23)),
    "sky": ((96, 146, 205), (218, 230, 240)),
}
"""sRGB of the top and the bottom edge.  CIE lightness from top to bottom: plain 9, gradient 32 to 6, sky 59 to 91 (brighter
towards the horizon, as a clear sky is).  White text has a contrast of 8.6 : 1 and more on all but the sky (WCAG 2 asks for 4.5
: 1); with twice the levels the gradient's top would have 2.9 : 1, with half it would differ from plain by 6 in lightness."""


def rows(background: str, height: int) -> np.ndarray:
    """(H, 1, 3) uint8: the background's colour at the centre of each row, from top to bottom, to the nearest level."""
    top, bottom = np.array(COLOURS[background], np.int64)
    place = 2 * np.arange(height)[:, None, None] + 1  # in halves of a row
    return ((top * (2 * height - place) + bottom * place + height) // (2 * height)).astype(np.uint8)


def composite(image: np.ndarray, background: str = "plain") -> np.ndarray:
    """(H, W, 4) uint8, premultiplied, over a key of COLOURS -> (H, W, 3) uint8: what ``present.frag`` does, to the byte."""
    rgb, alpha = image[..., :3].astype(np.uint32), image[..., 3:].astype(np.uint32)
    behind = (rows(background, len(image)).astype(np.uint32) * (255 - alpha) + 127) // 255
    return np.minimum(rgb + behind, 255).astype(np.uint8)


def straight(image: np.ndarray) -> np.ndarray:
    """(H, W, 4) uint8, premultiplied -> the same not premultiplied, as PNG keeps it; colours are 0 where alpha is 0."""
    rgb, alpha = image[..., :3].astype(np.uint32), image[..., 3:].astype(np.uint32)
    whole = np.minimum((rgb * 255 + alpha // 2) // np.maximum(alpha, 1), 255) * (alpha > 0)
    return np.concatenate([whole, alpha], axis=2).astype(np.uint8)


def as_saved(image: np.ndarray, background: str) -> np.ndarray:
    """A picture (H, W, 4) uint8, premultiplied, as it is written over a key of BACKGROUNDS: (H, W, 3), for ``transparent``
    (H, W, 4) not premultiplied."""
    return straight(image) if background == "transparent" else composite(image, background)
