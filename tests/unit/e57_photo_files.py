"""Makers of an E57 with photographs of a painted room: pinhole cameras and panoramas, with their poses."""

import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

BOX = np.array([2.0, 1.5, 1.2])  # half sizes of the room, metres; z is up
AWAY = np.array([30.0, -12.0, 4.0])  # of the room's middle from the file's origin


@dataclass
class Picture:
    """What one entry of images2D is written from.  values: the numbers of its representation.  blobs: name -> bytes."""

    kind: str = "pinhole"
    values: dict = field(default_factory=dict)
    blobs: dict = field(default_factory=dict)
    quaternion: tuple | None = (1.0, 0.0, 0.0, 0.0)
    translation: tuple = (0.0, 0.0, 0.0)
    name: str = "photo"
    guid: str | None = None
    more: dict = field(default_factory=dict)


def write_photos(path: Path, pictures: list[Picture], xyz: np.ndarray, rgb: np.ndarray | None) -> Path:
    """One scan without a pose (file coordinates) and images2D."""
    from untyped import libe57 as e

    file = e.ImageFile(str(path), "w")
    file.extensionsAdd("", e.E57_V1_0_URI)
    file.extensionsAdd("dist", "http://www.libe57.org/E57_LEICA_Camera_Distortion.txt")
    root = file.root()
    root.set("formatName", e.StringNode(file, "ASTM E57 3D Imaging Data File"))
    root.set("guid", e.StringNode(file, "{test}"))
    root.set("versionMajor", e.IntegerNode(file, e.E57_FORMAT_MAJOR))
    root.set("versionMinor", e.IntegerNode(file, e.E57_FORMAT_MINOR))
    data, images = e.VectorNode(file, True), e.VectorNode(file, True)
    root.set("data3D", data)
    root.set("images2D", images)
    scan = e.StructureNode(file)
    data.append(scan)
    scan.set("guid", e.StringNode(file, "{scan 0}"))
    prototype, buffers, columns = e.StructureNode(file), e.VectorSourceDestBuffer(), {}
    for k, axis in enumerate("XYZ"):
        prototype.set(f"cartesian{axis}", e.FloatNode(file, 0.0, e.E57_DOUBLE, e.E57_DOUBLE_MIN, e.E57_DOUBLE_MAX))
        columns[f"cartesian{axis}"] = np.ascontiguousarray(xyz[:, k], np.float64)
    if rgb is not None:
        for k, name in enumerate(("Red", "Green", "Blue")):
            prototype.set(f"color{name}", e.IntegerNode(file, 0, 0, 255))
            columns[f"color{name}"] = np.ascontiguousarray(rgb[:, k], np.float64)
    points = e.CompressedVectorNode(file, prototype, e.VectorNode(file, True))
    scan.set("points", points)
    for name, values in columns.items():
        buffers.append(e.SourceDestBuffer(file, name, values, len(values), True, True))
    writer = points.writer(buffers)
    writer.write(len(xyz))
    writer.close()
    for picture in pictures:
        node, part = e.StructureNode(file), e.StructureNode(file)
        images.append(node)
        node.set("guid", e.StringNode(file, f"{{{picture.name}}}"))
        node.set("name", e.StringNode(file, picture.name))
        if picture.guid:
            node.set("associatedData3DGuid", e.StringNode(file, picture.guid))
        for name, value in picture.more.items():
            node.set(name, e.FloatNode(file, value))
        if picture.quaternion is not None:
            pose = e.StructureNode(file)
            node.set("pose", pose)
            for name, keys, values in (("rotation", "wxyz", picture.quaternion), ("translation", "xyz", picture.translation)):
                child = e.StructureNode(file)
                pose.set(name, child)
                for key, value in zip(keys, values, strict=True):
                    child.set(key, e.FloatNode(file, float(value)))
        node.set(f"{picture.kind}Representation", part)
        for name, value in picture.values.items():
            part.set(name, e.IntegerNode(file, value) if isinstance(value, int) else e.FloatNode(file, value))
        for name, content in picture.blobs.items():
            blob = e.BlobNode(file, len(content))
            part.set(name, blob)
            blob.write(np.frombuffer(content, np.uint8).copy(), 0, len(content))
    file.close()
    return path


def paint(at: np.ndarray) -> np.ndarray:
    """(..., 3) room coordinates -> (..., 3) uint8 colour of the wall there: nowhere the same, smooth but for a checker."""
    smooth = 120 + 60 * np.sin(at * (2.1, 2.9, 3.7) + (0.3, 1.1, 2.0)) + 25 * np.roll(at, 1, -1)
    return np.clip(smooth + 30 * (np.floor(at * 3 + 0.13).sum(-1) % 2)[..., None], 0, 255).astype(np.uint8)


def patches(at: np.ndarray) -> np.ndarray:
    """(..., 3) room coordinates -> (..., 3) uint8: patches, nowhere alike (random Voronoi cells)."""
    from scipy.spatial import KDTree

    rng = np.random.default_rng(7)
    seeds = hit(np.zeros(3), rng.normal(size=(3000, 3)))
    return rng.integers(20, 235, (3000, 3)).astype(np.uint8)[KDTree(seeds).query(at)[1]]


def hit(position: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """Where rays from inside the room meet its walls, room coordinates."""
    with np.errstate(divide="ignore"):
        t = np.where(ray > 0, (BOX - position) / ray, (-BOX - position) / ray).min(-1)
    return position + ray * t[..., None]


def projected(photo, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (n, 2), column and row, of points (n, 3) in a PosedPhotograph, and which it shows: plain NumPy of the standard."""
    x, y, z = ((np.asarray(points, np.float64) - photo.position) @ photo.camera_to_world[:3, :3]).T
    fx, fy, cx, cy = photo.lens
    with np.errstate(divide="ignore", invalid="ignore"):
        if photo.kind == "pinhole":
            column, row, seen = cx - x / z * fx, cy + y / z * fy, z < 0
        else:
            flat = np.hypot(x, y)
            rise = np.arctan2(z, flat) if photo.kind == "spherical" else z / flat
            column, row, seen = cx - np.arctan2(y, x) * fx, cy - rise * fy, flat + np.abs(z) > 0
    if photo.around:
        column = np.mod(column, photo.width)
    seen = seen & (column >= 0) & (column <= photo.width) & (row >= 0) & (row <= photo.height)
    return np.stack([column, row], axis=1), seen


def room_points(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """xyz (count, 3), in file coordinates, and rgb of points on the room's walls."""
    ray = np.random.default_rng(seed).normal(size=(count, 3))
    at = hit(np.zeros(3), ray)
    return at + AWAY, paint(at)


def turn(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> tuple[np.ndarray, tuple]:
    """(3, 3) camera-to-world of a camera looking level along +x, turned; and its quaternion w, x, y, z."""
    from scipy.spatial.transform import Rotation

    level = Rotation.from_matrix(np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]]))  # right -y, up z, forward x
    rotation = Rotation.from_euler("ZYX", [yaw, -pitch, roll]) * level
    x, y, z, w = rotation.as_quat()
    return rotation.as_matrix(), (w, x, y, z)


def encoded(picture: np.ndarray, kind: str = "png") -> bytes:
    out = io.BytesIO()
    Image.fromarray(picture).save(out, "jpeg" if kind == "jpeg" else "png", **({"quality": 95} if kind == "jpeg" else {}))
    return out.getvalue()


def pinhole(position, yaw: float, pitch: float = 0.0, *, roll: float = 0.0, size=(96, 72), fl: float = 60.0, offset=(0.0, 0.0),
            coding="png", name="photo", gain=1.0, **changes) -> Picture:  # fmt: skip
    """A photograph of the room, exact at pixel centres."""
    width, height = size
    matrix, quaternion = turn(yaw, pitch, roll)
    cx, cy = width / 2 + offset[0], height / 2 + offset[1]
    i, j = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    ray = np.stack([(i - cx) / fl, (cy - j) / fl, -np.ones_like(i)], -1) @ matrix.T
    seen = np.clip(paint(hit(np.asarray(position, float), ray)) * gain, 0, 255).astype(np.uint8)
    values = {"imageWidth": width, "imageHeight": height,
              "focalLength": 0.02, "pixelWidth": 0.02 / fl, "pixelHeight": 0.02 / fl,
              "principalPointX": cx, "principalPointY": cy}  # fmt: skip
    made = Picture(values=values, blobs={"jpegImage" if coding == "jpeg" else "pngImage": encoded(seen, coding)},
                   quaternion=quaternion, translation=tuple(np.asarray(position) + AWAY), name=name)  # fmt: skip
    for key, value in changes.items():
        setattr(made, key, value)
    return made


def panorama(position, yaw: float, width: int = 512, name="round") -> Picture:
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("ZYX", [yaw, 0.1, -0.05])
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(width // 2) + 0.5)
    azimuth, elevation = (width / 2 - column) * 2 * np.pi / width, (width / 4 - row) * 2 * np.pi / width
    ray = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)
    seen = paint(hit(np.asarray(position, float), ray @ rotation.as_matrix().T))
    x, y, z, w = rotation.as_quat()
    pitch = 2 * np.pi / width
    values = {"imageWidth": width, "imageHeight": width // 2, "pixelWidth": pitch, "pixelHeight": pitch}
    return Picture("spherical", values, {"pngImage": encoded(seen)}, (w, x, y, z), tuple(np.asarray(position) + AWAY), name)
