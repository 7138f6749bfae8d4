"""The demo scan: two furnished rooms from three stations.

`python -m pointglass.model.synth.demo assets/demo.laz` makes it again.

``demo_cameras.json`` beside the scan holds eight views in nerfstudio's camera path format.  Frame: metres, z up.
"""

import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from ..common.errors import DataError
from ..common.files.atomic_write import write_atomic
from ..common.files.folders import made_folder
from ..common.files.temporary import temporary_file
from ..common.seeds import MAX_SEED
from .place import Place
from .scanner import ScannerModel, SimulatedScan, VirtualScanner

STATIONS = np.array([[2.55, 3.2, 1.5], [5.4, 2.05, 1.6], [7.3, 3.5, 1.5]])
"""(3, 3) scanner positions, metres, in the two rooms of the invented flat."""
DEMO_POINTS = 1_350_000
"""Number of points of assets/demo.laz: measured so that the file stays below 8 MB."""
LEAST_POINTS, MOST_POINTS = 1000, 100_000_000
"""Limits of the number of points.  With fewer, no room can be recognised; with more, the pulses of one station exceed the
memory of common machines."""
SUFFIXES = (".laz", ".las")
SPREAD = 0.12
"""Largest deviation of a station's exposure gain from 1: as real stations differ."""
SCALE = 0.0005
"""Metres per step of a LAS coordinate: about half the range noise at normal incidence (:class:`.scanner.ScannerModel`)."""
METRES = (1, 1, 0, 4,
          1024, 0, 1, 32767,  # the model: of the file's own
          3072, 0, 1, 32767,  # the system of x and y: of the file's own
          3076, 0, 1, 9001,  # in metres
          4099, 0, 1, 9001)  # heights: in metres
"""GeoTIFF keys (version 1.1.0, OGC 19-008): rows of (key, location, count, value), the first is the header."""
SIZE, FPS, SECONDS = (960, 720), 24, 24
"""Size, pixels, frame rate and duration of the shipped camera path."""
VIEWS = [
    ("01-living-room", (4.8, 3.2, 1.55), (1.25, 1.0, 0.92), 64.0),
    ("02-through-the-opening", (3.3, 2.75, 1.5), (7.4, 1.95, 1.0), 58.0),
    ("03-dining-table", (6.05, 3.2, 1.5), (7.7, 1.7, 0.85), 52.0),
    ("04-chairs", (5.55, 1.35, 1.3), (7.5, 2.0, 0.62), 52.0),
    ("05-bookshelf", (2.35, 2.75, 1.5), (0.15, 2.3, 1.15), 55.0),
    ("06-posters", (2.6, 2.3, 1.5), (2.45, 0.0, 1.35), 52.0),
    ("07-window-and-plant", (2.9, 1.6, 1.45), (4.0, 4.5, 1.25), 58.0),
    ("08-railing", (7.6, 3.2, 1.4), (5.95, 4.0, 0.8), 52.0),
]
"""Name, camera position and target (metres), vertical field of view (degrees) of views of the invented flat."""


def exposures(seed: int, count: int = len(STATIONS)) -> np.ndarray:
    """(count,) camera gains within 1 +- SPREAD whose mean is exactly 1."""
    gains = np.random.default_rng([7, seed]).permutation(np.linspace(-1, 1, count)) * SPREAD
    # Multiples of 1/1024 are added without rounding errors.
    steps = np.trunc(gains * 1024).astype(int)
    steps[-1] -= steps.sum()
    return 1 + steps / 1024


def simulate(points: int, seed: int = 1, *, place: Place | None = None,
             step: Callable[[int], object] | None = None) -> SimulatedScan:
    """The scan of ``place`` (`Place(seed)` if None) from STATIONS.  seed: of the noise.

    step: called with the number of pulses traced since the last call, about 1.1 * ``points`` in total.
    Returns ``points`` points, or slightly fewer if fewer pulses returned.
    """
    place = place or Place(seed)
    scanner = VirtualScanner(partial(place.trace, step=step), ScannerModel(), place.ranges)
    rng = np.random.default_rng([31, seed])
    scan = scanner.scan(STATIONS, int(points * 1.1 / len(STATIONS)), rng, exposures(seed, len(STATIONS)))
    if len(scan) > points:
        scan = scan.taken(np.sort(rng.permutation(len(scan))[:points]))
    return scan


def write_laz(scan: SimulatedScan, path: Path) -> None:
    """Writes LAZ with an atomic write: a temporary file, then a rename.

    Coordinates in steps of SCALE, in metres of no reference system; 16-bit colour (8-bit value * 257), intensity, and the
    station as point source ID.
    """
    import laspy
    from laspy.vlrs.known import GeoKeyDirectoryVlr

    header = laspy.LasHeader(point_format=2, version="1.2")
    keys = GeoKeyDirectoryVlr()
    keys.parse_record_data(np.array(METRES, np.uint16).tobytes())
    header.vlrs.append(keys)
    header.scales, header.offsets = np.full(3, SCALE), np.zeros(3)
    header.system_identifier, header.generating_software = "simulated", "pointglass"
    header.creation_date = None  # so that the same scan always gives the same bytes
    las = laspy.LasData(header)
    las.X, las.Y, las.Z = np.round(scan.xyz / SCALE).astype(np.int32).T
    las.red, las.green, las.blue = scan.rgb.astype(np.uint16).T * 257
    las.intensity = scan.intensity
    las.point_source_id = scan.station.astype(np.uint16)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, lambda beside: las.write(str(beside)))


def camera_towards(position, target) -> np.ndarray:
    """(4,4) camera_to_world, OpenGL axes, of an upright camera at ``position`` (3,) that looks at ``target`` (3,)."""
    position, target = np.asarray(position, float), np.asarray(target, float)
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross([0, 0, 1.0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(back, right), back, position], 1)
    return matrix


def camera_path() -> dict:
    """VIEWS in the format of nerfstudio's camera_path.json."""
    width, height = SIZE
    return {
        "camera_type": "perspective", "render_width": width, "render_height": height, "fps": FPS, "seconds": SECONDS,
        "camera_path": [
            {
                "camera_to_world": [round(float(v), 9) for v in camera_towards(position, target).ravel()],
                "fov": fov, "aspect": round(width / height, 6), "name": name,
            }
            for name, position, target, fov in VIEWS
        ],
    }


def cameras_of(out: Path) -> Path:
    """Path of the camera file beside the scan ``out``."""
    return out.with_name(f"{out.stem}_cameras.json")


def check(out: Path, points: int, seed: int) -> None:
    """Raises DataError naming the first invalid argument of `main`."""
    if out.suffix.lower() not in SUFFIXES:
        raise DataError(f"the name must end in {' or '.join(SUFFIXES)}", option="--out", value=out)
    if not LEAST_POINTS <= points <= MOST_POINTS:
        raise DataError(f"expected {LEAST_POINTS} to {MOST_POINTS}", option="--points", value=points)
    if not 0 <= seed <= MAX_SEED:
        raise DataError(f"expected 0 to {MAX_SEED}", option="--seed", value=seed)
    for path in (out, cameras_of(out)):
        if path.is_dir():
            raise DataError("is a folder", file=path, remedy="choose another --out")


def main(out: Path, points: int = 1_200_000, seed: int = 1, *, step: Callable[[int], object] | None = None) -> int:
    """Simulates a scan and writes ``out`` (LAZ or LAS) and its camera file (`cameras_of`).  Returns the number of points.

    step: as for `simulate`.  Raises DataError for invalid arguments before any work, and if the files cannot be written; no
    partial file or new folder is left then.
    """
    out = Path(out)
    check(out, points, seed)
    cameras = cameras_of(out)
    try:
        # The cameras first, so that a folder without write permission is reported before the simulation.
        with made_folder(out.parent), temporary_file(cameras) as part:
            part.write_text(json.dumps(camera_path(), indent=1) + "\n")
            scan = simulate(points, seed, step=step)
            write_laz(scan, out)
            part.replace(cameras)
    except MemoryError:
        raise DataError("more than fit into this machine's memory", option="--points", value=points,
                        remedy="choose fewer") from None
    except OSError as error:
        raise DataError(f"cannot be written ({error.strerror or error})", file=out,
                        remedy="free space or choose another --out") from None
    return len(scan)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python -m pointglass.model.synth.demo OUT.laz [POINTS [SEED]]")
    main(Path(sys.argv[1]), *(int(v) for v in sys.argv[2:4] or [DEMO_POINTS]))
