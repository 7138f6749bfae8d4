"""The compiled loops of sections: points as discs into a depth buffer, then into sums of colour.

Frame: pixels of the drawing, float64, the top left corner at (0, 0); depth along the direction of view, file units.
Sums are whole numbers, so that the order of points decides nothing.
"""

from ....model.common.jit import compiled

WEIGHTS = 255
"""Weight of a point in the middle of its disc; at the rim it is 1."""


@compiled(nogil=True)
def nearest_depths(nearest, columns, rows, depths, radii):
    """Lowers ``nearest`` (H, W) float64 to the depth of the nearest disc that covers each pixel's centre.

    columns, rows, depths, radii: (n,) float64.  A disc covers at least the pixel that its centre lies in.
    """
    height, width = nearest.shape
    for i in range(columns.shape[0]):
        x, y, reach, depth = columns[i], rows[i], radii[i], depths[i]
        own_x, own_y = int(x), int(y)
        for row in range(max(int(y - reach), 0), min(int(y + reach) + 1, height)):
            for column in range(max(int(x - reach), 0), min(int(x + reach) + 1, width)):
                way = (column + 0.5 - x) ** 2 + (row + 0.5 - y) ** 2
                if (way <= reach * reach or (column == own_x and row == own_y)) and depth < nearest[row, column]:
                    nearest[row, column] = depth


@compiled(nogil=True)
def add_colours(sums, nearest, columns, rows, depths, radii, tolerances, colours):
    """Adds the colours of discs within their tolerance behind each pixel's nearest depth.

    sums: (H, W, 4) int64, weighted red, green, blue and the weights.  tolerances: (n,) file units.  colours: (n, 3) uint8.
    """
    height, width = nearest.shape
    for i in range(columns.shape[0]):
        x, y, reach, depth = columns[i], rows[i], radii[i], depths[i] - tolerances[i]
        own_x, own_y = int(x), int(y)
        for row in range(max(int(y - reach), 0), min(int(y + reach) + 1, height)):
            for column in range(max(int(x - reach), 0), min(int(x + reach) + 1, width)):
                way = (column + 0.5 - x) ** 2 + (row + 0.5 - y) ** 2
                own = column == own_x and row == own_y
                if (way <= reach * reach or own) and depth <= nearest[row, column]:
                    weight = 1
                    if reach > 0.5 and way < reach * reach:
                        weight += int((WEIGHTS - 1) * (1.0 - way / (reach * reach)) ** 2)
                    sums[row, column, 3] += weight
                    for channel in range(3):
                        sums[row, column, channel] += weight * colours[i, channel]
