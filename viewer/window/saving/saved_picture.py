"""What F12 saves: the picture of the window, and the description by which ``render --like`` draws it again, also larger."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...work.pictures.altered_pictures import labelled, split_column
from ...work.pictures.shot_metadata import Shot, describe_shot
from ..viewport.viewport import scaled

if TYPE_CHECKING:
    from ..session.session import Session
    from ..viewport.viewport import Viewport


def shot_of(session: "Session", name: str) -> Shot | None:
    """The description of what is shown, at the size that is saved; None without a scene, or where the picture shows what no
    description holds: a photograph, or the tint of provenance."""
    scene, work = session.scene, session.work
    if scene is None or min(session.area.size) == 0 or work.tint or work.photo is not None:
        return None
    spec = session.spec
    camera = replace(scaled(spec.camera, work.shot_scale), name=name)
    return describe_shot(
        scene, camera, replace(spec.settings, view=spec.views[0]), background=spec.background,
        exposures="matched" if scene.matched else "as-scanned", alterations=spec.alterations,
        other_view=spec.views[1] if len(spec.views) == 2 else "", split_at=spec.split_at,
    )  # fmt: skip


def saved_picture(session: "Session", viewport: "Viewport", name: str) -> tuple[np.ndarray, Shot | None] | None:
    """The picture at the window's size, (H, W, 3) uint8, and its description; None without a scene.

    Raises PointglassError where it cannot be made.
    """
    shot = shot_of(session, name)
    image = viewport.full_picture()
    if image is None:
        return None
    spec = session.spec
    if len(spec.views) == 2:
        labelled(image, split_column(spec.split_at, image.shape[1]), (spec.views[0], spec.views[1]))
    return image, shot
