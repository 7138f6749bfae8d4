"""Searches where photographs were taken that have no pose, and keeps what was found in the cache.

They are compared with views from the places of which a publication would be made: the scanner positions where they are known,
else places that see every surface.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.progress import Progress, progress, share_unknown
from ...common.rigid_transform import rows_of
from ...picture.photographs.placed_photograph import PlacedPhotograph
from ...picture.settings import Settings
from ...readers.decoded_picture import decoded_picture
from ...readers.photographs.placed_photographs import bytes_of
from ...readers.photographs.posed_photograph import PosedPhotograph
from ...render.photographs.photo_fit import PointSample, as_stated, point_sample
from ...work.document import Document
from ...work.measuring.measure_text import unit_name
from ...work.photo_poses.picture_features import opencv
from ...work.photo_poses.pose_search import LONGEST, NotFound, find_pose
from ...work.photo_poses.reference_views import PER_PLACE, ReferenceView, around, outside, view_of
from ...work.photo_poses.stated_focal import stated_focal
from .kept_poses import KeptPoses

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ...readers.e57.e57_pictures import StoredPicture
    from ...render.renderer import Renderer

PLACES = 12
"""Places that are planned where no scanner position is known."""
SHOWING = 0.5
"""Share of the views from these that show something, below which views from outside are added: of pumpA.e57, a pump and a pipe,
0.28; of rooms all."""


@dataclass(frozen=True, eq=False)
class UnplacedPhotograph:
    """data: the bytes of a JPEG or PNG.  path, number: as of PlacedPhotograph.  focal: pixels that the scan states, None: what
    the EXIF of the picture states."""

    path: str
    name: str
    data: bytes
    number: int | None = None
    focal: float | None = None


def of_file(path: Path) -> UnplacedPhotograph:
    """A photograph in a file.  Raises InputError where it cannot be read."""
    return UnplacedPhotograph(str(path), path.name, bytes_of(path))


def of_scan(stored: "StoredPicture") -> UnplacedPhotograph:
    """A photograph inside an E57.  Raises InputError where it cannot be read."""
    from ...readers.e57.e57_pictures import picture_file

    return UnplacedPhotograph(str(stored.file), stored.name, picture_file(stored)[0], stored.number, stored.focal)


class PhotoSearch:
    """Of one scene, document and renderer, which draws with its own context.  views: rendered when the first photograph is
    searched that was not found before."""

    def __init__(self, renderer: "Renderer", document: Document):
        self._renderer, self._document = renderer, document
        self._origin = renderer.scene.bounds.mean(axis=0)
        self._kept = KeptPoses(renderer.scene)
        self.views: list[ReferenceView] | None = None
        self._sample: PointSample | None = None

    def find(self, photo: UnplacedPhotograph) -> PlacedPhotograph | NotFound:
        """Where a photograph was taken.  Raises InputError where it is damaged, or OpenCV is missing."""
        if (known := self._kept.read(photo)) is not None:
            return known
        opencv()
        picture, size = decoded_picture(photo.data, f"{photo.path}: photograph {photo.name!r}", LONGEST)
        if self.views is None:
            self.views = self._rendered()
        focal = photo.focal or stated_focal(photo.data, size)
        found = find_pose(self._draw, partial(self._explained, picture), self.views, self._origin, picture, size, photo.name,
                          focal)  # fmt: skip
        if not isinstance(found, NotFound):
            camera = found.camera
            found = PlacedPhotograph(photo.path, photo.name, camera.width, camera.height, camera.fx,
                                     rows_of(camera.camera_to_world), found.residual, found.matches, photo.number,
                                     found.within if np.isfinite(found.within).all() else None, found.uncertain)
        self._kept.write(photo, found)
        return found

    def _rendered(self) -> list[ReferenceView]:
        from ...work.places.standing_place import sample_scene
        from ...work.places.up_axis import upright_axes
        from ..publishing.places import chosen_places

        scene, upright = self._renderer.scene, upright_axes(self._document.up)
        stations = bool(np.isfinite(scene.scan_places).any())
        with share_unknown():
            places = chosen_places(scene, self._document, "stations" if stations else PLACES)
        inside = [camera for place in places for camera in around(place.position, upright)]
        beyond = outside(sample_scene(scene), upright) if not stations else []
        with progress(len(inside) + len(beyond), "rendering views to compare photographs with", " views") as meter:
            views = self._views(inside, meter)
            if len(views) < SHOWING * len(places) * PER_PLACE:  # a thing, no room
                views += self._views(beyond, meter)
            else:
                meter.update(len(beyond))
        return views

    def _draw(self, camera: "Camera") -> tuple[np.ndarray, np.ndarray]:
        frame = self._renderer.render(camera, Settings(view="filled", photos="off"), ("filled",), filled_depth=True)
        assert frame.filled_depth is not None
        depth = np.frombuffer(frame.filled_depth.read(alignment=1), np.float32).reshape(camera.height, camera.width)
        return frame.image("filled"), depth

    def _explained(self, picture: np.ndarray, camera: "Camera") -> float:
        """As of Judge."""
        lens = camera.fx, camera.fy, camera.cx, camera.cy
        photo = PosedPhotograph("", "pinhole", camera.width, camera.height, lens, False, camera.camera_to_world,
                                lambda _: (picture, None))  # fmt: skip
        if self._sample is None:
            self._sample = point_sample(self._renderer.scene)
        fit = as_stated(photo, picture, self._sample)
        return 0.0 if fit is None else fit.explained

    def _views(self, cameras: "list[Camera]", meter: Progress) -> list[ReferenceView]:
        """Those that show something."""
        views: list[ReferenceView] = []
        for camera in cameras:
            view = view_of(self._draw, camera, self._origin)
            views += [view] if len(view.points) > 1 else []
            meter.update(1)
        return views


def told(found: PlacedPhotograph | NotFound, name: str, metres_per_unit: float | None) -> str:
    """In words: with which certainty a photograph was placed, or why not.  metres_per_unit: of the scene."""
    if isinstance(found, NotFound):
        return f"{name}: where it was taken was not found: {found.why}"
    x, y, z = (row[3] for row in found.camera_to_world[:3])
    return (f"{name}: taken at {x:.3f} {y:.3f} {z:.3f}{accuracy(found, metres_per_unit)}; {found.matches} features agree "
            f"with the scan, residual {found.residual:.1f} pixels of {found.width}x{found.height}")


def accuracy(found: PlacedPhotograph, metres_per_unit: float | None) -> str:
    """Of a place and direction, in words that follow them."""
    if found.within is None:
        return ", uncertain" if found.uncertain else ""
    unit = unit_name(metres_per_unit)
    return f" ± {found.within[0]:.2g} {unit}, ± {found.within[1]:.2g}° (95 %){', uncertain' if found.uncertain else ''}"
