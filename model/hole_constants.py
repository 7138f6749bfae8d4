"""Constants and window sizes of the hole test, shared by its shaders and model/hole_test.py; imports no torch."""

REACH_SHARE = 16
"""Holes are looked across to 1 / 16 of the picture's longer side, and three eighths of that more.  With 1 / 20 sparse ground
seen from the air had gaps again; with this the frame of two pumps, seen from so far that it is as narrow, is filled."""
FINE_LEVELS = 2
"""Blocks of 2 and of 4 pixels; the latter are the cells of what follows."""
AROUND = tuple((dx, dy) for dy in range(-2, 3) for dx in range(-2, 3) if max(abs(dx), abs(dy)) == 2)
"""(dx, dy), in cells, to the sixteen windows of a cell each that are nearest; at other distances so many times as far."""
SMOOTH = (1, 2, 3, 4, 5, 4, 3, 2, 1)
"""Weights along rows and columns of cells: whole numbers, so that sums are exact in any order."""
MOST = sum(SMOOTH) ** 2
"""What the weights of a cell's neighbourhood add up to."""
OPAQUE = 127
"""Levels of opacity above none."""
BACKGROUND_BELOW, OPAQUE_FROM = 3 * MOST / 8, 5 * MOST / 8
"""Of MOST: holes near a pixel up to which it is background, and from which it is opaque; around the middle, so that outlines
stay where a threshold had them.  Between lie six to eight pixels: softer ones let haze grow around what is thin."""
COVER_SLOPE = OPAQUE / (OPAQUE_FROM - BACKGROUND_BELOW)


def fine_levels(width: int, height: int) -> int:
    """Levels of blocks whose neighbours are asked: blocks of 4 pixels only where they are no larger than the reach."""
    return FINE_LEVELS if max(width, height) >= REACH_SHARE << FINE_LEVELS else 1


def strides(width: int, height: int) -> list[int]:
    """Cells from one of the sixteen windows to the next, for each distance, ascending; none where no side has 128 pixels.

    Each is half the next, so that nothing between two distances is missed.
    """
    stride, out = (max(width, height) // REACH_SHARE >> FINE_LEVELS) // 2, []
    while stride:
        out.insert(0, stride)
        stride //= 2
    return out


def window_reach(stride: int) -> int:
    """Cells on each side of a window's middle: 0, 1, 2, 3, 3, 4, 5, 6, ...

    A window is about three quarters as wide as it is far, where half would meet the one beside it: between such, a few sparse
    points were seen through by chance; windows as wide as they are far took single leaves for a wall.
    """
    return 3 * stride // 4
