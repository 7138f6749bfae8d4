"""Lists the photographs inside an E57, saves them, and renders the scan through the camera of each to compare.

    python assets/examples/e57_photographs.py out/photographs [house.e57]

Without a scan of your own, an E57 with one photograph is made from the demo scan.
"""

import io
import sys
from pathlib import Path

import numpy as np

import pointglass


def main(out: Path, file: Path | None = None) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with pointglass.open(file or make_e57(out / "made.e57")) as scan:
        for number, photograph in enumerate(scan.photographs):
            print(f"{photograph.name}: {photograph.kind}, {photograph.size}, station {photograph.station}")
            picture = photograph.image  # (H, W, 3) uint8, decoded now
            picture.save(out / f"{number}_photograph.png")
            if photograph.camera is None:  # no pose, or not a pinhole camera
                continue
            frame = scan.render(photograph.camera, view="filled", full=True, photos="off")
            frame.save(out / f"{number}_scan.png")
            seen = frame.provenance > 0
            error = np.abs(np.asarray(picture, int) - np.asarray(frame.image, int)[..., :3])[seen].mean()
            print(f"  mean difference from the scan {error:.1f} of 255, where the scan has points")


def make_e57(path: Path) -> Path:
    """An E57 with points of the demo scan and a picture of it as a pinhole photograph."""
    from PIL import Image
    from pye57 import libe57 as e57
    from scipy.spatial.transform import Rotation

    camera = pointglass.look_at((4.8, 3.2, 1.5), (3.0, 2.0, 1.2), fov=60, size=(240, 180))
    with pointglass.open(pointglass.demo_scan()) as demo:
        some = demo.points[::4]
        xyz, rgb = some.xyz, some.rgb.astype(np.float64)
        picture = np.asarray(demo.render(camera, view="filled"))[..., :3]
    jpeg = io.BytesIO()
    Image.fromarray(picture).save(jpeg, "jpeg", quality=92)
    content = np.frombuffer(jpeg.getvalue(), np.uint8).copy()

    file = e57.ImageFile(str(path), "w")
    file.extensionsAdd("", e57.E57_V1_0_URI)

    def node(value):  # a dict becomes a Structure, numbers and texts leaves
        if isinstance(value, dict):
            made = e57.StructureNode(file)
            for name, child in value.items():
                made.set(name, node(child))
            return made
        if isinstance(value, int):
            return e57.IntegerNode(file, value)
        return e57.FloatNode(file, value) if isinstance(value, float) else e57.StringNode(file, value)

    root, data, images = file.root(), e57.VectorNode(file, True), e57.VectorNode(file, True)
    for name, value in {"formatName": "ASTM E57 3D Imaging Data File", "guid": "{example}", "versionMajor": 1,
                        "versionMinor": 0}.items():  # fmt: skip
        root.set(name, node(value))
    root.set("data3D", data)
    root.set("images2D", images)
    scan, prototype, buffers = node({"guid": "{scan}"}), e57.StructureNode(file), e57.VectorSourceDestBuffer()
    data.append(scan)
    columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ", "colorRed", "colorGreen", "colorBlue"),
                       np.ascontiguousarray(np.hstack([xyz, rgb]).T), strict=True))  # fmt: skip
    for name in columns:
        prototype.set(name, e57.IntegerNode(file, 0, 0, 255) if name.startswith("color") else e57.FloatNode(file, 0.0))
    points = e57.CompressedVectorNode(file, prototype, e57.VectorNode(file, True))
    scan.set("points", points)
    for name, values in columns.items():
        buffers.append(e57.SourceDestBuffer(file, name, values, len(values), True, True))
    writer = points.writer(buffers)
    writer.write(len(xyz))
    writer.close()

    x, y, z, w = map(float, Rotation.from_matrix(camera.camera_to_world[:3, :3]).as_quat())
    pixel = 1e-5  # metres; only the ratio to the focal length counts
    image = node({"guid": "{photograph}", "name": "living room", "associatedData3DGuid": "{scan}",
                  "pose": {"rotation": {"w": w, "x": x, "y": y, "z": z},
                           "translation": dict(zip("xyz", map(float, camera.position), strict=True))}})  # fmt: skip
    pinhole = node({"imageWidth": camera.width, "imageHeight": camera.height, "focalLength": camera.fx * pixel,
                    "pixelWidth": pixel, "pixelHeight": pixel, "principalPointX": camera.cx,
                    "principalPointY": camera.cy})  # fmt: skip
    images.append(image)
    image.set("pinholeRepresentation", pinhole)
    blob = e57.BlobNode(file, len(content))
    pinhole.set("jpegImage", blob)
    blob.write(content, 0, len(content))
    file.close()
    return path


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/photographs"), *map(Path, sys.argv[2:3]))
