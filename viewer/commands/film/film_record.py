"""What a film says about itself: the text inside each frame, the record of its folder, and the line for a person."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from ... import __version__
from ...common.text import counted
from ...picture.edits import NO_EDITS, Edits
from ...picture.json_values import to_json
from ...work.pictures.film_titles import NO_TITLES, FilmTitles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...picture.settings import Settings
    from .frames import FrameMaker

MP4 = (".mp4", ".m4v", ".mov")


def folder_line(out: Path, count: int, made: int) -> str:
    """Tells a person what was made in a folder."""
    kept = f", {count - made:,} kept" if made < count else ""
    return f"{counted(count, 'frame')} in {out}{kept}"


def ingredients(scene: "Scene", cameras: "Sequence[Camera]", settings: "Settings", *, panorama: bool, supersample: int,
                background: str, edits: Edits = NO_EDITS, titles: FilmTitles = NO_TITLES) -> dict:
    """JSON-able: all that determines the frames of a folder."""
    made_of = {
        "version": __version__, "scans": list(scene.meta.sources), "points": scene.count, "settings": asdict(settings),
        "size": [cameras[0].width, cameras[0].height], "panorama": panorama, "supersample": supersample,
        "background": background,
        "path": [[*c.camera_to_world[:3].ravel().tolist(), c.fx, c.fy, c.cx, c.cy] for c in cameras],
    }
    if titles.shown:
        made_of |= titles.record
    return made_of if edits.none else made_of | {"alterations": to_json(edits)}


def describe(scene: "Scene", maker: "FrameMaker", camera: "Camera") -> dict[str, str]:
    """The text inside the PNG of a frame: its description, or what prevents drawing it again."""
    from ...work.pictures.shot_metadata import KEY, cannot_repeat, describe_shot

    if maker.panorama:
        return cannot_repeat("a panorama")
    if maker.supersample > 1:
        return cannot_repeat(f"a picture averaged from one {maker.supersample} times as wide")
    return {KEY: describe_shot(scene, maker.spec(maker.framed(camera))).drawn_with(maker.renderer.choice.timed).text()}
