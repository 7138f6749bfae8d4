"""How notes are drawn over the picture, whichever tool is selected."""

from typing import TYPE_CHECKING

import numpy as np

from ..tool import Overlay, ToolContext

if TYPE_CHECKING:
    from ...kit.overlay import OverlayCanvas

COLOUR_OF = {"open": "warn", "in progress": "blue", "done": "green"}
"""Status of a note -> colour of its marker (theme.OVERLAY_COLOURS); a test compares them with those of saved pictures."""
SIZE = 6.0
"""Half the width of a marker, design units."""


class NoteMarkers(Overlay):
    """All notes of the document: a square each, with its title."""

    name = "notes"

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        notes = context.document.annotations
        if not notes:
            return
        at, inside = overlay.place([note.position for note in notes])
        seen = np.flatnonzero(inside).tolist()
        if seen:
            overlay.labels([notes[number].position for number in seen], [notes[number].title(number) for number in seen])
        for number in seen:
            overlay.mark(at[number], COLOUR_OF[notes[number].status], SIZE, "block")


def note_at(context: ToolContext, position: tuple[float, float], radius: float) -> int | None:
    """The note whose marker is nearest to a position in the picture, within ``radius`` pixels of it; None where there is
    none."""
    notes = context.document.annotations
    if not notes:
        return None
    places, depths = context.camera.project(np.array([note.position for note in notes]))
    with np.errstate(invalid="ignore"):
        away = np.where(depths > 0, np.linalg.norm(places - np.array(position), axis=1), np.inf)
    nearest = int(np.argmin(away))
    return nearest if away[nearest] <= radius else None
