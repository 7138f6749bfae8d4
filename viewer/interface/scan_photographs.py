"""The photographs inside the E57 files of a scan, for Python; pictures are decoded when they are asked for."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..picture.camera import Camera
from ..preprocess.scan_description import RecordOrigin
from ..readers.moved_source import moved_pose
from .pictures import Picture, as_picture

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..readers.e57.e57_pictures import StoredPicture

_LONGEST = 1 << 16
"""Pixels of the longer side of a decoded photograph: larger than those of any scanner, so that none is reduced."""


@dataclass(frozen=True, eq=False)
class Photograph:
    """A photograph in an E57 file.

    name: as the file has it.  file: the E57.  kind: pinhole, spherical, cylindrical, or visualReference (no geometry).
    size: (width, height) in pixels as the file declares them, (0, 0) where it does not.
    camera: of a pinhole photograph with a pose, file coordinates; None of others.  Its size is ``size``, pixels need not be
    square.  station: the row of ``Scan.stations`` it was taken from, None where the file does not say.
    """

    name: str
    file: Path
    kind: str
    size: tuple[int, int]
    camera: Camera | None
    station: int | None
    _stored: "StoredPicture" = field(repr=False)

    @property
    def image(self) -> Picture:
        """(H, W, 3) uint8 sRGB, decoded each time it is asked for.  Raises InputError where it is damaged."""
        from ..readers.e57.e57_pictures import picture_of

        return as_picture(picture_of(self._stored, _LONGEST)[0])

    def _repr_png_(self) -> bytes | None:
        from ..readers.e57.e57_pictures import picture_of

        return as_picture(picture_of(self._stored, 1024)[0])._repr_png_()


def photographs_of(scene: "Scene") -> list[Photograph]:
    """All photographs of the scene's E57 files, in the files' order.  Raises InputError where a file cannot be read."""
    found: list[Photograph] = []
    before: int | None = 0  # scans of the files before; None once they cannot be told
    origin = scene.meta.records or RecordOrigin()
    for number, source in enumerate(map(Path, scene.meta.sources)):
        if source.suffix.lower() != ".e57" or not source.is_file():
            before = None
            continue
        from ..readers.e57.e57_photographs import pinhole_cameras
        from ..readers.e57.e57_pictures import stored_pictures

        cameras, scans, count = pinhole_cameras(source)
        for stored in stored_pictures(source):
            size = stored.width, stored.height
            scan = scans.get(stored.number)
            station = None if scan is None or before is None else before + scan
            camera = cameras.get(stored.number)
            if camera is not None:
                pose = moved_pose(origin.move_of(number), camera.camera_to_world)
                camera = replace(camera, name=stored.name, camera_to_world=pose)
            found.append(Photograph(stored.name, source, stored.kind, size, camera, station, stored))
        before = None if before is None else before + count
    return found
