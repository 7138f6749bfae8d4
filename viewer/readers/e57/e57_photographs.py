"""The photographs inside an E57 as they were taken, to be shown in place: pinhole, spherical and cylindrical.

:mod:`viewer.readers.e57.e57_images` has the same pictures as pinhole cameras only, for training.  World frame: the file's own,
metres.  ``camera_to_world`` takes the photograph's own frame (ASTM E2807) to it: pinhole looks along -z with y up; spherical
and cylindrical have z up, azimuth counterclockwise from x.  A pixel spans [i, i + 1], row 0 at the top:

- pinhole: ``column = cx - x / z * fx``, ``row = cy + y / z * fy``, where z < 0;
- spherical: ``column = cx - azimuth * fx``, ``row = cy - elevation * fy``, with fx and fy in pixels per radian;
- cylindrical: ``column = cx - azimuth * fx``, ``row = cy - z / hypot(x, y) * fy``, with fy = radius / pixelHeight.
"""

from functools import partial
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...picture.camera import Camera
from ..formats import check_file
from ..photographs.posed_photograph import Lens, PosedPhotograph
from .e57_images import decoded, listed_photographs, number_of, structures
from .e57_nodes import first_line, library, open_e57, text_of

KINDS = ("pinhole", "spherical", "cylindrical")
LONGEST = 4096
"""Pixels of a photograph's longer side as it is kept; larger ones are averaged down."""


def pinhole_cameras(path: Path) -> tuple[dict[int, Camera], dict[int, int], int]:
    """By place in images2D the camera of each pinhole photograph with a pose, without decoding it, and the scan of each
    photograph that names one; and how many scans the file has.  A photograph whose numbers are impossible has no camera."""
    check_file(path)
    with open_e57(path) as file:
        root = file.root()
        cameras: dict[int, Camera] = {}
        for entry in listed_photographs(path, root, ("pinhole",))[0]:
            try:
                width, height = int(number_of(entry, "imageWidth")), int(number_of(entry, "imageHeight"))
                cameras[entry.number] = Camera(width, height, *_lens(entry, width, height), entry.pose)
            except (InputError, library().E57Exception):
                continue
        scans = {text_of(scan, "guid") or None: number for number, scan in enumerate(structures(root, "data3D"))}
        named = [scans.get(text_of(image, "associatedData3DGuid")) for image in structures(root, "images2D")]
        return cameras, {number: scan for number, scan in enumerate(named) if scan is not None}, len(scans)


def _lens(entry, width: float, height: float) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of a pinhole photograph.  Raises InputError where they are impossible."""
    focal = number_of(entry, "focalLength")
    fx, fy = focal / number_of(entry, "pixelWidth"), focal / number_of(entry, "pixelHeight")
    if not (0.02 * width < fx < 200 * width and 0.02 * height < fy < 200 * height):
        raise InputError(f"{entry.label}: a focal length of {fx:g} x {fy:g} pixels", remedy="export it again")
    cx, cy = (number_of(entry, f"principalPoint{axis}", positive=False) for axis in "XY")
    return fx, fy, cx, cy


def _geometry(entry) -> tuple[float, float, Lens, bool]:
    """Width and height in pixels, lens, and whether the columns close a circle.  Raises InputError where they are
    impossible."""
    width, height = number_of(entry, "imageWidth"), number_of(entry, "imageHeight")
    pitch_x, pitch_y = number_of(entry, "pixelWidth"), number_of(entry, "pixelHeight")
    cx, cy = width / 2, height / 2
    if entry.kind == "pinhole":
        fx, fy, cx, cy = _lens(entry, width, height)
    else:
        if entry.kind == "spherical" and width == 2 * height and max(width * pitch_x, height * pitch_y) < 0.1:
            pitch_x = pitch_y = 2 * np.pi / width  # impossible pixels of a whole sphere, as in viewer.readers.e57.e57_images
        fx, fy = 1 / pitch_x, 1 / pitch_y
        if entry.kind == "cylindrical":
            fy *= number_of(entry, "radius")
            cy = number_of(entry, "principalPointY", positive=False)
        if width / fx > 2 * np.pi * 1.001 or (entry.kind == "spherical" and height / fy > np.pi * 1.001):
            raise InputError(f"{entry.label} spans {np.degrees(width / fx):.4g} degrees", remedy="export it again")
    return width, height, (fx, fy, cx, cy), entry.kind != "pinhole" and width / fx > 2 * np.pi * 0.999


def _decoded(entry, width: float, height: float, longest: int) -> tuple[np.ndarray, np.ndarray | None, tuple[float, float]]:
    """The picture, where it holds anything, and the scale of both axes."""
    share = min(1.0, longest / max(width, height))
    scale = max(1, round(width * share)) / width, max(1, round(height * share)) / height
    return *decoded(entry, scale), scale


def posed_photographs(path: Path) -> tuple[list[PosedPhotograph], list[str]]:
    """The photographs of an E57 that have a geometry and a pose, not decoded, and warnings about the others."""
    check_file(path)
    with open_e57(path) as file:
        entries, warnings = listed_photographs(path, file.root(), KINDS)
        found = []
        for entry in entries:
            try:
                width, height, lens, around = _geometry(entry)
            except (InputError, library().E57Exception) as error:
                warnings.append(f"{first_line(error) if not isinstance(error, InputError) else error}; skipped")
                continue
            found.append(PosedPhotograph(entry.label, entry.kind, int(width), int(height), lens, around, entry.pose,
                                         partial(_decode, path, entry.number), entry.name, entry.number))
    return found, warnings


def _decode(path: Path, number: int, longest: int) -> tuple[np.ndarray, np.ndarray | None]:
    """The picture of images2D[number], and where it holds anything."""
    check_file(path)
    with open_e57(path) as file:
        for entry in listed_photographs(path, file.root(), KINDS)[0]:
            if entry.number == number:
                try:
                    width, height, _, _ = _geometry(entry)
                    return _decoded(entry, width, height, longest)[:2]
                except library().E57Exception as error:
                    raise InputError(f"{entry.label}: {first_line(error)}", remedy="copy or export it again") from None
    raise InputError(f"photograph {number + 1} is not there any more", file=path, remedy="open the scan again")
