"""Places keyframes, writes them as a nerfstudio camera path, and films the smooth path through them as a video.

    python assets/examples/film_along_keyframes.py out/film
"""

import subprocess
import sys
from pathlib import Path

import pointglass

STOPS = [((4.8, 3.2, 1.55), (3.0, 2.0, 1.2)), ((4.0, 2.6, 1.55), (2.6, 3.0, 1.3)), ((3.0, 2.4, 1.5), (1.0, 2.4, 1.4))]
"""Eye and target of each keyframe, file coordinates."""


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    keys = [pointglass.look_at(eye, target, fov=60, size=(320, 240), name=f"key_{number}")
            for number, (eye, target) in enumerate(STOPS)]  # fmt: skip
    pointglass.write_cameras(out / "camera_path.json", keys)  # nerfstudio's viewer reads and writes the same file
    # Videos are made by the command: it samples the path at constant speed and encodes H.264.
    command = [sys.executable, "-m", "pointglass.viewer", "video", pointglass.demo_scan(), "--path", out / "camera_path.json",
               "--seconds", "1", "--fps", "12", "--view", "filled", "--out", out / "walk.mp4"]  # fmt: skip
    subprocess.run([str(word) for word in command], check=True)
    print(f"{out / 'walk.mp4'}: {(out / 'walk.mp4').stat().st_size:,} bytes")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/film"))
