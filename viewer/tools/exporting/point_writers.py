"""Writers of points: LAS and LAZ 1.4, binary PLY, E57.  Each takes a :class:`Selection` and writes one whole file.

Coordinates are kept exactly as the grid has them: LAS stores whole multiples of half a grid step, where 32 bits reach so far;
PLY and E57 store float64.  Colours are written as shown; LAS has 16 bits a channel, of which 8-bit colours fill both bytes.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ..reference import wkt_of
from .selection import BLOCK, Selection

if TYPE_CHECKING:
    import pye57
    from pye57 import libe57  # type: ignore[attr-defined]

    from ...grid.scene import Scene

_POINT_FORMAT = 7
"""LAS 1.4 with RGB, intensity, class and point source."""
_REACH = 2**31 - 8
"""Largest whole number of a LAS coordinate, with room for rounding."""
_MOST_INTENSITY = 65535
_WIDE = 257
"""8-bit to 16-bit colour: 255 becomes 65535."""


def write_las(path: Path, selection: Selection, counts: np.ndarray) -> None:
    """LAS 1.4 or, by the suffix, LAZ.  counts: (256,) of :meth:`Selection.count`."""
    import laspy

    scene = selection.scene
    header = laspy.LasHeader(point_format=_POINT_FORMAT, version="1.4")
    header.scales, header.offsets = np.full(3, las_scale(scene)), scene.origin
    header.generating_software = "pointglass"
    header.vlrs.extend(_reference_records(scene))
    if any(record.record_id == 2112 for record in header.vlrs):
        header.global_encoding.wkt = True
    compressed = path.suffix.lower() == ".laz"
    with path.open("wb") as file, laspy.open(file, mode="w", header=header, closefd=False, do_compress=compressed) as writer:
        for block in selection.blocks("writing"):
            points = laspy.ScaleAwarePointRecord.zeros(len(block.xyz), header=header)
            points.x, points.y, points.z = block.xyz.T
            points.red, points.green, points.blue = (block.rgb.astype(np.uint16) * _WIDE).T
            points.intensity, points.classification = block.intensity, block.classification
            points.point_source_id = block.station.astype(np.uint16) + 1
            points.return_number[:] = 1
            points.number_of_returns[:] = 1
            writer.write_points(points)


def las_scale(scene: "Scene") -> float:
    """The finest power of two at which 32-bit numbers reach over the whole scan; half a grid step or coarser."""
    reach = float(np.abs(scene.bounds - scene.origin).max()) + scene.cell_size
    scale = scene.step / 2
    while reach / scale > _REACH:
        scale *= 2
    return scale


def _reference_records(scene: "Scene") -> list:
    """The coordinate reference records: of what was assigned, else of the LAS file that the scene was made from, where it was
    made from one alone."""
    import laspy

    assigned = wkt_of(scene.meta)
    if assigned is not None:
        return [laspy.vlrs.known.WktCoordinateSystemVlr(assigned)]
    sources = [Path(source) for source in scene.meta.get("sources") or []]
    if len(sources) != 1 or sources[0].suffix.lower() not in (".las", ".laz") or not sources[0].is_file():
        return []
    with laspy.open(sources[0]) as reader:
        found = [*reader.header.vlrs, *(reader.evlrs or [])]
        return [record for record in found if record.user_id.strip("\0") == "LASF_Projection"]


_PLY_TYPE = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("red", "u1"), ("green", "u1"), ("blue", "u1"),
                      ("intensity", "<u2"), ("scan", "u1"), ("classification", "u1")])
_PLY_NAMES = {"f8": "double", "u1": "uchar", "u2": "ushort"}


def write_ply(path: Path, selection: Selection, counts: np.ndarray) -> None:
    """Binary little-endian PLY."""
    fields = "".join(f"property {_PLY_NAMES[_PLY_TYPE[name].str[1:]]} {name}\n" for name in _PLY_TYPE.names or ())
    about = f"comment crs {selection.scene.meta.get('crs') or 'unknown'}, unit {selection.scene.meta.get('units') or 'unknown'}"
    about = about.encode("ascii", "replace").decode().replace("\n", " ")
    head = (f"ply\nformat binary_little_endian 1.0\ncomment pointglass\n{about}\n"
            f"element vertex {counts.sum()}\n{fields}end_header\n")
    with path.open("wb") as file:
        file.write(head.encode("ascii"))
        for block in selection.blocks("writing"):
            rows = np.empty(len(block.xyz), _PLY_TYPE)
            for name, values in zip("xyz", block.xyz.T, strict=True):
                rows[name] = values
            for name, values in zip(("red", "green", "blue"), block.rgb.T, strict=True):
                rows[name] = values
            rows["intensity"], rows["scan"], rows["classification"] = block.intensity, block.station, block.classification
            rows.tofile(file)


def write_e57(path: Path, selection: Selection, counts: np.ndarray) -> None:
    """E57, one scan a station with its scanner's position as pose; coordinates in float64.

    By libe57's own calls, since pye57's writer stores float32 coordinates, half a metre apart on a national grid.
    """
    scene = selection.scene
    names = [str(scan.get("name") or "") for scan in scene.meta.get("scans") or []]
    places = scene.station_places
    file = _e57_file(path, wkt_of(scene.meta) or "")
    try:
        for station in np.flatnonzero(counts):
            known = station < len(places) and np.isfinite(places[station]).all()
            name = names[station] if station < len(names) and names[station] else f"scan {station + 1}"
            _write_station(file, selection, int(station), name, places[station] if known else None)
    finally:
        file.close()


def _e57_file(path: Path, reference: str) -> "pye57.E57":
    """A new file with the reference system in its header.  pye57 writes an empty one, and libe57 replaces no field."""
    from uuid import uuid4

    import pye57
    from pye57 import libe57  # type: ignore[attr-defined]

    class File(pye57.E57):
        """A file that writes the header itself."""

        def write_default_header(self) -> None:
            image, root = self.image_file, self.image_file.root()
            image.extensionsAdd("", libe57.E57_V1_0_URI)
            texts = {"formatName": "ASTM E57 3D Imaging Data File", "guid": f"{{{uuid4()}}}",
                     "e57LibraryVersion": libe57.E57_LIBRARY_ID, "coordinateMetadata": reference}
            for name, text in texts.items():
                root.set(name, libe57.StringNode(image, text))
            for name, number in (("versionMajor", libe57.E57_FORMAT_MAJOR), ("versionMinor", libe57.E57_FORMAT_MINOR)):
                root.set(name, libe57.IntegerNode(image, number))
            for name in ("data3D", "images2D"):
                root.set(name, libe57.VectorNode(image, True))

    return File(str(path), mode="w")


_E57_FIELDS = ["cartesianX", "cartesianY", "cartesianZ", "intensity", "colorRed", "colorGreen", "colorBlue"]


def _write_station(file: "pye57.E57", selection: Selection, station: int, name: str, place: np.ndarray | None) -> None:
    """One scan, streamed.  place: (3,) its scanner's position, from which its points are counted; None: unknown."""
    from uuid import uuid4

    from pye57 import libe57  # type: ignore[attr-defined]

    image, whole = file.image_file, libe57.IntegerNode

    def node(**children) -> "libe57.StructureNode":
        made = libe57.StructureNode(image)
        for key, child in children.items():
            made.set(key, child)
        return made

    def number(value: float) -> "libe57.FloatNode":
        return libe57.FloatNode(image, float(value), libe57.E57_DOUBLE)

    scan = node(guid=libe57.StringNode(image, f"{{{uuid4()}}}"), name=libe57.StringNode(image, name))
    if place is not None:
        rotation = node(w=number(1), x=number(0), y=number(0), z=number(0))
        scan.set("pose", node(rotation=rotation, translation=node(**dict(zip("xyz", map(number, place), strict=True)))))
    scan.set("intensityLimits", node(intensityMinimum=whole(image, 0), intensityMaximum=whole(image, _MOST_INTENSITY)))
    scan.set("colorLimits", node(**{f"color{colour}{end}": whole(image, value) for colour in ("Red", "Green", "Blue")
                                    for end, value in (("Minimum", 0), ("Maximum", 255))}))
    prototype = node(
        **{key: number(0) for key in _E57_FIELDS[:3]}, intensity=whole(image, 0, 0, _MOST_INTENSITY),
        **{key: whole(image, 0, 0, 255) for key in _E57_FIELDS[4:]},
    )
    points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", points)
    file.data3d.append(scan)
    arrays, buffers = file.make_buffers(_E57_FIELDS, BLOCK)
    writer = points.writer(buffers)
    for block in selection.blocks(f"writing {name}"):
        mine = block.station == station
        count = int(np.count_nonzero(mine))
        if count:
            columns = (*(block.xyz[mine] - (0.0 if place is None else place)).T, block.intensity[mine], *block.rgb[mine].T)
            for key, values in zip(_E57_FIELDS, columns, strict=True):
                arrays[key][:count] = values
            writer.write(count)
    writer.close()


Writer = Callable[[Path, Selection, np.ndarray], None]
WRITERS: dict[str, Writer] = {".las": write_las, ".laz": write_las, ".ply": write_ply, ".e57": write_e57}


def writer_for(path: Path) -> Writer:
    """By the name's ending.  Raises InputError."""
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise InputError(f"--out {path}: expected a name ending in {', '.join(WRITERS)}")
    return writer


def bytes_needed(path: Path, count: int) -> int:
    """A low estimate of a file's size, to refuse a full disk before the work; compressed formats count a quarter."""
    each = {".ply": _PLY_TYPE.itemsize, ".las": 36, ".laz": 9, ".e57": 29}[path.suffix.lower()]
    return count * each


