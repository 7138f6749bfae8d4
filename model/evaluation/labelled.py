"""Pictures side by side with a line of text under each, as arrays; drawn with Pillow's own font, which needs no file."""

from collections.abc import Sequence

import numpy as np
from torch import Tensor

LINE = 18  # pixels high, of text of 12 pixels
GAP = 4  # pixels between pictures
INK, PAPER = 230, 24  # sRGB grey


def picture_bytes(picture: Tensor) -> np.ndarray:
    """(3, H, W) in 0..1 -> (H, W, 3) uint8, rounded half up as the viewer's pictures are."""
    return (picture.clamp(0, 1) * 255.0 + 0.5).floor().byte().permute(1, 2, 0).contiguous().numpy()


def text_line(text: str, width: int) -> np.ndarray:
    """(LINE, width, 3) uint8 with as much of the text as fits."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.new("L", (width, LINE), PAPER)
    ImageDraw.Draw(image).text((GAP, 2), text, fill=INK, font=ImageFont.load_default(12))
    return np.repeat(np.asarray(image)[..., None], 3, axis=2)


def labelled_row(pictures: Sequence[np.ndarray], labels: Sequence[str], title: str = "") -> np.ndarray:
    """Pictures (H, W, 3) uint8 of one size side by side, each over its label; a title above where there is one."""
    spacer = np.full((pictures[0].shape[0] + LINE, GAP, 3), PAPER, np.uint8)
    parts: list[np.ndarray] = [spacer]
    for picture, label in zip(pictures, labels, strict=True):
        parts += [np.concatenate([picture, text_line(label, picture.shape[1])]), spacer]
    row = np.concatenate(parts, axis=1)
    return np.concatenate([text_line(title, row.shape[1]), row]) if title else row


def stacked(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Rows (., W, 3) uint8 of one width, one under the other."""
    return np.concatenate(list(rows))
