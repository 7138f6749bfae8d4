"""A photograph without a pose whose pose was found in the scan: which file, its lens and where it was taken.

Frame: the document's (the scan file's) coordinates, float64; the camera's axes are those of viewer.picture.camera.
"""

from dataclasses import dataclass, field
from pathlib import Path

from ...common.errors import InputError
from ...common.rigid_transform import Rows, check_rigid
from ..json_values import UNLESS_DEFAULT

MOST_PLACED = 1000
"""Photographs that a document may place."""
_MOST_PIXELS = 1 << 16


@dataclass(frozen=True)
class PlacedPhotograph:
    """path: a JPEG or PNG, or an E57 that holds the picture at ``number`` of its images; a project stores it relative to
    itself.  name: for lists.  width, height: pixels of the picture.  focal: pixels; the principal point is the centre.
    camera_to_world: rigid.  residual: root mean square distance, pixels, of the features that agree with it; matches: their
    number.  within: errors of the place (file units) and of the direction (degrees) that 95 of 100 poses stay below, None: not
    known; uncertain: whether they are large.
    Raises InputError naming a bad value.
    """

    path: str
    name: str
    width: int
    height: int
    focal: float
    camera_to_world: Rows
    residual: float
    matches: int
    number: int | None = field(default=None, metadata=UNLESS_DEFAULT)
    within: tuple[float, float] | None = field(default=None, metadata=UNLESS_DEFAULT)
    uncertain: bool = field(default=False, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        check_rigid(self.camera_to_world, f"{self.name}: camera_to_world")
        if not (0 < self.width <= _MOST_PIXELS and 0 < self.height <= _MOST_PIXELS):
            raise InputError(f"photograph of {self.width} x {self.height} pixels", file=self.path)
        if not 0.02 * self.width < self.focal < 200 * self.width:
            raise InputError(f"focal length {self.focal!r} pixels of a photograph {self.width} wide", file=self.path)
        if not (self.residual >= 0 and self.matches >= 0):
            raise InputError(f"residual {self.residual!r} of {self.matches!r} features: expected numbers from 0",
                             file=self.path)

        if self.within is not None and not min(self.within) >= 0:
            raise InputError(f"within {self.within!r}: expected two numbers from 0", file=self.path)

    @property
    def file_name(self) -> str:
        """Of the file, without folders."""
        return Path(self.path).name
