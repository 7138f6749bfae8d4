"""Export into another coordinate reference system (``--reproject``): coordinates by pyproj, everything else as it is.

The system of the scan is what its files state or a person assigned; EPSG:4326 where there is none and the numbers are degrees.
Axes are in the order of files: easting or longitude first.  Heights are transformed where both systems have them; otherwise
they only get the unit of length of the new system.  Clips are applied before, in the scan's own coordinates.
"""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...common.errors import InputError
from ...grid.building.degrees import like_degrees, utm_of
from ...preprocess.scan_description import Assigned
from ...readers import crs
from ...readers.las.las_source import LasSource
from ...readers.source import ScanInfo
from .columns import Piece, Stream, Survey
from .crs_records import Reference, reference_of, without_sources
from .losses import Losses
from .target import Target

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...grid.scene import Scene
    from ...readers.source import Source

AUTO = "auto"
_DEGREES = "EPSG:4326"
_MOST_DECIMALS = 4
"""Of transformed lengths in LAS: a tenth of a millimetre, where the source's decimals say nothing any more."""
_ROTATED = ("E57", "PTX")
"""Formats whose scans may have a rotation."""
_DIRECTIONS = ("nx", "normal_x", "normalx", "x_t")
"""Columns that begin a direction in the axes of the scan."""
_NEAR = 0.01
"""Degrees around the scan's centre for which the accuracy of a transformation is looked up."""


def target_of(text: str) -> str:
    """``--reproject``: the EPSG code in its usual spelling, or AUTO.  Raises InputError where there is no such system."""
    if text.strip().lower() == AUTO:
        return AUTO
    try:
        code = crs.assigned(text)[0]
    except InputError as error:
        raise InputError(f"--reproject {error}, or give auto for the UTM zone of the scan") from None
    if crs.system(code or "").is_geocentric:
        raise InputError(f"--reproject {code}: geocentric coordinates are not written",
                         remedy="give a projected system or auto")
    return code or ""


class Reprojected:
    """A stream of records in another system.  meta, reference: those of the scene with the new system.

    target: as :func:`target_of` returns it.  sources: of the scene; none where its files are gone.
    Raises InputError where the scan has no system, or no transformation leads to the new one.
    """

    def __init__(self, stream: Stream, scene: "Scene", sources: "Sequence[Source]", target: str, losses: Losses):
        self._stream, self._losses = stream, losses
        centre = scene.bounds.mean(axis=0)
        wkt = _stated(scene, sources, losses)
        source = crs.system(_DEGREES) if wkt is None else _read(wkt, scene)
        self._swapped = source.is_geographic and abs(centre[1]) > 90 >= abs(centre[0])
        place = _place(source, centre[[1, 0, 2]] if self._swapped else centre)
        if wkt is None:
            first = "latitude, longitude" if self._swapped else "longitude, latitude"
            losses.add(f"no coordinate reference system is stated; the degrees are read as {_DEGREES} ({first})")
        self.code = utm_of(place) if target == AUTO else target
        system = crs.system(self.code)
        if target == AUTO:
            losses.add(f"reprojected to {self.code}, {system.name}")
        self._transform = self._places(source, system, () if scene.meta.assigned else sources)
        _tell_area(system, self.code, place, losses)
        _tell_accuracy(source, system, self.code, place, losses)
        self._degrees = system.is_geographic
        name, units, metres = crs.assigned(self.code)
        self.meta = replace(scene.meta, crs=name, units=units, metres_per_unit=metres, assigned=Assigned())
        self.reference: Reference = without_sources(self.meta)
        self._failed = self._seen = 0
        self._las_only = bool(sources) and all(isinstance(known, LasSource) for known in sources)
        self._rotated = any(known.format in _ROTATED for known in sources)

    def _places(self, source: Any, system: Any, sources: "Sequence[Source]") -> Callable[[np.ndarray], np.ndarray]:
        """What transforms (n, 3) coordinates; those that have no place become infinite."""
        heights = len(source.axis_info) > 2 and (len(system.axis_info) > 2 or source.is_geocentric)
        factor = 1.0 if heights else self._height_factor(source, system, sources)
        if source.is_geocentric and len(system.axis_info) < 3:
            factor = 1 / _length(system)[1]  # of ellipsoidal heights, which are metres in a system that gets them
            system = system.to_3d()
        elif not heights:
            source, system = _horizontal(source), _horizontal(system)
        transformer = _transformer(source, system)
        self._heights_changed = heights or factor != 1

        def transform(xyz: np.ndarray) -> np.ndarray:
            x, y = (xyz[:, 1], xyz[:, 0]) if self._swapped else (xyz[:, 0], xyz[:, 1])
            if heights:
                x, y, z = transformer.transform(x, y, xyz[:, 2])
            else:
                (x, y), z = transformer.transform(x, y), xyz[:, 2]
            return np.stack([x, y, z if factor == 1 else z * factor], axis=1)

        return transform

    def _height_factor(self, source: Any, system: Any, sources: "Sequence[Source]") -> float:
        """What heights are multiplied with where one of the systems has none, so that they are in the new one's unit."""
        own, new = source.axis_info[2:], system.axis_info[2:]
        known = next((file.heights for file in sources if isinstance(file, LasSource) and file.heights), None)
        name, metres = (own[0].unit_name, own[0].unit_conversion_factor) if own else known or _length(source)
        if new:
            self._losses.add(f"the scan states no system of heights: they are taken for those of {system.name}")
            return metres / new[0].unit_conversion_factor
        unit, length = _length(system)
        same = abs(metres / length - 1) < 1e-7
        if own:
            self._losses.add(f"heights are those of {source.name}; {system.name} does not state what they are")
        if not same:
            taken = ", in which they are taken to be," if source.is_geographic else ", the unit of x and y,"
            taken = "" if own or known else taken
            self._losses.add(f"heights are converted from {name}{taken} to {unit}")
        return 1.0 if same else metres / length

    def pieces(self, label: str) -> Iterator[Piece]:
        """See Stream.  Points that cannot be transformed are left out and counted, for :meth:`check`."""
        self._failed = self._seen = 0
        for piece in self._stream.pieces(label):
            xyz = self._transform(piece.xyz)
            self._seen += len(xyz)
            if failed := int(np.count_nonzero(~np.isfinite(xyz).all(axis=1))):
                self._failed += failed
                continue
            yield replace(piece, xyz=xyz)

    def check(self, found: Survey, target: Target) -> None:
        """After the first pass.  Raises InputError where points cannot be transformed.  found: its decimals are set to what
        transformed coordinates are worth.  target: the file's format."""
        if self._failed:
            raise InputError(f"--reproject {self.code}: {self._failed:,} of {self._seen:,} points cannot be transformed to it",
                             remedy="leave them out by --clip, or choose another system")  # fmt: skip
        if not self._degrees:
            found.decimals[:2] = np.minimum(found.decimals[:2], _MOST_DECIMALS)
        if self._heights_changed:
            found.decimals[2] = min(found.decimals[2], _MOST_DECIMALS)
        if self._las_only and target.las:  # colours stay as they are, also those of 8 bits
            found.depth = {source: 16 if bits else 0 for source, bits in found.depth.items()}
        if any(name.lower() in _DIRECTIONS for name in found.columns):
            self._losses.add("directions such as normals keep the axes of the scan's system")
        if target.poses and self._degrees:
            self._losses.add("coordinates are degrees: scans are written without poses")
        elif target.poses and self._rotated:
            self._losses.add("scans keep their positions; rotations of poses are not written")

    def scan_info(self) -> list[ScanInfo]:
        """See Stream.  Positions are transformed; none in degrees."""
        return [replace(info, position=self._position(info)) for info in self._stream.scan_info()]

    def _position(self, info: ScanInfo) -> tuple[float, float, float] | None:
        if info.position is None or self._degrees:
            return None
        x, y, z = self._transform(np.array([info.position], np.float64))[0].tolist()
        return (x, y, z) if np.isfinite((x, y, z)).all() else None


def _stated(scene: "Scene", sources: "Sequence[Source]", losses: Losses) -> str | None:
    """WKT of the scan's system; None where there is none and its coordinates are degrees.  Raises InputError."""
    meta = scene.meta
    file = Path(next(iter(meta.sources), "the scan")).name
    stated = list(dict.fromkeys(source.crs for source in sources if source.crs))
    if len(stated) > 1 and not meta.assigned:
        raise InputError(f"the files have different coordinate reference systems ({', '.join(stated[:4])})",
                         option="--reproject", remedy="export each alone")  # fmt: skip
    reference = reference_of(meta, sources, losses) if sources else without_sources(meta)
    if reference.wkt:
        return reference.wkt
    name = meta.crs or next(iter(stated), None)
    if name:
        raise InputError(f"the definition of {name}, which {file} states, cannot be read", option="--reproject",
                         remedy="assign its EPSG code to the scan in the window and export the project")  # fmt: skip
    if not meta.in_degrees and not like_degrees(scene.bounds, next(iter(sources), None)):
        raise InputError(f"{file} states no coordinate reference system and its coordinates are not degrees",
                         option="--reproject",
                         remedy="assign its EPSG code to the scan in the window and export the project")  # fmt: skip
    return None


def _read(wkt: str, scene: "Scene") -> Any:
    """The scan's system as an object of pyproj.  Raises InputError."""
    try:
        system = crs.system(wkt)
        if system.is_engineering:
            raise ValueError("local coordinates without a place on the Earth")
    except ValueError as error:
        name = scene.meta.crs or "the scan's system"
        raise InputError(f"{name} cannot be transformed ({error})", option="--reproject",
                         remedy="assign its EPSG code to the scan in the window and export the project") from None  # fmt: skip
    return system


def _place(source: Any, centre: np.ndarray) -> np.ndarray:
    """Longitude and latitude (WGS 84) of a point.  Raises InputError where it has none."""
    system = crs.system(_DEGREES)
    if source.is_geocentric:
        found = _transformer(source, system.to_3d()).transform(*centre)[:2]
    else:
        found = _transformer(_horizontal(source), system).transform(*centre[:2])
    if not (abs(found[0]) <= 360 and abs(found[1]) <= 90):  # PROJ passes degrees on as they are
        around = ", ".join(f"{value:.6g}" for value in centre[:2])
        raise InputError(f"the scan's centre ({around}) is no place in {source.name}; its coordinate reference system is wrong",
                         option="--reproject")  # fmt: skip
    return np.array(found)


def _transformer(source: Any, system: Any) -> Any:
    """pyproj's object, for easting or longitude first.  Raises InputError where there is none."""
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        return Transformer.from_crs(source, system, always_xy=True)
    except ProjError as error:
        raise InputError(f"no transformation leads from {source.name} to {system.name} ({error})",
                         option="--reproject") from None


def _length(system: Any) -> tuple[str, float]:
    """Unit of length of x and y, and metres per unit; metre where these are degrees."""
    axis = system.axis_info[0]
    return ("metre", 1.0) if system.is_geographic else (axis.unit_name, axis.unit_conversion_factor)


def _horizontal(system: Any) -> Any:
    return system.sub_crs_list[0] if system.is_compound else system.to_2d()


def _tell_area(system: Any, code: str, place: np.ndarray, losses: Losses) -> None:
    """Names a scan outside the area for which a system is made.  place: longitude, latitude."""
    area = system.area_of_use
    if area is None:
        return
    longitude, latitude = (float(place[0]) + 180) % 360 - 180, float(place[1])
    east = area.east + (360 if area.east < area.west else 0)
    inside = any(area.west <= turned <= east for turned in (longitude, longitude + 360))
    if not (inside and area.south <= latitude <= area.north):
        losses.add(f"the scan ({longitude:.3f}, {latitude:.3f}) lies outside the area of {code}, {system.name}")


def _tell_accuracy(source: Any, system: Any, code: str, place: np.ndarray, losses: Losses) -> None:
    """Names the grid that the most accurate transformation at a place (longitude, latitude) needs, where it is missing."""
    from pyproj.aoi import AreaOfInterest
    from pyproj.exceptions import ProjError
    from pyproj.transformer import TransformerGroup

    longitude, latitude = (float(place[0]) + 180) % 360 - 180, float(place[1])
    around: Any = AreaOfInterest(longitude - _NEAR, max(latitude - _NEAR, -90), longitude + _NEAR, min(latitude + _NEAR, 90))
    with warnings.catch_warnings(action="ignore"):  # what pyproj warns of is told here
        try:
            group = TransformerGroup(source, system, always_xy=True, area_of_interest=around)
        except ProjError:
            return
    if group.best_available or not group.unavailable_operations:
        return
    grids = ", ".join(dict.fromkeys(grid.short_name for grid in group.unavailable_operations[0].grids))
    accuracy = group.transformers[0].accuracy if group.transformers else -1
    known = f"accurate to {accuracy:g} m" if accuracy >= 0 else "of unknown accuracy"
    losses.add(f"the most accurate transformation to {code} needs a grid that PROJ does not have here ({grids}); the one used "
               f"is {known}")  # fmt: skip
