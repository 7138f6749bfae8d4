"""Work of the Align tool on a thread: comparing surfaces (ICP), and fitting the floor that a scan is levelled to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....common.rigid_transform import Rows, combined, inverse
from ....picture.clip import Vector
from ....work.fits.fit import fit_at
from ....work.registration.align_surfaces import Alignment, align_surfaces
from ....work.registration.levelling import levelled
from ....work.registration.moved_files import points_of
from ....work.scan_files import FilePart

if TYPE_CHECKING:
    from ....grid.scene import Scene
    from ....work.places.pick import Kept


@dataclass(frozen=True, eq=False)
class Moved:
    """What came of it.  number: of the file.  before, after: its transformation.  text: for a person.  label: of the step.
    unsure: of the place beside the others, 95 %, file units; None: not known."""

    number: int
    before: Rows
    after: Rows
    label: str
    text: str
    unsure: float | None = None


def refine_work(scene: "Scene", parts: Sequence[FilePart], number: int, before: Rows, start: Rows, name: str,
                unit: str) -> Callable[[], Moved]:
    """Compares the surfaces of a file with those of all others.  before: its transformation now.  start: the one to begin with.
    Raises InputError on the thread as align_surfaces does."""

    def work() -> Moved:
        moving = points_of(scene, [parts[number]])
        fixed = points_of(scene, [part for other, part in enumerate(parts) if other != number])
        found = align_surfaces(moving, fixed, combined(start, inverse(before)))
        return Moved(number, before, combined(found.transform, before), f"Refine the place of {name}", result_text(found, unit),
                     found.uncertainty)

    return work


def result_text(found: Alignment, unit: str) -> str:
    """What is known of an alignment, in three short lines."""
    return (f"surfaces agree to {found.rms:.2g} {unit} (RMS)\n{100 * found.overlap:.0f} % of it overlaps\n"
            f"place certain to {found.uncertainty:.1g} {unit} (95 %)")


def level_work(scene: "Scene", part: FilePart, kept: "Kept | None", position: Vector, number: int, before: Rows, name: str,
               up: Vector) -> Callable[[], Moved]:
    """Fits the plane at a place to the points of one file, and makes it horizontal.  kept: which points are drawn.  Raises
    InputError on the thread where there is none, or no floor."""

    def of_part(xyz: np.ndarray, scans: np.ndarray, index: np.ndarray) -> np.ndarray:
        mine = np.isin(scans, list(part.numbers))
        return mine if kept is None else mine & kept(xyz, scans, index)

    def work() -> Moved:
        fit = fit_at(scene, position, "plane", of_part)
        motion = levelled(np.array(fit.place), np.array(fit.direction), np.array(up))
        return Moved(number, before, combined(motion, before), f"Level {name}", f"floor was tilted by {fit.tilt(up):.3f}°")

    return work
