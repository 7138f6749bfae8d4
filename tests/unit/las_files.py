"""Random LAS and LAZ files that use what the format has: point formats, versions, extra dimensions, records before and after
the points, header fields."""

import datetime
import uuid

import laspy
import numpy as np
from laspy.vlrs.vlrlist import VLRList

VERSIONS = {0: ("1.1", "1.2", "1.3", "1.4"), 1: ("1.1", "1.2", "1.3", "1.4"), 2: ("1.2", "1.3", "1.4"),
            3: ("1.2", "1.3", "1.4"), 4: ("1.3", "1.4"), 5: ("1.3", "1.4")} | dict.fromkeys(range(6, 11), ("1.4",))  # fmt: skip
WAVEFORMS = (4, 5, 9, 10)
_KINDS = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")


def random_las(path, seed, *, point_format=None, count=None):
    """Writes a random file; returns its point format.  A LAZ where the name says so."""
    rng = np.random.default_rng(seed)
    number = int(rng.choice(list(VERSIONS))) if point_format is None else point_format
    header = laspy.LasHeader(point_format=number, version=str(rng.choice(VERSIONS[number])))
    header.scales = rng.choice([1e-3, 1e-2, 1e-4, 2.0**-10, 2.5e-4], 3)
    header.offsets = rng.integers(-1000, 6_000_000, 3).astype(float) + rng.choice([0.0, 0.5, 0.123])
    header.file_source_id, header.uuid = int(rng.integers(65536)), uuid.UUID(bytes=rng.bytes(16))
    header.system_identifier, header.generating_software = "Scanner Ü"[:8], "survey 7"
    header.creation_date = datetime.date(2020, 1, 1) + datetime.timedelta(int(rng.integers(1000)))
    for extra in range(int(rng.integers(0, 4))):
        kind = str(rng.choice(_KINDS))
        width = int(rng.choice([1, 1, 2, 3]))
        scaled = rng.random() < 0.3
        header.add_extra_dim(laspy.ExtraBytesParams(
            f"extra {extra}", f"{width}{kind}" if width > 1 else kind, description=f"unit {extra}",
            scales=np.full(width, 0.01) if scaled else None, offsets=np.full(width, 5.0) if scaled else None))  # fmt: skip
    for record in range(int(rng.integers(0, 4))):
        header.vlrs.append(laspy.VLR("SURVEY", record, "notes", rng.bytes(int(rng.integers(0, 300)))))
    if rng.random() < 0.5:
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr('LOCAL_CS["site",UNIT["metre",1]]'))
        header.global_encoding.wkt = header.version.minor >= 4
    count = int(rng.integers(50, 3000)) if count is None else count
    las = laspy.LasData(header)
    las.points = laspy.ScaleAwarePointRecord.zeros(count, header=header)
    raw: np.ndarray = las.points.array
    for name in raw.dtype.names or ():
        field = raw[name]
        if name in "XYZ":
            field[...] = rng.integers(-20_000_000, 20_000_000, count)
        elif field.dtype.kind == "f":
            field[...] = rng.normal(0, 1e4, field.shape)
        else:
            field[...] = np.frombuffer(rng.bytes(field.nbytes), field.dtype).reshape(field.shape)
    if header.version.minor >= 4:
        las.evlrs = VLRList([laspy.VLR("SURVEY", 100 + i, "later", rng.bytes(int(rng.integers(1, 70_000))))
                                                for i in range(int(rng.integers(0, 3)))])  # fmt: skip
    las.write(str(path))
    return number


def records(path):
    """(user, number, data) of the records before and after the points, without that of the compression."""
    with laspy.open(path) as reader:
        header = reader.header
        found = [*header.vlrs, *(reader.evlrs or [])]
        return [(record.user_id, record.record_id, record.record_data_bytes()) for record in found if record.record_id != 22204]


def facts(path):
    """Header fields that a copy keeps."""
    with laspy.open(path) as reader:
        h = reader.header
        return (h.point_format.id, str(h.version), tuple(h.scales), tuple(h.offsets), h.file_source_id, h.uuid,
                h.system_identifier,
                h.generating_software, h.creation_date, h.global_encoding.value, h.point_count, tuple(h.mins), tuple(h.maxs),
                tuple(h.number_of_points_by_return), list(h.point_format.dimension_names))  # fmt: skip


def coloured_las(path, xyz, rng):
    """Writes (n, 3) points with random colours as LAS or LAZ.  Returns the path."""
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales = np.full(3, 0.001)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rng.integers(0, 65535, (3, len(xyz)))
    las.write(str(path))
    return path


def coloured_corner(path):
    """A floor and a wall of 4 m, 16,000 points with random colours, the same each time."""
    rng = np.random.default_rng(0)
    xyz = np.concatenate([rng.uniform((0, 0, 0), (4, 4, 0.001), (8000, 3)), rng.uniform((0, 3.999, 0), (4, 4, 3), (8000, 3))])
    return coloured_las(path, xyz, rng)
