"""The photographs inside an E57 (/images2D): pictures with their cameras; a panorama as the six faces of a cube.

World frame: the file's own, metres, the one :mod:`viewer.readers.e57.e57_source` yields points in.  Cameras are OpenGL's (x
right, y up, looking along -z), pinhole, square pixels, a pixel spanning [i, i + 1], row 0 at the top.

That is the standard's own pinhole frame (ASTM E2807): the pose takes camera to file coordinates, the picture lies in the
plane z = -focalLength, and with the principal point (px, py)
``column = px - x / z * focalLength / pixelWidth``, ``row = py + y / z * focalLength / pixelHeight``.
Spherical pictures have z up: ``column = W / 2 - azimuth / pixelWidth``, ``row = H / 2 - elevation / pixelHeight``, azimuth
counterclockwise from x about z.  Masks are valid where they are not zero.
"""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ..decoded_picture import most_pixels
from ..formats import check_file
from .e57_nodes import child, first_line, library, open_e57, pose_of, text_of, value_of

_LEAST_SPAN = 1e-3  # radians that a panorama spans at least: a millimetre at a distance of a metre
FACES = {
    "front": ((1, 0, 0), (0, 0, 1)), "left": ((0, 1, 0), (0, 0, 1)), "back": ((-1, 0, 0), (0, 0, 1)),
    "right": ((0, -1, 0), (0, 0, 1)), "up": ((0, 0, 1), (-1, 0, 0)), "down": ((0, 0, -1), (1, 0, 0)),
}  # fmt: skip
"""Forward and up of a panorama's cube faces, in the panorama's frame (x front, y left, z up)."""


@dataclass(frozen=True, eq=False)
class Photo:
    """A photograph of a pinhole camera.

    picture: (H, W, 3) uint8 sRGB.  fl, cx, cy: pixels.  camera_to_world: (4, 4) float64.  valid: (H, W) bool, where the
    picture holds anything; None: everywhere.  scan: index of the E57 scan it belongs to, None where the file does not say.
    """

    name: str
    picture: np.ndarray
    fl: float
    cx: float
    cy: float
    camera_to_world: np.ndarray
    valid: np.ndarray | None = None
    scan: int | None = None


def read_photographs(path: Path, *, longest: int = 1024, most: int | None = None) -> tuple[list[Photo], list[str]]:
    """The photographs of ``path`` that have a camera and a pose, and warnings about the others.

    longest: larger pictures are reduced to this many pixels per side, and the camera with them.  most: pictures that are
    decoded at most, picked evenly; a panorama counts as six.
    Raises InputError naming the image where a picture is damaged or its camera is impossible.
    """
    check_file(path)
    photos: list[Photo] = []
    with open_e57(path) as file:
        entries, warnings = listed_photographs(path, file.root())
        weight = np.cumsum([6 if entry.spherical else 1 for entry in entries])
        if most is not None and len(entries) and weight[-1] > most:
            steps = np.floor((weight - 1) * (most / weight[-1]))
            first = np.flatnonzero(np.diff(steps, prepend=-1.0) > 0)
            warnings.append(f"{path.name}: {len(first)} of {len(entries)} photographs are used, evenly picked")
            entries = [entries[i] for i in first]
        for entry in entries:
            try:
                photos += _sphere(entry, longest, warnings) if entry.spherical else [_pinhole(entry, longest)]
            except library().E57Exception as error:
                raise InputError(f"{entry.label}: {first_line(error)}", remedy="copy or export it again") from None
    return photos, warnings


@dataclass(frozen=True, eq=False)
class _Entry:
    """label: file and image, for messages.  node: the representation.  pose: (4, 4) camera -> file.  number: in images2D."""

    label: str
    name: str
    kind: str
    node: object
    pose: np.ndarray
    scan: int | None
    room: int
    number: int

    @property
    def spherical(self) -> bool:
        return self.kind == "spherical"


def listed_photographs(path: Path, root, read: tuple[str, ...] = ("pinhole", "spherical")) -> tuple[list[_Entry], list[str]]:
    """The images of images2D with one of the geometries ``read``, and a warning for every other image."""
    entries, warnings = [], []
    scans = {text_of(scan, "guid") or None: number for number, scan in enumerate(structures(root, "data3D"))}
    for number, image in enumerate(structures(root, "images2D")):
        name = text_of(image, "name") or f"image {number + 1}"
        label = f"{path}: photograph {name!r}"
        kinds = ("pinhole", "spherical", "cylindrical", "visualReference")
        kind = next((k for k in kinds if child(image, f"{k}Representation", "Structure") is not None), None)
        if kind not in read:
            why = {
                None: "has no representation of the standard", "cylindrical": "is cylindrical, which is not read",
                "visualReference": "is a visual reference without a camera",
            }[kind]  # fmt: skip
            warnings.append(f"{label} {why}; skipped")
            continue
        node = image[f"{kind}Representation"]
        placed = pose_of(image)
        if placed is None:
            warnings.append(f"{label} has no usable pose; skipped")
        elif any("distortion" in part[i].elementName().lower() for part in (image, node) for i in range(part.childCount())):
            warnings.append(f"{label} is stored with its lens distortion, which is not undone; skipped")
        else:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = placed
            scan, room = scans.get(text_of(image, "associatedData3DGuid")), path.stat().st_size
            entries.append(_Entry(label, name, kind, node, pose, scan, room, number))
    return entries, warnings


def structures(root, name: str) -> list:
    """The structures of a vector, in its order; other nodes, which damage may cause, are left out."""
    vector = child(root, name, "Vector")
    nodes = [vector[i] for i in range(len(vector))] if vector is not None else []
    return [node for node in nodes if isinstance(node, library().StructureNode)]


def number_of(entry: _Entry, name: str, *, positive: bool = True) -> float:
    node: object = entry.node
    value = value_of(node[name]) if node.isDefined(name) else None  # type: ignore[attr-defined, index]
    if value is None or not np.isfinite(value) or (positive and value <= 0):
        stated = "no" if value is None else f"a {name} of {value:g} instead of a usable"
        raise InputError(f"{entry.label} has {stated} {name}", remedy="export it again")
    return value


def _bytes(entry: _Entry, name: str) -> io.BytesIO:
    blob = child(entry.node, name, "Blob")
    if blob is None:
        raise InputError(f"{entry.label}: its {name} is not a Blob", remedy="export it again")
    if not 0 < blob.byteCount() <= entry.room:
        raise InputError(f"{entry.label} has a {name} of {blob.byteCount()} bytes", remedy="export it again")
    return io.BytesIO(blob.read_buffer().tobytes())


def _header(entry: _Entry, name: str, data: io.BytesIO):
    """The opened, not yet decoded picture.  Raises InputError where its size is not the declared one, or too large."""
    from PIL import JpegImagePlugin, PngImagePlugin, UnidentifiedImageError

    declared = int(number_of(entry, "imageWidth")), int(number_of(entry, "imageHeight"))
    kinds = {b"\xff\xd8": JpegImagePlugin.JpegImageFile, b"\x89P": PngImagePlugin.PngImageFile}  # some writers swap the tags
    kind = kinds.get(data.getvalue()[:2])
    if kind is None:
        head = data.getvalue()[:4]
        raise InputError(f"{entry.label}: its {name} is neither JPEG nor PNG (first bytes {head!r})", remedy="export it again")
    try:
        image = kind(data)  # the plug-in itself, without Pillow's own limit, which is lower
    except (OSError, SyntaxError, ValueError, UnidentifiedImageError) as error:
        raise InputError(f"{entry.label}: its {name} cannot be decoded ({error})", remedy="export it again") from None
    if image.size[0] * image.size[1] > most_pixels(len(data.getvalue())):
        raise InputError(f"{entry.label}: {image.size[0]}x{image.size[1]} pixels are more than its bytes, or this program, "
                         "can hold", remedy="export it smaller")
    if image.size != declared:
        raise InputError(f"{entry.label}: its {name} has {image.size[0]}x{image.size[1]} pixels, its camera "
                         f"{declared[0]}x{declared[1]}", remedy="export it again")  # fmt: skip
    return image


def decoded(entry: _Entry, scale: tuple[float, float]) -> tuple[np.ndarray, np.ndarray | None]:
    """The picture reduced by ``scale`` (<= 1) from its top left corner, and where it is valid (None: everywhere).

    A last column or row that would not be covered fully is left out: the scale is exact.
    """
    from PIL import Image

    node: object = entry.node
    name = next((n for n in ("jpegImage", "pngImage") if node.isDefined(n)), None)  # type: ignore[attr-defined]
    if name is None:
        raise InputError(f"{entry.label} holds neither a jpegImage nor a pngImage", remedy="export it again")
    image = _header(entry, name, _bytes(entry, name))
    masks = ["imageMask"] if node.isDefined("imageMask") else []  # type: ignore[attr-defined]
    opened = [image, *(_header(entry, n, _bytes(entry, n)) for n in masks)]
    full = image.size
    size = tuple(max(1, int(n * s + 1e-9)) for n, s in zip(full, scale, strict=True))
    parts = []
    for number, (part, what) in enumerate(zip(opened, [name, *masks], strict=True)):
        try:
            if part.format == "JPEG" and min(full) > 1024:
                part.draft("RGB", size)  # decodes only as finely as needed
            if number == 0 and part.mode.startswith(("I", "F")):
                raise ValueError(f"a picture of kind {part.mode}, not 8-bit colour")
            part.load()
        except (OSError, SyntaxError, ValueError, EOFError) as error:
            raise InputError(f"{entry.label}: its {what} cannot be decoded ({error})", remedy="export it again") from None
        alpha = part.getchannel("A") if number == 0 and part.mode in ("RGBA", "LA") else None
        drafted = [1.0 / round(n / m) if m < n else 1.0 for n, m in zip(full, part.size, strict=True)]
        box = (0, 0, *(min(m, n / s * d) for n, s, d, m in zip(size, scale, drafted, part.size, strict=True)))
        kept = [part.convert("RGB")] if number == 0 else [part.convert("L").point(lambda v: 255 * (v > 0))]
        kept += [alpha.point(lambda v: 255 * (v > 0))] if alpha is not None else []
        parts += [np.asarray(p.resize(size, Image.Resampling.BOX, box)) for p in kept]
    valid = np.logical_and.reduce([mask == 255 for mask in parts[1:]]) if len(parts) > 1 else None
    return parts[0], valid


def _pinhole(entry: _Entry, longest: int) -> Photo:
    focal = number_of(entry, "focalLength")
    fx, fy = focal / number_of(entry, "pixelWidth"), focal / number_of(entry, "pixelHeight")
    width, height = number_of(entry, "imageWidth"), number_of(entry, "imageHeight")
    if not (0.02 * width < fx < 200 * width and 0.02 * height < fy < 200 * height):
        raise InputError(f"{entry.label}: a focal length of {fx:g} x {fy:g} pixels", remedy="export it again")
    cx, cy = (number_of(entry, f"principalPoint{axis}", positive=False) for axis in "XY")
    if not (-width <= cx <= 2 * width and -height <= cy <= 2 * height):
        raise InputError(f"{entry.label}: principal point {cx:g}, {cy:g} far outside its picture", remedy="export it again")
    fl = min(fx, fy)  # pixels that are not square are made so
    fl *= min(1.0, longest / max(width * fl / fx, height * fl / fy))
    picture, valid = decoded(entry, (fl / fx, fl / fy))
    return Photo(entry.name, picture, fl, cx * fl / fx, cy * fl / fy, entry.pose, valid, entry.scan)


def _sphere(entry: _Entry, longest: int, warnings: list[str]) -> list[Photo]:
    """The cube faces of a panorama at its resolution, without those that it does not reach."""
    full = np.array([number_of(entry, "imageWidth"), number_of(entry, "imageHeight")])
    pitch = np.array([number_of(entry, "pixelWidth"), number_of(entry, "pixelHeight")])
    with np.errstate(over="ignore"):
        spans = full * pitch
    if full[0] == 2 * full[1] and spans.max() < 0.1:
        warnings.append(f"{entry.label}: its pixels are {pitch[0]:g} rad wide, which cannot be; taken as the whole sphere")
        pitch, spans = np.array([2 * np.pi, np.pi]) / full, np.array([2 * np.pi, np.pi])
    if spans[0] > 2 * np.pi * 1.001 or spans[1] > np.pi * 1.001 or spans.min() < _LEAST_SPAN:
        width, height = np.degrees(spans)
        raise InputError(f"{entry.label} spans {width:.4g} x {height:.4g} degrees", remedy="export it again")
    side = int(min(longest, np.ceil(2 / pitch.max())))
    scale = np.maximum(1, np.rint(full * np.minimum(1.0, pitch * side / 2))) / full  # a face's middle has 2 / side rad a pixel
    picture, valid = decoded(entry, (float(scale[0]), float(scale[1])))
    pitch = pitch / scale
    around = spans[0] > 2 * np.pi * 0.999
    photos = []
    for name, (forward, up) in FACES.items():
        turn = np.stack([np.cross(forward, up), up, -np.array(forward)], 1).astype(np.float64)
        i, j = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
        ray = np.stack([i / (side / 2) - 1, 1 - j / (side / 2), -np.ones_like(i)], -1) @ turn.T
        column = full[0] * scale[0] / 2 - np.arctan2(ray[..., 1], ray[..., 0]) / pitch[0]
        row = full[1] * scale[1] / 2 - np.arctan2(ray[..., 2], np.hypot(ray[..., 0], ray[..., 1])) / pitch[1]
        face, inside = _sampled(picture, valid, column, row, around)
        if inside.any():
            pose = entry.pose.copy()
            pose[:3, :3] = entry.pose[:3, :3] @ turn
            photos.append(Photo(f"{entry.name} {name}", face, side / 2, side / 2, side / 2, pose,
                                None if inside.all() else inside, entry.scan))  # fmt: skip
    return photos


def _sampled(picture: np.ndarray, valid: np.ndarray | None, column: np.ndarray, row: np.ndarray, around: bool):
    """Bilinear samples (H, W, 3) uint8 at pixel positions and where they are valid; around: the columns close a circle."""
    from scipy.ndimage import map_coordinates

    height, width = picture.shape[:2]
    inside = (row > -1e-6) & (row < height + 1e-6)
    if around:
        column = np.mod(column, width)
        picture = np.pad(picture, ((0, 0), (1, 1), (0, 0)), mode="wrap")
    else:
        inside &= (column >= 0) & (column <= width)
        picture = np.pad(picture, ((0, 0), (1, 1), (0, 0)), mode="edge")
    where = np.stack([np.clip(row - 0.5, 0, height - 1), np.clip(column + 0.5, 0, width + 1)])
    face = np.stack([map_coordinates(picture[..., c], where, np.float32, order=1, mode="nearest") for c in range(3)], -1)
    if valid is not None:
        at = np.clip(row.astype(int), 0, height - 1), np.clip(column.astype(int), 0, width - 1)
        inside &= valid[at]
    return np.rint(face).astype(np.uint8), inside
