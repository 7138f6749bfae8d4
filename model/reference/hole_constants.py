"""Constants and window sizes of the hole test, shared by its shaders and model/reference/hole_test.py; imports no torch."""

REACH_SHARE = 16
"""The hole test looks for measured pixels up to 1 / 16 of the picture's longer side away, and three eighths of that more.  With
1 / 20 sparse ground seen from the air had gaps; with 1 / 16 the frame of two pumps is filled when it is seen from so far that
its opening is narrower than that."""
FINE_LEVELS = 2
"""Pyramid levels: blocks of 2 and of 4 pixels a side.  The blocks of 4 pixels are the cells of the windowed test."""
DIRECTIONS = tuple((dx, dy) for dy in range(-2, 3) for dx in range(-2, 3) if max(abs(dx), abs(dy)) == 2)
"""(dx, dy), in cells, to the 16 windows of the nearest distance; at other distances these offsets are scaled."""
KERNEL = (1, 2, 3, 4, 5, 4, 3, 2, 1)
"""Smoothing weights along rows and columns of cells: integers, so that sums are exact in any order."""
KERNEL_SUM = sum(KERNEL) ** 2
"""Sum of the smoothing weights over a cell's neighbourhood."""
OPACITY_LEVELS = 127
"""Steps of opacity above 0: seven bits, the eighth of a byte marks pixels that lie far inside a surface."""
BACKGROUND_BELOW, OPAQUE_FROM = 3 * KERNEL_SUM / 8, 5 * KERNEL_SUM / 8
"""Smoothed count of hole cells, out of KERNEL_SUM, up to which a pixel is background and from which it is opaque.  The two are
symmetric about one half, so that outlines stay where a threshold would put them, and six to eight pixels apart: softer
ones grow haze around thin objects."""
COVER_SLOPE = OPACITY_LEVELS / (OPAQUE_FROM - BACKGROUND_BELOW)
"""Opacity steps for each unit of the smoothed count between BACKGROUND_BELOW and OPAQUE_FROM."""


def fine_levels(width: int, height: int) -> int:
    """Pyramid levels at which neighbouring blocks are tested: blocks of 4 pixels only where they are within the reach."""
    return FINE_LEVELS if max(width, height) >= REACH_SHARE << FINE_LEVELS else 1


def strides(width: int, height: int) -> list[int]:
    """Cells between adjacent windows, for each distance, ascending; empty where no side has 128 pixels.

    Each stride is half of the next, so that the windows of successive distances leave no gap.
    """
    stride, out = (max(width, height) // REACH_SHARE >> FINE_LEVELS) // 2, []
    while stride:
        out.insert(0, stride)
        stride //= 2
    return out


def window_reach(stride: int) -> int:
    """Cells on each side of a window's middle: 0, 1, 2, 3, 3, 4, 5, 6, ...

    A window is about three quarters as wide as its distance.  At half of the distance adjacent windows would just touch, and
    a few sparse points could be missed between them; windows as wide as their distance took single leaves for a wall.
    """
    return 3 * stride // 4
