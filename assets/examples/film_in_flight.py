"""Films a flight as a slow computer shows it, left filled, right with the last neural picture moved by depth, and judges both.

    python assets/examples/film_in_flight.py out/flight [SCAN WIDTHxHEIGHT FRAMES]

A neural picture begins every AGE frames and is shown AGE frames later, as when the network takes half a second beside the
flight.  PSNR is to the neural picture of the same camera.
"""

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np

import pointglass
from pointglass.viewer.commands.film.encode import encode_mp4
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device.context import create_context
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.passes.reprojection import Keyframe, Reprojection
from pointglass.viewer.render.renderer import Renderer

AGE = 8
RATE = 15


def flight(scan: str | Path, size: tuple[int, int], frames: int) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """The neural, the filled and the moved picture of each frame, (H, W, 3) uint8, on an arc around the middle of the scan."""
    context = create_context()
    scene = open_scene(scan)
    renderer, programs = Renderer(context, scene), Programs(context)
    step = Reprojection(programs, size)
    made: tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]] = ([], [], [])
    low, high = scene.bounds
    middle, reach = (low + high) / 2, 0.25 * (high - low)
    keyframes: list[Keyframe] = []
    for number in range(frames):
        turn = 0.02 * number
        eye = middle + reach * np.array([np.cos(turn), np.sin(turn), 0.0])
        camera = from_fov(*size, 70.0, look_at(eye, middle))
        frame = renderer.render(camera, Settings(view="neural"), ("filled", "neural"), filled_depth=True)
        assert frame.filled_depth is not None
        shown = filled = frame.image("filled")[..., :3]
        if number >= AGE:
            moved = step.run(frame.textures["filled"], frame.filled_depth, camera, keyframes[(number - AGE) // AGE])
            shown = np.frombuffer(moved.read(), np.uint8).reshape(size[1], size[0], 4)[..., :3]
        if number % AGE == 0:
            keyframes.append(Keyframe(context, size))
            keyframes[-1].take_depth(camera, frame.filled_depth, frame.textures["filled"])
            keyframes[-1].take_picture(frame.image("neural"))
        for pictures, picture in zip(made, (frame.image("neural")[..., :3], filled, shown)):
            pictures.append(picture.copy())
    for owned in (*keyframes, step, programs, renderer, context):
        owned.release()
    return made


def judged(neural: list[np.ndarray], shown: list[np.ndarray]) -> str:
    """PSNR to the neural pictures, and the root mean square error of the change from a frame to the next, in levels."""
    off = np.array(shown[AGE:], np.float32) - np.array(neural[AGE:], np.float32)
    error, change = (float(np.sqrt((part**2).mean())) for part in (off, np.diff(off, axis=0)))
    return f"{20 * np.log10(255 / error):.1f} dB, flicker {change:.2f} levels"


def main(out: Path, scan: str | Path, size: tuple[int, int], frames: int) -> None:
    out.mkdir(parents=True, exist_ok=True)
    neural, filled, moved = flight(scan, size, frames)
    pairs = (np.hstack(pair) for pair in zip(filled, moved))
    encode_mp4(out / "flight.mp4", pairs, size=(2 * size[0], size[1]), fps=Fraction(RATE))
    print(f"filled: {judged(neural, filled)}; with the neural picture moved: {judged(neural, moved)}")


if __name__ == "__main__":
    given = sys.argv[2:] or [str(pointglass.demo_scan()), "320x240", "24"]
    width, height = (int(side) for side in given[1].split("x"))
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/flight"), given[0], (width, height), int(given[2]))
