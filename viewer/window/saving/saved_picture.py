"""What F12 saves: the picture of the window, and the description by which ``render --like`` draws it again, also larger."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...work.pictures.shot_metadata import Shot, describe_shot
from ..viewport.planned_picture import scaled

if TYPE_CHECKING:
    from ..session.session import Session
    from ..viewport.viewport import Viewport


def shot_of(session: "Session", name: str) -> Shot | None:
    """The description of what is shown, at the size that is saved; None without a scene, or where the picture shows what no
    description holds: a photograph or the tint of provenance."""
    scene, work = session.scene, session.work
    if scene is None or min(session.area.size) == 0 or work.tint or work.photo is not None:
        return None
    spec = session.spec
    return describe_shot(scene, replace(spec, camera=replace(scaled(spec.camera, work.shot_scale), name=name)))


def saved_picture(session: "Session", viewport: "Viewport", name: str) -> tuple[np.ndarray, Shot | None] | None:
    """The picture at the window's size, (H, W, 3) uint8, and its description; None without a scene.

    Raises PointglassError where it cannot be made.
    """
    shot, image = shot_of(session, name), viewport.full_picture()
    if shot is not None and viewport.renderer is not None:
        shot = shot.drawn_with(viewport.renderer.choice.timed)
    return None if image is None else (image, shot)
