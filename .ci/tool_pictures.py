"""Takes the README's picture of each tool: the demo scan in a real window, under Xvfb.  Run by ``make pictures``.

Writes ``assets/readme/tools/NAME.jpg``, the window at 1280x720, smaller.  The Stations tool has an animation of
its own (readme_pictures.py).
"""

import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "window")]
SIZE = (1280, 720)
OUT = ROOT / "assets" / "readme" / "tools"
SAVED = (960, 540)
QUALITY = 85


def main() -> None:
    from driver import Driver, middle
    from PIL import Image

    from pointglass.viewer.commands.demo import demo_camera, demo_scan
    from pointglass.viewer.window.interaction.clipping.clip_tool import extent_of
    from pointglass.viewer.window.interaction.editing import edit

    with tempfile.TemporaryDirectory() as folder:
        os.environ["POINTGLASS_STATE"] = str(Path(folder) / "state")  # no offer to restore work in the picture
        d = Driver(Path(folder))
        context, toolbox, session = d.app.tools, d.app.toolbox, d.session

        def take(name: str) -> None:
            d.rest()
            session.notices.toasts.clear()
            d.settle(3)
            OUT.mkdir(parents=True, exist_ok=True)
            picture = Image.fromarray(d.app.viewport.canvas.read()).convert("RGB")
            picture = picture.resize(SAVED, Image.Resampling.LANCZOS)
            picture.save(OUT / f"{name}.jpg", quality=QUALITY, optimize=True)

        d.resize(*SIZE)
        session.open([demo_scan()], demo_camera())
        d.until(lambda: session.loads.current is None and session.scene is not None and not session.shown_scan.preview, 120.0)
        d.rest()
        d.key("I")
        d.click(*middle(d, 0.12, 0.1))
        take("inspect")
        d.key("T")
        for place in ((-0.3, 0.02), (0.05, 0.06)):
            d.click(*middle(d, *place))
        take("measure")
        while session.document.measurements:
            session.work.undo()
        d.key("L")
        notes = ((-0.3, 0.02), "Crack in the plaster, 2 mm", "open"), ((0.2, -0.1), "Lamp is replaced", "done")
        for place, text, status in notes:
            d.click(*middle(d, *place))
            d.key("ESCAPE")  # out of the text field
            toolbox.active.change(context, toolbox.active.chosen, "Note", text=text, status=status)
        toolbox.active.choose(0)
        take("notes")
        while session.document.annotations:
            session.work.undo()
        toolbox.select("section", context)
        toolbox.active.preview.shown = True
        d.until(lambda: toolbox.active.preview.image is not None, 60.0)
        take("section")
        d.key("C")
        d.key("2")
        edit(context, "colours", look=replace(session.document.look, colour_by="height", ramp="turbo", edl=0.5, point_size=2))
        take("colours")
        session.work.undo()
        d.key("3")
        d.key("M")
        take("what-is-real")
        d.key("K")
        toolbox.active.add_bookmark(context)
        for aside in (-1.0, 0.2, 1.0):
            session.flight.go_home()
            camera = session.camera
            place = camera.position + 1.8 * camera.forward + 0.8 * aside * camera.right
            place[2] += 0.3 * abs(aside)
            session.flight.go(replace(session.flight.state, position=place))
            d.rest()
            toolbox.active.path.add_keyframe(context)
        session.flight.go_home()
        context.renew_picture()
        take("film")
        session.flight.go_home()
        d.key("B")
        toolbox.active.add(context, "box")
        clip = session.document.clips[-1]
        centre = np.array(clip.centre) + 0.08 * extent_of(context) * np.array([0.0, 0.0, -1.0])
        edit(context, "clip", clips=(replace(clip, centre=tuple(float(value) for value in centre)),))
        session.frame_scene()
        context.renew_picture()
        take("clip")
        d.app.close()


if __name__ == "__main__":
    main()
