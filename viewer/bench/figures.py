"""Runs the benches that the README's figures come from, into ``out/bench``: ``python -m viewer.bench.figures [NAME...]``.

``make figures`` runs this and then viewer.bench.readme.  Real scans lie beside the checkout and are never committed: what
needs one that is not there is left out, and named.  Each bench runs in a process of its own, so that none starts warm.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

SCANS = Path("../shared/data/scans")
PLANT, STREETS = "plant_room.laz", "autzen_trim.laz"
FIGURES: dict[str, tuple[str, ...]] = {
    "grid": ("grid",),
    "open-plant_room": ("open", PLANT),
    "open-procedural": ("open", "--procedural", "25M"),
    "frame-plant_room": ("frame", PLANT),
    "frame-plant_room-fast": ("frame", PLANT, "--quality", "fast"),
    "frame-plant_room-lod4": ("frame", PLANT, "--lod", "4"),
    "frame-demo-sizes": ("frame", "--size", "960x720,1920x1440,3840x2160", "--along", "views", "--repeats", "3"),
    "raster": ("raster",),
    "void": ("error", STREETS, "--only", "void"),
    "error-demo": ("error",),
    "versus-plant_room": ("versus", PLANT),
    "versus-procedural": ("versus", "--procedural", "25M"),
    "scale": ("scale",),
    "stability": ("stability",),
    "occlusion": ("occlusion",),
}
"""Name of a file in out/bench -> what ``pointglass bench`` is given; a name that ends in .laz is a scan in SCANS."""


def command(arguments: Sequence[str], scans: Path) -> tuple[list[str], list[Path]]:
    """The arguments with scans by path, and those of the scans that are not there."""
    given = [str(scans / part) if part.endswith(".laz") else part for part in arguments]
    return given, [scans / part for part in arguments if part.endswith(".laz") and not (scans / part).is_file()]


def main(names: Sequence[str], folder: Path = Path("out/bench"), scans: Path = SCANS) -> int:
    """Runs the named benches (all by default) into ``folder``; returns 1 where one failed, 2 for a name unknown."""
    unknown = [name for name in names if name not in FIGURES]
    if unknown:
        print(f"{unknown[0]}: expected one of {', '.join(FIGURES)}", file=sys.stderr)
        return 2
    folder.mkdir(parents=True, exist_ok=True)
    failed = []
    for name in names or FIGURES:
        given, missing = command(FIGURES[name], scans)
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
