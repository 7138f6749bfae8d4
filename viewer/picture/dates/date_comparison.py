"""A comparison of two files of a document, or of a file with a mesh beside it: what was compared and how it is shown.  Plain
values, kept in projects and pictures.

The distances are not kept: they follow from the files and these values, and are computed again where they are shown
(viewer.work.comparing.scene_changes); 10 million against 10 million points take about a minute, their distances would take
160 MB.  Files are known by name and number of records, as sets of points are (viewer.picture.point_sets), meshes by name and
number of triangles; where a mesh stands is its layer's (viewer.picture.meshes.mesh_layer).
"""

import math
from dataclasses import dataclass, field, replace

from ...common.errors import InputError
from ..json_values import UNLESS_DEFAULT
from ..point_sets import FileKey

FROM_MODEL = "c2m"
"""The method of a comparison with a mesh: each point of the scan to the nearest triangle."""
COMPARE_METHODS = ("m3c2", "c2c", FROM_MODEL)
SHOWN_DATES = ("change", "after", "before")
"""What is drawn: the points after in the colours of their change, or the points of one date in their own colours."""


@dataclass(frozen=True)
class ChangeFigures:
    """What a comparison found.  points: of the file after.  known: of these with a counterpart.  changed: of these by more than
    their uncertainty.  median, sd: of the distances; uncertainty: their median; file units, None where none is known."""

    points: int
    known: int
    changed: int
    median: float | None = None
    sd: float | None = None
    uncertainty: float | None = None

    def differs(self, other: "ChangeFigures") -> bool:
        """Whether these are figures of other points: more apart than the last digits of another processor."""
        if (self.points, self.known) != (other.points, other.known):
            return True
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("median", "sd", "uncertainty"))
        return any((a is None) != (b is None) or (a is not None and not math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-12))
                   for a, b in pairs)


@dataclass(frozen=True)
class DateComparison:
    """before, after: the files; with FROM_MODEL ``before`` is a mesh.  method: of COMPARE_METHODS.  registration: uncertainty
    (95 %) of their position to each other, file units.  shown: of SHOWN_DATES.  limit: where the colours end, file units; None:
    chosen by the changes.  certain: only changes above their uncertainty have a colour.  figures: what was found, None in the
    description of a picture.  model: which of the meshes of that name it is, from 0.

    Raises InputError naming a bad value.
    """

    before: FileKey
    after: FileKey
    method: str = "m3c2"
    registration: float = 0.0
    shown: str = "change"
    limit: float | None = None
    certain: bool = False
    figures: ChangeFigures | None = field(default=None, metadata=UNLESS_DEFAULT)
    model: int = field(default=0, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        for name, value, choices in (("method", self.method, COMPARE_METHODS), ("shown", self.shown, SHOWN_DATES)):
            if value not in choices:
                raise InputError(f"comparison: {name} {value!r:.40}: expected one of {', '.join(choices)}")
        if not 0 <= self.registration < math.inf or not (self.limit is None or 0 < self.limit < math.inf):
            raise InputError(f"comparison: registration {self.registration!r}, limit {self.limit!r}: expected finite numbers, "
                             "the limit above 0")
        if self.with_model and self.shown == "before":
            raise InputError("comparison: shown 'before': a model has no points that could be shown")

    @property
    def with_model(self) -> bool:
        """Whether a scan is compared with a mesh."""
        return self.method == FROM_MODEL

    @property
    def compared(self) -> tuple[FileKey, FileKey, str, float, int]:
        """What decides the distances, besides the place of a mesh."""
        return self.before, self.after, self.method, self.registration, self.model

    @property
    def in_picture(self) -> "DateComparison":
        """What decides pictures."""
        return replace(self, figures=None)
