"""How certain the places of two compared scans are, from what Align found of each."""

import math
from collections.abc import Sequence
from pathlib import Path

from ....picture.meshes.mesh_layer import MeshLayer
from ....work.document import ScanFile
from ....work.registration.moved_files import unsure_of


def aligned_unsure(sources: Sequence[str], before: int, after: int, scans: Sequence[ScanFile],
                   meshes: Sequence[MeshLayer]) -> float:
    """Uncertainty (95 %) of how two files lie to each other, or a file and a mesh, as far as Align has found it; file units.

    sources: files of the scene.  before, after: numbers among them, from their count on of meshes.  scans, meshes: of the
    document."""
    known: list[float | None] = []
    for number in (before, after):
        if number < len(sources):
            known.append(unsure_of(scans, Path(sources[number])))
        elif number - len(sources) < len(meshes):
            known.append(meshes[number - len(sources)].unsure)
    return math.hypot(*(unsure or 0.0 for unsure in known))
