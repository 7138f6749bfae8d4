"""Measures the demo room by planes fitted to its points, and writes a table, a drawing and map features.

Its height, the angle of two walls and a corner, each with its uncertainty at 95 %.

    python assets/examples/measure_room.py out/measures
"""

import sys
from pathlib import Path

import numpy as np

import pointglass
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.work.measuring.measure_files import write_measurements
from pointglass.viewer.work.measuring.measure_text import value_text
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with pointglass.open(pointglass.demo_scan()) as scan:
        xyz = scan.points.xyz[::20]

        def at(place) -> MeasuredPoint:
            """The plane at the measured point nearest to a place."""
            nearest = tuple(map(float, xyz[np.linalg.norm(xyz - place, axis=1).argmin()]))
            return MeasuredPoint(nearest, fit=scan.fit(nearest, "plane"))

        low, middle, high = np.quantile(xyz, [0.02, 0.5, 0.98], axis=0)  # the very lowest point may be a stray one
        floor, ceiling = (at((middle[0], middle[1], height)) for height in (low[2], high[2]))
        west, south = at((low[0], middle[1], middle[2])), at((middle[0], low[1], middle[2]))
    made = [Measurement("plane to plane", (floor, ceiling), "height"), Measurement("edge", (west, south), "walls"),
            Measurement("corner", (floor, west, south), "corner")]  # fmt: skip
    for measurement in made:
        print(f"{measurement.name:8}{value_text(measurement, 'm')}")
    for ending in ("csv", "dxf", "geojson"):
        write_measurements(out / f"room.{ending}", made, ScanDescription(units="metre", metres_per_unit=1.0))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/measures"))
