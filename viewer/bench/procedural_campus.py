"""A procedural campus: buildings of furnished rooms (viewer.bench.procedural_scan), a LAS file for each scanner position.

Frame: metres, moved to coordinates as UTM has them.  Each scanner has an exposure of its own, so that files differ in
brightness where they overlap.  The same seed gives the same files.
"""

from pathlib import Path

import numpy as np

from ..common.progress import progress
from .procedural_scan import PITCH, STATIONS, ProceduralScan

STATIONS_OF_BUILDING = 30
GAP = 20.0
"""Distance between buildings, metres."""
ORIGIN = np.array([4e5, 5.5e6, 120.0])
EXPOSURES = 0.85, 1.18
"""Range of the factors of sRGB values by scanner."""
_SCALE = 1e-4  # of coordinates in the files, metres


def make_campus(folder: Path, files: int, points: int, seed: int = 1) -> list[Path]:
    """``files`` files of ``points`` points each, made where they are missing or have another size.  Returns their paths.

    The first files are the same however many are made."""
    folder.mkdir(parents=True, exist_ok=True)
    found = [folder / f"scan{number:05}.las" for number in range(files)]
    with progress(files, "making the campus", " file") as meter:
        for number, file in enumerate(found):
            if not file.is_file():
                _write(file, number, points, seed)
            meter.update(1)
    return found


def scanner(number: int, seed: int = 1) -> np.ndarray:
    """(3,) position of the scanner of a file."""
    building, station = divmod(number, STATIONS_OF_BUILDING)
    scan = ProceduralScan(STATIONS_OF_BUILDING, STATIONS_OF_BUILDING // len(STATIONS), seed + building)
    return scan.station(station) + _place(building)


def _place(building: int) -> np.ndarray:
    """(3,) corner of a building; ten stand in a row."""
    rooms = STATIONS_OF_BUILDING // len(STATIONS)
    side = np.ceil(np.sqrt(rooms)) * PITCH[:2] + GAP
    return ORIGIN + np.array([*(np.array([building % 10, building // 10]) * side), 0.0])


def _write(file: Path, number: int, points: int, seed: int) -> None:
    import laspy

    building, station = divmod(number, STATIONS_OF_BUILDING)
    scan = ProceduralScan(points * STATIONS_OF_BUILDING, STATIONS_OF_BUILDING // len(STATIONS), seed + building)
    xyz, rgb = scan.points(station * points, (station + 1) * points)
    xyz += _place(building)
    gain = np.random.default_rng((seed, number)).uniform(*EXPOSURES)
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales, header.offsets = np.full(3, _SCALE), np.floor(xyz.min(axis=0))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = np.clip(np.rint(rgb * (gain * 257.0)), 0, 65535).astype(np.uint16).T
    partial = file.with_suffix(".partial.las")
    las.write(str(partial))
    partial.replace(file)
