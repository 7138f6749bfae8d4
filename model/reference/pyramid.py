"""Image pyramid steps of the depth filter and the fill in torch: reference implementation of the GLSL passes.

Images are (H, W) or (..., H, W) tensors, row 0 at the top.  Level i + 1 has ceil(H / 2) x ceil(W / 2) pixels; pixels outside
the picture count as empty.  Any float dtype and device; in float32 the arithmetic is that of the shaders.
"""

import torch
import torch.nn.functional as F
from torch import Tensor

RING = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""(dx, dy) of the eight neighbours, in circular order."""


def half(size: int) -> int:
    """Pixels along a side of the next coarser level."""
    return (size + 1) // 2


def quads(image: Tensor, empty: float) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """The four children (top left, top right, bottom left, bottom right) of every pixel of the next coarser level."""
    h, w = image.shape[-2:]
    image = F.pad(image, (0, w & 1, 0, h & 1), value=empty)
    return (
        image[..., 0::2, 0::2], image[..., 0::2, 1::2], image[..., 1::2, 0::2], image[..., 1::2, 1::2],
    )


def _bordered(image: Tensor, rows: Tensor, columns: Tensor) -> Tensor:
    """The image with a border of one pixel, taken from the given rows (H + 2,) and columns (W + 2,) of it."""
    return image[..., rows[:, None], columns[None, :]]


def _window(bordered: Tensor, dx: int, dy: int) -> Tensor:
    """Of an image with a border of one pixel: pixel (x, y) is (x + dx, y + dy) of the image."""
    h, w = bordered.shape[-2] - 2, bordered.shape[-1] - 2
    return bordered[..., 1 + dy : 1 + dy + h, 1 + dx : 1 + dx + w]


def shifted(image: Tensor, dx: int, dy: int, empty: float) -> Tensor:
    """The image shifted by one pixel at most: pixel (x, y) is the input's (x + dx, y + dy), ``empty`` beyond the border."""
    return _window(F.pad(image, (1, 1, 1, 1), value=empty), dx, dy)


def neighbours(image: Tensor, empty: float) -> list[Tensor]:
    """The image shifted by each place of RING, ``empty`` beyond the border."""
    bordered = F.pad(image, (1, 1, 1, 1), value=empty)
    return [_window(bordered, dx, dy) for dx, dy in RING]


def mirrored_neighbours(image: Tensor) -> list[Tensor]:
    """As :func:`neighbours`, with the picture mirrored about the centres of its border pixels."""
    rows, columns = (side - 1 - (side - 1 - torch.arange(-1, side + 1, device=image.device).abs()).abs()
                     for side in image.shape[-2:])  # fmt: skip
    bordered = _bordered(image, rows.clamp_(min=0), columns.clamp_(min=0))
    return [_window(bordered, dx, dy) for dx, dy in RING]


def clamped(image: Tensor, dx: int, dy: int) -> Tensor:
    """As :func:`shifted`, by any distance, with the border repeated."""
    h, w = image.shape[-2:]
    rows = torch.arange(h, device=image.device).add_(dy).clamp_(0, h - 1)
    columns = torch.arange(w, device=image.device).add_(dx).clamp_(0, w - 1)
    return image[..., rows[:, None], columns[None, :]]


def parents(image: Tensor, height: int, width: int) -> Tensor:
    """The parent of each pixel of the finer level, at the finer level's size."""
    return image.repeat_interleave(2, -2).repeat_interleave(2, -1)[..., :height, :width]


def bilinear(image: Tensor, height: int, width: int) -> Tensor:
    """The coarser level sampled bilinearly at the finer level's pixel centres, borders repeated.

    Weights 9/16, 3/16, 3/16, 1/16, summed by rows: ((9a + 3b) + (3c + d)) / 16, with a the parent, b its horizontal, c its
    vertical and d its diagonal neighbour.
    """
    rows, columns = (torch.arange(-1, side + 1, device=image.device).clamp_(0, side - 1) for side in image.shape[-2:])
    bordered, sides = _bordered(image, rows, columns), []
    for side in (-1, 1):
        lines = []
        for vertical in (-1, 1):
            b, c, d = _window(bordered, side, 0), _window(bordered, 0, vertical), _window(bordered, side, vertical)
            lines.append(((9.0 * image + 3.0 * b) + (3.0 * c + d)) * 0.0625)
        sides.append(torch.stack(lines, -2).flatten(-3, -2))
    return torch.stack(sides, -1).flatten(-2)[..., :height, :width]
