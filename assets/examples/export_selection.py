"""Exports the points inside a box, and those of one station, as LAZ: whole records, as they are in the file.

    python assets/examples/export_selection.py out/export
"""

import sys
from pathlib import Path

import pointglass


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with pointglass.open(pointglass.demo_scan()) as scan:
        low, high = scan.bounds
        middle = (low + high) / 2
        count = scan.export(out / "corner.laz", clip=[low, middle])  # lowest and highest corner, file coordinates
        alone = scan.export(out / "station.laz", stations=[0], clip=[low, middle])  # a row of scan.stations
    with pointglass.open(out / "corner.laz") as corner:  # what was exported opens like any other scan
        assert corner.count == count
        print(f"{count:,} points in a quarter of the box, {alone:,} of them of station 0; "
              f"attributes: {', '.join(corner.points.attributes)}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/export"))
