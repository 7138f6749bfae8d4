"""Eight fixed cameras in six real scans, rendered in all four views, to be looked at.

    python tests/golden/eight_views.py [OUT]        pictures and one contact sheet, default out/eight

The scans are beside the checkout (../shared/data/scans) and are never committed, nor are these pictures of them.
"""

import sys
from pathlib import Path

from pointglass.viewer.picture.camera import from_fov, look_at

SCANS = Path(__file__).resolve().parents[3] / "shared" / "data" / "scans"
SIZE = (960, 720)
VIEWS8 = [  # name, scan, position, target, vertical field of view in degrees
    ("studio-hall", "studio.laz", (8.0, 2.0, 2.4), (8.0, 9.0, 1.8), 62),
    ("studio-corner", "studio.laz", (12.1, 3.85, 2.5), (9.4, 5.2, 2.3), 62),
    ("plant-room-pipes", "plant_room.laz", (0.18, 1.19, 1.61), (-0.72, -1.67, 1.5), 65),
    ("plant-room-floor", "plant_room.laz", (0.6, 2.4, 1.9), (-1.4, -2.0, 0.6), 65),
    ("pump", "pumpA.e57", (0.0, 0.0, 0.0), (-1.0, -3.5, -0.3), 55),
    ("lion", "lion_takanawa.copc.laz", (-2.9, -1.5, 0.6), (-2.9, 4.0, -1.4), 40),
    ("autzen", "autzen_trim.laz", (636300.0, 848700.0, 640.0), (636750.0, 849250.0, 420.0), 55),
    ("sample-c", "sample_c.las", (674560.0, 1206700.0, 700.0), (674565.0, 1206780.0, 632.0), 55),
]


def cameras() -> dict[str, list]:
    """Cameras by scan file."""
    out: dict[str, list] = {}
    for name, scan, position, target, fov in VIEWS8:
        out.setdefault(scan, []).append(from_fov(*SIZE, fov, look_at(position, target), name))
    return out


def main(out: Path) -> None:
    from pointglass.viewer.commands.demo import contact_sheet
    from pointglass.viewer.common.files import write_png
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.picture.views import VIEWS
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.renderer import Renderer

    out.mkdir(parents=True, exist_ok=True)
    context = create_context()
    rows = []
    for scan, views in cameras().items():
        renderer = Renderer(context, open_scene([SCANS / scan]))
        for camera in views:
            frame = renderer.render(camera, Settings(), views=tuple(VIEWS))
            rows.append([frame.image(view)[..., :3] for view in VIEWS])
            for view, picture in zip(VIEWS, rows[-1], strict=True):
                write_png(out / f"{camera.name}-{view}.png", picture)
            stages = {k: round(v) for k, v in frame.stats["stages"].items()}
            print(f"{camera.name:18} {frame.stats['points_drawn']:>9,} points  {stages}")
        renderer.release()
    write_png(out / "contact-sheet.png", contact_sheet(rows, scale=3))
    print(out / "contact-sheet.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/eight"))
