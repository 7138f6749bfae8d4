"""Runs the benches that the README's figures come from, into ``out/bench``: ``python -m viewer.bench.figures [NAME...]``.

``make figures`` runs this and then viewer.bench.readme.  Real scans lie beside the checkout and are never committed: what
needs one that is not there is left out, and named.  Each bench runs in a process of its own, so that none starts warm.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from model.common.atomic_write import write_whole

SCANS = Path("../shared/data/scans")
ROOMS = Path("../shared/data/renders")
PLANT, STREETS = "plant_room.laz", "autzen_trim.laz"
ROOM = "living-room-2.ply"
"""Written beside the figures from the registered room of that name: a plain file whose order tells where its scanners stood."""
FIGURES: dict[str, tuple[str, ...]] = {
    "grid": ("grid",),
    "open-plant_room": ("open", PLANT),
    "open-procedural": ("open", "--procedural", "25M"),
    "frame-plant_room": ("frame", PLANT),
    "frame-plant_room-fast": ("frame", PLANT, "--quality", "fast"),
    "frame-plant_room-lod4": ("frame", PLANT, "--lod", "4"),
    "frame-demo-sizes": ("frame", "--size", "960x720,1920x1440,3840x2160", "--along", "views", "--repeats", "3"),
    "raster": ("raster",),
    "cull": ("cull",),
    "void": ("error", STREETS, "--only", "void"),
    "stations": ("error", ROOM, "--only", "stations"),
    "error-demo": ("error",),
    "versus-plant_room": ("versus", PLANT),
    "versus-procedural": ("versus", "--procedural", "25M"),
    "scale": ("scale",),
    "stability": ("stability",),
    "occlusion": ("occlusion",),
}
"""Name of a file in out/bench -> what ``pointglass bench`` is given; a name that ends in .laz is a scan in SCANS, one in .ply
a room of ROOMS."""


def command(arguments: Sequence[str], scans: Path, made: Path, rooms: Path = ROOMS) -> tuple[list[str], list[Path]]:
    """The arguments with scans by path, and what is not there of these.  made: the folder in which rooms are written."""
    given, missing = [], []
    for part in arguments:
        path = {".laz": scans, ".ply": made}.get(Path(part).suffix, Path()) / part
        if path.suffix == ".ply" and not path.is_file() and (rooms / path.stem).is_dir():
            write_room(rooms / path.stem, path)
        if path.suffix in (".laz", ".ply") and not path.is_file():
            missing.append(path if path.suffix == ".laz" else rooms / path.stem)
        given.append(str(path))
    return given, missing


def write_room(folder: Path, path: Path, seed: int = 11) -> None:
    """The scan of a registered room, station after station as a merged file keeps it, as a binary PLY."""
    from model.data.stations import load_scene, scan_stations

    scan = scan_stations(load_scene(folder), seed)
    record = np.zeros(len(scan.xyz), [("xyz", "<f8", 3), ("rgb", "u1", 3)])
    record["xyz"], record["rgb"] = scan.xyz, scan.rgb
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(record)}",
             *(f"property double {axis}" for axis in "xyz"), *(f"property uchar {name}" for name in ("red", "green", "blue")),
             "end_header", ""]
    write_whole(path, lambda beside: beside.write_bytes("\n".join(lines).encode() + record.tobytes()))


def main(names: Sequence[str], folder: Path = Path("out/bench"), scans: Path = SCANS) -> int:
    """Runs the named benches (all by default) into ``folder``; returns 1 where one failed, 2 for a name unknown."""
    unknown = [name for name in names if name not in FIGURES]
    if unknown:
        print(f"{unknown[0]}: expected one of {', '.join(FIGURES)}", file=sys.stderr)
        return 2
    folder.mkdir(parents=True, exist_ok=True)
    failed = []
    for name in names or FIGURES:
        given, missing = command(FIGURES[name], scans, folder)
        if missing:
            print(f"{name}: left out, {missing[0]} is not there", flush=True)
            continue
        print(f"{name}: pointglass bench {' '.join(given)}", flush=True)
        target = ["--json", str(folder / f"{name}.json"), "--plot", str(folder / f"{name}.png")]
        if subprocess.run([sys.executable, "-m", "viewer", "bench", *given, *target], check=False).returncode:
            failed.append(name)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
