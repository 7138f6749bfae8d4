"""The picture at the head of the README: ``python -m viewer.bench.readme_picture``; the first demo camera in all four views."""

from pathlib import Path

from model.common.atomic_write import write_whole
from viewer.paths import assets_dir
from viewer.settings import VIEWS, Settings

SIZE = (640, 480)
PICTURE = Path("readme") / "four-views.jpg"


def main(path: Path | None = None, settings: Settings | None = None) -> Path:
    """Draws it into ``path`` (default: where the README looks for it) and returns that."""
    from PIL import Image

    from viewer.grid.open_scene import open_scene
    from viewer.render.context import create_context
    from viewer.render.renderer import Renderer
    from viewer.tools.background import composite
    from viewer.tools.camera_files import read_cameras
    from viewer.tools.demo import contact_sheet, demo_scan

    path = path or assets_dir() / PICTURE
    renderer = Renderer(create_context(), open_scene([demo_scan()]))
    try:
        camera = read_cameras(assets_dir() / "demo_cameras.json")[0].resized(*SIZE)
        frame = renderer.render(camera, settings or Settings(), views=tuple(VIEWS))
        pictures = [composite(frame.image(view)) for view in VIEWS]
    finally:
        renderer.release()
    sheet = Image.fromarray(contact_sheet([pictures[:2], pictures[2:]], scale=1))
    write_whole(path, lambda beside: sheet.save(beside, format="JPEG", quality=90))
    return path


if __name__ == "__main__":
    print(main())
