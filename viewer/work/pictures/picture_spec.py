"""The description of one picture: every value that decides its pixels, taken from the document and the view settings.

The window draws a picture again where the description differs from the one drawn last, and F12 stores the description that
was drawn.  A new field of Document that changes pictures belongs to Alterations, and is then part of every description.
"""

from dataclasses import dataclass, field, fields

from ...picture.camera import Camera
from ...picture.settings import Settings
from ..document import Alterations

_COMPOSED = ("background", "split_at")
"""Fields that are applied when pictures are put together, not when they are rendered."""


@dataclass(frozen=True, eq=False)
class PictureSpec:
    """camera: at the size of the picture.  settings: its view is that of the right side.  views: those shown, left first.
    alterations: of the document.  tint: whether pixels are coloured by provenance.  background: a key of
    viewer.picture.settings.BACKGROUNDS.  split_at: share of the width at which the second view begins."""

    camera: Camera
    settings: Settings
    views: tuple[str, ...]
    alterations: Alterations = field(default_factory=Alterations)
    tint: bool = False
    background: str = "plain"
    split_at: float = 0.5

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PictureSpec) and self._key(()) == other._key(())

    def __hash__(self) -> int:
        return hash(self._key(()))

    def renders_as(self, other: "PictureSpec | None") -> bool:
        """Whether both need the same rendering; they may be put together differently."""
        return other is not None and self._key(_COMPOSED) == other._key(_COMPOSED)

    def _key(self, without: tuple[str, ...]) -> tuple:
        camera = self.camera
        lens = (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.camera_to_world.tobytes())
        return (lens, *(getattr(self, each.name) for each in fields(self) if each.name not in ("camera", *without)))
