"""What is changed in the packed points of one grid of a place when they are read: station numbers, attribute bits, colours.

The grid on disk keeps its own numbers, bits and colours, so that nothing is converted again when other files are added or
removed. Packed points: viewer.grid.scene.
"""

from dataclasses import dataclass

import numpy as np

_COLOUR = np.uint32(0x00FFFFFF)
_LOW = np.uint32(0xFFFF)


@dataclass(frozen=True, eq=False)
class PointChange:
    """Tables by the values that the grid stores; None where nothing changes.

    first_station: what is added to a station number; sums beyond 255 are 255.  attributes: (65536,) uint32 attribute bits.
    colours: (S, 3, 256) uint32 colours by station number of the grid, channel and stored colour.  lift_black: black is a colour
    here, while the place treats black as missing colour; it becomes (1, 1, 1), as in viewer.preprocess.point_colour.
    """

    first_station: int = 0
    attributes: np.ndarray | None = None
    colours: np.ndarray | None = None
    lift_black: bool = False

    def apply(self, words: np.ndarray) -> None:
        """Changes packed points (n, 3) uint32 in place."""
        if self.attributes is not None:
            words[:, 1] = words[:, 1] & _LOW | self.attributes[words[:, 1] >> 16] << np.uint32(16)
        last = words[:, 2]
        if self.colours is not None:
            station = np.minimum(last >> np.uint32(24), len(self.colours) - 1)
            red, green, blue = (self.colours[station, channel, last >> np.uint32(8 * channel) & 0xFF] for channel in range(3))
            last = last & ~_COLOUR | red | green << np.uint32(8) | blue << np.uint32(16)
        if self.lift_black:
            last = last + np.where(last & _COLOUR, 0, 0x010101).astype(np.uint32)
        if self.first_station:
            station = np.minimum((last >> np.uint32(24)).astype(np.int64) + self.first_station, 255).astype(np.uint32)
            last = last & _COLOUR | station << np.uint32(24)
        words[:, 2] = last
