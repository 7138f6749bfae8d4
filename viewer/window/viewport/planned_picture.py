"""The description of what is rendered for a picture that is asked for: with what its plan leaves out."""

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ...picture.spec import PictureSpec
    from ..planning.picture_plan import Plan


def scaled(camera: "Camera", scale: float) -> "Camera":
    """The same view with sides of ``scale`` times the pixels."""
    if scale == 1.0:
        return camera
    return camera.resized(max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))


def as_planned(spec: "PictureSpec", plan: "Plan", begun: str | None) -> "PictureSpec":
    """The description of what is rendered for ``spec``, with what the plan leaves out.  begun: the network started besides."""
    photos = spec.settings.photos if plan.photographs else "off"
    settings = replace(spec.settings, lod=plan.level, quality=plan.network or begun or spec.settings.quality, photos=photos)
    return replace(spec, camera=scaled(spec.camera, plan.scale), settings=settings, views=plan.views)
