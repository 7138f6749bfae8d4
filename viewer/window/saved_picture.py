"""What F12 saves: the picture of the window, and the description by which ``render --like`` draws it again, also larger."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..tools.altered_pictures import labelled, split_column
from ..tools.shot_metadata import Shot, describe_shot
from .viewport import scaled

if TYPE_CHECKING:
    from .session import Session
    from .viewport import Viewport

LARGEST = 4
"""Times the sides of the window's picture."""


def shot_of(session: "Session", name: str) -> Shot | None:
    """The description of what is shown, at the size that is saved; None without a scene, or where the picture shows what no
    description holds: a photograph, or the tint of provenance."""
    scene, work = session.scene, session.work
    if scene is None or min(session.area.size) == 0 or work.tint or work.photo is not None:
        return None
    chosen, sides = session.view_settings, session.view_settings.sides
    camera = replace(scaled(session.camera, work.shot_scale), name=name)
    return describe_shot(
        scene, camera, replace(chosen.settings, view=sides[0]), background=chosen.background,
        exposures="matched" if scene.matched else "as-scanned", alterations=work.document.alterations,
        other_view=sides[1] if len(sides) == 2 else "", split_at=chosen.split_at,
    )  # fmt: skip


def saved_picture(session: "Session", viewport: "Viewport", name: str) -> tuple[np.ndarray, Shot | None] | None:
    """The picture at the window's size, (H, W, 3) uint8, and its description; None without a scene.

    Raises PointglassError where it cannot be made.
    """
    shot = shot_of(session, name)
    image = viewport.full_picture()
    if image is None:
        return None
    sides = session.view_settings.sides
    if len(sides) == 2:
        labelled(image, split_column(session.view_settings.split_at, image.shape[1]), (sides[0], sides[1]))
    return image, shot
