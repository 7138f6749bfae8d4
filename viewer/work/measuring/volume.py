"""A volume above and below a base plane inside a polygon: the value that a measurement keeps, shows and writes.

Frame: file coordinates, file units cubed; heights along the up axis.
"""

from dataclasses import dataclass, field

import numpy as np

from ...common.errors import InputError
from ...picture.clip import Vector
from ...picture.json_values import UNLESS_DEFAULT

_LARGEST = 1e100  # of a number in a file; its square is finite


@dataclass(frozen=True)
class Volume:
    """cut: above the base.  fill: below it.  uncertainty, cut_uncertainty, fill_uncertainty: of cut - fill and of each, 95 %.
    place: of the base, in the middle of the polygon.  slope: (3,) from the up axis to the normal of the base, whose component
    along it is 1: up + slope; zero where it is level.  area: of the polygon seen along the up axis.  cell: side of a grid cell.
    empty: share of the area without points, which was interpolated.  layered: share in which points lie on two surfaces.
    count: of points.  dates: names of the files before and after, where it lies between their surfaces: cut is what the surface
    after lacks, fill what it has more; () where it is above and below a base.
    in_box: whether it is what a box holds above its lowest face; fill is 0 then.

    Raises InputError where a value is no finite number, or below 0.
    """

    cut: float
    fill: float
    uncertainty: float
    cut_uncertainty: float
    fill_uncertainty: float
    place: Vector
    slope: Vector
    area: float
    cell: float
    empty: float
    layered: float
    count: int
    dates: tuple[str, ...] = field(default=(), metadata=UNLESS_DEFAULT)
    in_box: bool = field(default=False, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        sizes = (self.cut, self.fill, self.uncertainty, self.cut_uncertainty, self.fill_uncertainty, self.area, self.cell,
                 self.empty, self.layered, self.count)  # fmt: skip
        if not (np.abs((*sizes, *self.place, *self.slope)) < _LARGEST).all() or min(sizes) < 0:
            raise InputError("a volume has a value that is no finite number, too large, or below 0")
        if len(self.dates) not in (0, 2):
            raise InputError(f"a volume between {len(self.dates)} dates: expected two names, or none")

    @property
    def net(self) -> float:
        """What lies above the base, less what is missing below it."""
        return self.cut - self.fill
