"""Reads cameras of a COLMAP model and of a nerfstudio transforms.json, renders through them and writes them back.

    python assets/examples/exchange_cameras.py out/cameras
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import pointglass


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    cameras = [pointglass.look_at((4.8, 3.2, 1.5), (3.0 - 0.3 * n, 2.0, 1.2), fov=60, size=(240, 180), name=f"view_{n}")
               for n in range(3)]  # fmt: skip
    write_colmap(out / "colmap", cameras)  # in place of a model of your own

    from_colmap = pointglass.read_cameras(out / "colmap")  # text or binary; lens distortion is refused
    pointglass.write_cameras(out / "transforms.json", from_colmap)
    from_nerfstudio = pointglass.read_cameras(out / "transforms.json")
    worst = max(np.abs(one.camera_to_world - again.camera_to_world).max()
                for one, again in zip(cameras, from_nerfstudio, strict=True))
    print(f"{len(from_nerfstudio)} cameras; poses differ by at most {worst:.1e} after both formats")

    with pointglass.open(pointglass.demo_scan()) as scan:
        for camera, picture in zip(from_nerfstudio, scan.render(from_nerfstudio, view="filled"), strict=True):
            picture.save(out / f"{camera.name}.png")


def write_colmap(folder: Path, cameras: list[pointglass.Camera]) -> None:
    """A COLMAP model in text form.  Its camera frame is x right, y down, z forward: that of ``view_rotation``."""
    folder.mkdir(parents=True, exist_ok=True)
    first, images = cameras[0], []
    for number, camera in enumerate(cameras, 1):
        x, y, z, w = Rotation.from_matrix(camera.view_rotation).as_quat()
        translation = -camera.view_rotation @ camera.position
        values = " ".join(f"{value:.12g}" for value in (w, x, y, z, *translation))
        images.append(f"{number} {values} 1 {camera.name}.png\n\n")  # the empty line: no 2D points
    lens = f"{first.width} {first.height} {first.fx} {first.fy} {first.cx} {first.cy}"
    (folder / "cameras.txt").write_text(f"1 PINHOLE {lens}\n")
    (folder / "images.txt").write_text("".join(images))
    (folder / "points3D.txt").write_text("")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/cameras"))
