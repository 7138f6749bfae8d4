"""Draws a floor plan and a section between two places to scale, as PDF and PNG.

    python assets/examples/draw_section.py out/sections
"""

import subprocess
import sys
from pathlib import Path

import pointglass


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    sheets = {
        "plan.pdf": ["--plan", "1.2"],  # a slab of 0.2 m at this height, seen from above
        "section.png": ["--line", "0.5,2.4,6,2.4", "--thickness", "0.5"],  # upright, between two places x,y
    }
    for name, cut in sheets.items():
        # Sheets are drawn by the command; lengths are those of the file's coordinates.
        command = [sys.executable, "-m", "pointglass.viewer", "section", pointglass.demo_scan(), *cut, "--scale", "1:100",
                   "--dpi", "100", "--out", out / name]  # fmt: skip
        subprocess.run([str(word) for word in command], check=True)
    print(f"{len(sheets)} sheets in {out}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/sections"))
