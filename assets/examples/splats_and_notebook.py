"""Writes Gaussian splats of a scan for the usual viewers, made from the measured points without training.

    python assets/examples/splats_and_notebook.py out/splats

In a notebook, the last line of a cell shows the scan to look around in (pip install 'pointglass[notebook]'):

    scan = pointglass.open("house.e57"); scan.show()
    pointglass.show_published("house-site")      # a folder made by: pointglass publish house.e57 --out house-site
"""

import sys
from pathlib import Path

import pointglass


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with pointglass.open(pointglass.demo_scan()) as scan:
        low, high = scan.bounds
        scan.export(out / "demo.glb", budget=200_000)  # glTF with KHR_gaussian_splatting; also .spz
        count = scan.export(out / "corner.splats.ply", clip=[low, (low + high) / 2], budget=50_000)
    with pointglass.open(out / "corner.splats.ply") as splats:  # opens as points, where the scan is
        print(f"{count:,} splats of a corner, {splats.count:,} of them shown as points")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/splats"))
