"""Compares the raw, filtered and filled views of one camera: how many pixels were measured, hidden and filled, side by side.

    python assets/examples/compare_views.py out/compare
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import pointglass

MEASURED, FILLED = 1, 3  # pointglass.PROVENANCE names all values


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with pointglass.open(pointglass.demo_scan()) as scan:
        camera = pointglass.look_at((4.8, 3.2, 1.5), (3.0, 2.0, 1.2), fov=64, size=(320, 240))
        frames = {view: scan.render(camera, view=view, full=True) for view in ("raw", "filtered", "filled")}
    for view, frame in frames.items():
        measured, filled = (float((frame.provenance == kind).mean()) for kind in (MEASURED, FILLED))
        print(f"{view:9}{measured:7.1%} measured{filled:7.1%} filled")
    raw, kept = frames["raw"], frames["filled"].mask
    hidden = (raw.provenance == MEASURED) & ~kept  # points there lie behind a nearer surface
    print(f"{hidden.mean():.1%} of the pixels show a hidden point in the raw view; "
          f"they are {np.median(raw.depth[hidden]):.1f} m away in the median, the others {np.median(raw.depth[kept]):.1f} m")
    sheet = np.hstack([np.asarray(frame.image)[..., :3] for frame in frames.values()])
    Image.fromarray(sheet).save(out / "raw_filtered_filled.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/compare"))
