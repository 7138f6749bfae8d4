"""Pictures side by side, each above a line of text.  The font is built into Pillow."""

from collections.abc import Sequence

import numpy as np
from torch import Tensor

LINE = 18
"""Height of a line of text, pixels: 1.5 times TEXT (WCAG 2.1, 1.4.12)."""
TEXT = 12
"""Size of the font, pixels: 9 points at 96 dpi, as in the windows of Windows."""
GAP = 4
"""Distance between pictures, pixels: a third of TEXT."""
INK, PAPER = 230, 24
"""Grey levels of text and background, sRGB, 0 to 255: a contrast of 14 : 1 (WCAG 2.1 asks for 7 : 1 at level AAA)."""


def picture_bytes(picture: Tensor) -> np.ndarray:
    """(3, H, W) in 0..1 -> (H, W, 3) uint8, rounded half up as in the viewer."""
    return (picture.clamp(0, 1) * 255.0 + 0.5).floor().byte().permute(1, 2, 0).contiguous().numpy()


def text_line(text: str, width: int) -> np.ndarray:
    """(LINE, width, 3) uint8 picture of a text, cut off at ``width`` pixels."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.new("L", (width, LINE), PAPER)
    ImageDraw.Draw(image).text((GAP, 2), text, fill=INK, font=ImageFont.load_default(TEXT))
    return np.repeat(np.asarray(image)[..., None], 3, axis=2)


def labelled_row(pictures: Sequence[np.ndarray], labels: Sequence[str], title: str = "") -> np.ndarray:
    """Pictures (H, W, 3) uint8 of equal size side by side, each above its label, below the optional title."""
    spacer = np.full((pictures[0].shape[0] + LINE, GAP, 3), PAPER, np.uint8)
    parts: list[np.ndarray] = [spacer]
    for picture, label in zip(pictures, labels, strict=True):
        parts += [np.concatenate([picture, text_line(label, picture.shape[1])]), spacer]
    row = np.concatenate(parts, axis=1)
    return np.concatenate([text_line(title, row.shape[1]), row]) if title else row
