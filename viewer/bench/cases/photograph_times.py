"""Time that photographs add to a filled picture: none, 18 of a lens, and 300 panoramas of which those in reach are chosen.

Frame: metres, z up; one procedural room.  The photographs stand in it and show noise, and are not compared with the points.
Each view is made with each set in turn, so that other work of the machine meets all of them.
"""

import itertools
import time
from functools import partial
from pathlib import Path

import numpy as np

from ...picture.settings import Settings

FACES, PANORAMAS = 18, 300
_PLACES = 3
"""Stations with six faces each."""
_FACE, _PANORAMA = 1024, (8192, 4096)
"""Sides of a photograph, pixels."""
_SPREAD = np.array([2.4, 1.9, 0.9])
"""Farthest places of photographs from the middle of the room, metres."""
_VIEWS = 3
_SQUARE = 8
"""Pixels of a photograph along a side of a square of one colour."""


def run_photographs(count: int, size: tuple[int, int], repeats: int, seed: int) -> dict:
    """Milliseconds, by the clock and of all processors, of filled pictures of a few views, with each set of photographs."""
    from ...common.progress import progress
    from ...picture.camera import from_fov, look_at
    from ...render.device.context import create_context
    from ...render.renderer import Renderer
    from ..procedural_scan import ProceduralScan, procedural_scene

    scan = ProceduralScan(count, 1, seed)
    scene, context = procedural_scene(scan), create_context()
    renderer, middle = Renderer(context, scene), scan.room_middle(0) + (0.0, 0.0, 1.4)
    rng = np.random.default_rng(seed)
    renderer.photographs.give("faces", _faces(middle, rng), checked=False)
    renderer.photographs.give("panoramas", _panoramas(middle, rng), checked=False)
    sets = {"off": "none", "faces": f"{FACES} photographs", "panoramas": f"{PANORAMAS} panoramas"}
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in sets}
    shown = dict.fromkeys(sets, 0)
    with progress(_VIEWS * (repeats + 1) * len(sets), "photographs", "picture") as meter:
        for angle, turn in itertools.product(np.linspace(0.0, 0.6, _VIEWS), range(repeats + 1)):
            eye = middle + (1.2 * np.cos(angle), np.sin(angle), 0.001 * turn)  # another camera, so that they are chosen again
            towards = middle + (2.5 * np.cos(angle + 2.0), 2.0 * np.sin(angle + 2.0), -0.3)
            camera = from_fov(*size, 60.0, look_at(eye, towards))
            for name in sets:
                begun, used = time.perf_counter(), time.process_time()
                frame = renderer.render(camera, Settings(view="filled", photos=name), views=("filled",))
                context.finish()
                if turn:  # in the first round they are decoded
                    spent[name].append((1e3 * (time.perf_counter() - begun), 1e3 * (time.process_time() - used)))
                shown[name] = max(shown[name], frame.facts.photographs or 0)
                meter.update(1)
    device = renderer.device
    medians = {name: np.median(values, axis=0) for name, values in spent.items()}
    result = {
        "scans": [scan.label], "points": scene.count, "size": list(size), "repeats": repeats, "opengl": device.renderer,
        "driver": device.version, "software": device.software,
        "sets": [{"name": sets[name], "shown": shown[name], "clock_ms": float(medians[name][0]),
                  "processor_ms": float(medians[name][1]), "added_clock_ms": float(medians[name][0] - medians["off"][0]),
                  "added_processor_ms": float(medians[name][1] - medians["off"][1])} for name in sets],
    }  # fmt: skip
    renderer.release()
    context.release()
    return result


def _noise(seed: int, _longest: int, *, size: tuple[int, int]) -> tuple[np.ndarray, None]:
    small = np.random.default_rng(seed).integers(40, 216, (size[1] // _SQUARE, size[0] // _SQUARE, 3), dtype=np.uint8)
    return small.repeat(_SQUARE, 0).repeat(_SQUARE, 1), None


def _faces(middle: np.ndarray, rng: np.random.Generator) -> list:
    from ...picture.camera import look_at
    from ...readers.photographs.posed_photograph import PosedPhotograph

    half, made = _FACE / 2, []
    for station in range(_PLACES):
        place = middle + rng.uniform(-0.7, 0.7, 3) * _SPREAD
        for number, way in enumerate(np.concatenate([np.eye(3), -np.eye(3)])):
            up = (1.0, 0.0, 0.0) if way[2] else (0.0, 0.0, 1.0)
            pose = look_at(place, place + way, up)
            made.append(PosedPhotograph(f"{station} {number}", "pinhole", _FACE, _FACE, (half, half, half, half), False, pose,
                                        partial(_noise, 6 * station + number, size=(_FACE, _FACE))))  # fmt: skip
    return made


def _panoramas(middle: np.ndarray, rng: np.random.Generator) -> list:
    from ...readers.photographs.posed_photograph import PosedPhotograph

    width, height = _PANORAMA
    focal, made = width / (2 * np.pi), []
    for number in range(PANORAMAS):
        pose, turn = np.eye(4), rng.uniform(0, 2 * np.pi)
        pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        pose[:3, 3] = middle + rng.uniform(-1.0, 1.0, 3) * _SPREAD
        made.append(PosedPhotograph(f"{number}", "spherical", width, height,
                                    (focal, focal, width / 2, height / 2), True, pose,
                                    partial(_noise, number, size=(width // 2, height // 2))))  # fmt: skip
    return made


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    return [(f"{one['name']} ({one['shown']} in a picture)",
             f"{one['clock_ms']:.1f} ms by the clock ({one['added_clock_ms']:+.1f}), of all processors "
             f"{one['processor_ms']:.1f} ({one['added_processor_ms']:+.1f})") for one in result["sets"]]


def plot(result: dict, path: Path) -> None:
    """A bar for each set."""
    from ..plots import INK, figure, save

    made, axes = figure(7.0, 1.8)
    axes.barh([one["name"] for one in result["sets"]], [one["clock_ms"] for one in result["sets"]], color=INK[0])
    axes.invert_yaxis()
    axes.set_xlabel("milliseconds of a filled picture, median")
    save(made, path, result)
