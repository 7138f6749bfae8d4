"""Opens a scan and renders one camera in the views raw, filtered, filled and neural.

    python assets/examples/render_picture.py out/pictures
"""

import sys
from pathlib import Path

import pointglass


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with pointglass.open(pointglass.demo_scan()) as scan:  # or "house.e57", or several files of one place
        # file coordinates; fov is the vertical field of view in degrees
        camera = pointglass.look_at((4.8, 3.2, 1.5), (3.0, 2.0, 1.2), fov=64, size=(320, 240), name="living-room")
        for view in ("raw", "filtered", "filled", "neural"):
            picture = scan.render(camera, view=view)  # (240, 320, 4) uint8, sRGB premultiplied by alpha
            picture.save(out / f"{view}.png", background="plain")
    # Each PNG says how it was made: `pointglass render demo.laz --like neural.png --out again` draws it again.
    print(f"4 pictures in {out}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/pictures"))
