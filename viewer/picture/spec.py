"""The description of one picture: every value that decides its pixels, besides the scan.

The window draws a picture again where the description differs from the one drawn last; F12, ``render --like``, films and
Python make their pictures from the same value (viewer.render.described_picture), and a PNG keeps it as JSON
(viewer.work.pictures.shot_metadata).  What changes pictures of a document is a field of viewer.picture.edits, and is then part
of every description.
"""

from dataclasses import dataclass, field, fields, replace
from typing import Any, cast

import numpy as np

from ..common.errors import InputError
from .camera import Camera
from .edits import NO_EDITS, Edits
from .json_values import from_json, to_json
from .meshes.mesh_layer import shown_meshes
from .settings import BACKGROUNDS, Settings
from .views import VIEWS

_COMPOSED = {"composed": True}
"""Marks fields that are applied when pictures are put together, not when they are rendered."""


@dataclass(frozen=True, eq=False)
class PictureSpec:
    """A value: equal ones make the same picture of the same scan.  The camera's name does not count.

    camera: at the size of the picture.  settings: their view becomes the first of ``views``.  views: one, or the two of a
    comparison, left first; () is the view of the settings.  edits: of a document.  tint: whether pixels are coloured by
    provenance.  background: a key of viewer.picture.settings.BACKGROUNDS.  split_at: share of the width at which the second
    view begins.  other_edits: of the second view, where it shows other points, such as another date; None: ``edits``.
    side_names: what the two sides show, besides their views; () where both show the same points.
    Raises InputError naming a bad value.
    """

    camera: Camera
    settings: Settings
    views: tuple[str, ...] = ()
    edits: Edits = NO_EDITS
    tint: bool = False
    background: str = field(default="plain", metadata=_COMPOSED)
    split_at: float = field(default=0.5, metadata=_COMPOSED)
    other_edits: Edits | None = None
    side_names: tuple[str, ...] = field(default=(), metadata=_COMPOSED)

    def __post_init__(self) -> None:
        views = self.views or (self.settings.view,)
        for view in views:
            if view not in VIEWS:
                raise InputError(f"expected one of {', '.join(VIEWS)}", option="view", value=view)
        object.__setattr__(self, "views", views)
        object.__setattr__(self, "settings", replace(self.settings, view=views[0]))
        if len(views) > 2:
            raise InputError(f"views {', '.join(views)}: one can be shown, or two side by side")
        if self.other_edits is not None and len(views) != 2:
            raise InputError("edits of a second view: expected two views side by side")
        if len(self.side_names) not in (0, 2):
            raise InputError(f"{len(self.side_names)} names of sides: expected none, or two")
        if self.background not in BACKGROUNDS:
            raise InputError(f"expected one of {', '.join(BACKGROUNDS)}", option="background", value=self.background)
        if not 0 <= self.split_at <= 1:
            raise InputError("expected a share of the width, 0 to 1", option="split_at", value=self.split_at)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PictureSpec) and self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def renders_as(self, other: "PictureSpec | None") -> bool:
        """Whether both need the same rendering; they may be put together differently."""
        return other is not None and self._values(composed=False) == other._values(composed=False)

    def _values(self, *, composed: bool = True) -> tuple:
        return tuple(self.camera.key if each.name == "camera" else getattr(self, each.name) for each in fields(self)
                     if composed or "composed" not in each.metadata)

    @property
    def shows_meshes(self) -> bool:
        """Whether a mesh lies beside the points of the picture."""
        return bool(shown_meshes(self.edits.meshes))

    @property
    def compares(self) -> bool:
        """Whether two views are shown."""
        return len(self.views) == 2

    @property
    def sides(self) -> "tuple[PictureSpec, ...]":
        """What is rendered, one after the other: this description, or one of each side where the sides show other points."""
        if self.other_edits is None:
            return (self,)
        return tuple(replace(self, views=(view,), settings=replace(self.settings, view=view), edits=edits, other_edits=None,
                             side_names=()) for view, edits in zip(self.views, (self.edits, self.other_edits), strict=True))

    @property
    def titles(self) -> tuple[str, ...]:
        """What each side is called in a picture."""
        return tuple(map(", ".join, zip(self.side_names, self.views))) if self.side_names else self.views

    @property
    def plain(self) -> bool:
        """Whether the picture shows no more than camera, settings, background, meshes and photographs say."""
        return replace(self.edits, meshes=(), photographs=()).none and not (self.compares or self.tint)

    @property
    def rendered_views(self) -> tuple[str, ...]:
        """The views to render: those shown, each once, and the filtered one where the tint or the lock compares with it."""
        measured = self.tint or (self.edits.lock_measured and "neural" in self.views)
        return tuple(dict.fromkeys((*self.views, *(("filtered",) if measured else ()))))

    def to_json(self) -> dict[str, Any]:
        """An object that :meth:`from_json` turns into the same description, but for the paths of meshes and photographs, of
        which it has the names: a picture that is passed on tells nobody's folders.  Raises ValueError for the tint, which the
        format does not hold."""
        if self.tint:
            raise ValueError("the tint of provenance is not part of a stored description")
        edits = _with_names(self.edits)
        more: dict[str, Any] = {} if edits.none else {"alterations": to_json(edits)}
        if self.compares:
            more["comparison"] = {"view": self.views[1], "split_at": self.split_at}
            if self.other_edits is not None:
                more["comparison"]["alterations"] = to_json(_with_names(self.other_edits))
            if self.side_names:
                more["comparison"]["names"] = list(self.side_names)
        return {"background": self.background, "settings": to_json(self.settings), "camera": camera_to_json(self.camera),
                **more}

    @staticmethod
    def from_json(found: dict[str, Any], where: str) -> "PictureSpec":
        """The description in an object; other keys of it, and settings of later versions, are not looked at.

        where: what it was read from, for messages.  Raises InputError, and KeyError, TypeError, ValueError or OverflowError
        where the object has another form.
        """
        known = {each.name for each in fields(Settings)}
        settings = {key: value for key, value in found["settings"].items() if key in known}
        comparison = found.get("comparison") or {}
        other = cast(str, from_json(str, comparison.get("view", ""), "comparison.view"))
        edits, others = found.get("alterations"), comparison.get("alterations")
        chosen = cast(Settings, from_json(Settings, settings, "settings"))
        return PictureSpec(
            camera_from_json(found["camera"], where), chosen, (chosen.view, other) if other else (),
            NO_EDITS if edits is None else cast(Edits, from_json(Edits, edits, "alterations")),
            background=cast(str, from_json(str, found["background"], "background")),
            split_at=cast(float, from_json(float, comparison.get("split_at", 0.5), "split_at")),
            other_edits=None if others is None else cast(Edits, from_json(Edits, others, "comparison.alterations")),
            side_names=cast(tuple[str, ...], from_json(tuple[str, ...], comparison.get("names", []), "comparison.names")),
        )


def _with_names(edits: Edits) -> Edits:
    """With the names of meshes and photographs in place of their paths."""
    if not (edits.meshes or edits.photographs):
        return edits
    return replace(edits, meshes=tuple(replace(layer, path=layer.name) for layer in edits.meshes),
                   photographs=tuple(replace(photo, path=photo.file_name) for photo in edits.photographs))


def camera_to_json(camera: Camera) -> dict[str, Any]:
    """A camera as JSON: numbers that come back to the bit."""
    return {
        "name": camera.name, "width": camera.width, "height": camera.height, "fx": camera.fx, "fy": camera.fy, "cx": camera.cx,
        "cy": camera.cy, "camera_to_world": camera.camera_to_world.tolist(),
        **({} if camera.orthographic is None else {"orthographic": camera.orthographic}),
    }


def camera_from_json(found: dict[str, Any], where: str) -> Camera:
    """The camera that :func:`camera_to_json` wrote.  Raises InputError that begins with ``where``."""
    try:
        lens = [found[key] for key in ("width", "height", "fx", "fy", "cx", "cy")]
        if any(isinstance(value, bool) or not isinstance(value, (int, float)) for value in lens):
            raise TypeError
        width, height, fx, fy, cx, cy = lens
        if not isinstance(found["name"], str):
            raise TypeError
        return Camera(width, height, fx, fy, cx, cy, np.array(found["camera_to_world"], np.float64), found["name"],
                      _distance(found.get("orthographic")))
    except (TypeError, KeyError, ValueError, OverflowError):
        raise InputError("its camera is damaged", file=where) from None
    except InputError as error:
        raise InputError((error,), file=where) from None


def _distance(found: object) -> float | None:
    """Of an orthographic camera; None of a pinhole.  Raises TypeError for what is no number."""
    if found is not None and (isinstance(found, bool) or not isinstance(found, (int, float))):
        raise TypeError
    return found
