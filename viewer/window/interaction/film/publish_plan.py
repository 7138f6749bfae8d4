"""Where a publication will have its places, drawn on a plan, and about how long it will take: found before it is begun."""

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from ....commands.publishing.cube_faces import face_cameras
from ....commands.publishing.face_margins import with_margin
from ....commands.publishing.places import Place, chosen_places
from ....commands.publishing.scene_data import EYE, plans_of
from ....work.ghosts import prepared
from ....work.pictures.drawn_over import letters
from ....work.places.up_axis import upright_axes
from ...planning.folder_photographs import give_folder

if TYPE_CHECKING:
    from ....grid.scene import Scene
    from ....picture.settings import Settings
    from ....work.document import Document

PLACE_BYTES = {True: 3_600_000, False: 2_900_000}
"""Of a place, with a second view and without: the mean of demo.laz and studio.laz at 1024 pixels a face."""
_TRIED = 512
"""Pixels of the face by which the time is estimated."""
_OTHERS = 4.0
"""Seconds of a place for small pictures, depth and coding; two places of plant_room.laz without the network took 14.5 s of a
processor, the program's start and reading the grid included."""
_BACK, _WALL, _DOT, _TEXT = (27, 29, 34), (214, 219, 226), (79, 140, 255), (255, 255, 255)


@dataclass(frozen=True, eq=False)
class PublishPlan:
    """places: found.  picture: (H, W, 3) uint8, the plan of the storey with most of them, each with its number.  storeys: how
    many there are.  seconds: estimated for all places, on this machine."""

    places: list[Place]
    picture: np.ndarray
    storeys: int
    seconds: float


def planned(scene: "Scene", document: "Document", settings: "Settings", wanted: str | int, side: int) -> PublishPlan:
    """Chooses the places, draws the plan, and times one picture.  wanted: as of chosen_places.  side: pixels of a face.

    Raises InputError where there are no such places, DeviceError where no picture can be made.  Has an OpenGL context of its
    own, on the thread that calls it.
    """
    places = chosen_places(scene, document, wanted)
    axes, origin = upright_axes(document.up), np.round(scene.bounds.mean(axis=0))
    local = (np.stack([place.position for place in places]) - origin) @ axes
    metre = places[0].metre
    floors = None if all(place.below is not None for place in places) else local[:, 2] - EYE * metre
    storey, plans = plans_of(scene, document, local, floors, origin, metre)
    most = int(np.bincount(storey).argmax())
    numbers = np.flatnonzero(storey == most)
    share = (local[numbers, :2] - plans[most].low) / (plans[most].high - plans[most].low)
    picture = _drawn(plans[most].alpha, share, [int(number) + 1 for number in numbers])
    face = _seconds(scene, document, settings, places[0]) * (side / _TRIED) ** 2
    return PublishPlan(places, picture, len(plans), len(places) * (6 * face + _OTHERS))


def _drawn(alpha: np.ndarray, share: np.ndarray, numbers: list[int]) -> np.ndarray:
    """The walls with a numbered dot at each place.  share: (n, 2) of width and, upwards, height."""
    from PIL import Image, ImageDraw

    part = alpha[..., None].astype(np.float64) / 255
    image = Image.fromarray(np.rint(np.array(_BACK) * (1 - part) + np.array(_WALL) * part).astype(np.uint8))
    draw, font = ImageDraw.Draw(image), letters(17)
    for (x, y), number in zip(share, numbers, strict=True):
        at = x * image.width, (1 - y) * image.height
        draw.circle(at, 13, fill=_DOT, outline=_TEXT, width=2)
        draw.text(at, str(number), fill=_TEXT, font=font, anchor="mm")
    return np.asarray(image)


def _seconds(scene: "Scene", document: "Document", settings: "Settings", place: Place) -> float:
    """Of one face of _TRIED pixels, the second time that one is made: the first also makes programs and loads points."""
    from ....render.device.context import create_context
    from ....render.renderer import Renderer

    if settings.view == "neural":
        from .....model.common.process.torch_process import prepare_inference

        prepare_inference()
    context = create_context()
    try:
        renderer = Renderer(context, prepared(scene, document.ghosts))
        try:
            give_folder(renderer, settings.photos)
            start = perf_counter()
            for camera in face_cameras(place.position, _TRIED, document.up)[:2]:
                start = perf_counter()
                renderer.render(with_margin(camera), settings, (settings.view,), edits=document.edits).image(settings.view)
            return perf_counter() - start
        finally:
            renderer.release()
    finally:
        context.release()
