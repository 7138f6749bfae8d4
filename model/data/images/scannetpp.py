"""ScanNet++ (Yeshwanth et al. 2023), versions 1 and 2: laser scans with registered photographs.

The root folder contains ``splits/*.txt`` and ``data/<scene>/`` with ``scans/pc_aligned.ply`` (or the mesh), ``dslr/`` (fisheye
photographs in ``resized_images``, masks in ``resized_anon_masks``) and ``iphone/`` (video frames in ``rgb``, extracted by the
data set's toolkit, 1920x1440: the paper's larger size).  Poses are read from ``colmap/``, which is aligned with the scan, or
else from ``nerfstudio/transforms.json``, whose world has x and y swapped and z negated.

World frame: that of the scan, metres, z up.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import DataError
from ..dataset import MergedScan, reason
from ..surfaces.coloured_mesh import check_mesh, points_scan, read_mesh, scattered_scan
from .lens import Lens
from .photo_place import PhotoPlace
from .photos import Photograph, check_pictures

SPLITS = {"train": "nvs_sem_train", "val": "nvs_sem_val", "test": "nvs_test"}
TO_OPENGL = np.diag((1.0, -1.0, -1.0, 1.0))
"""OpenCV to OpenGL camera axes."""
FROM_NERFSTUDIO = np.array([[0.0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
"""nerfstudio's world to the scan's; its own inverse."""


@dataclass(frozen=True)
class _Camera:
    """Subfolders of a camera's pictures and masks, and the remedy where pictures are missing."""

    pictures: str
    masks: str
    remedy: str


CAMERAS = {
    "dslr": _Camera("resized_images", "resized_anon_masks", "download the scene's DSLR pictures"),
    "iphone": _Camera("rgb", "rgb_masks", "extract them with the toolkit: python -m iphone.prepare_iphone_data"),
}


def scenes(root: Path, split: str) -> list[str]:
    """Scene names of a split: train, val, test, or the name of a file in ``splits/``.  Raises DataError."""
    folder = Path(root) / "splits"
    path = folder / f"{SPLITS.get(split, split)}.txt"
    if not path.is_file():
        there = ", ".join(sorted(p.stem for p in folder.glob("*.txt"))) or "none"
        raise DataError(f"no such split; found: {there}", file=path)
    try:
        return [line.strip() for line in path.read_text().splitlines() if line.strip()]
    except ValueError as error:
        raise DataError(f"not a list of scenes ({error})", file=path, remedy="download it again") from None


def load_scannetpp(root: Path, scene: str, camera: str = "dslr", *, part: str = "all", every: int = 1,
                   surface: str = "points", mesh_points: int = 10_000_000) -> PhotoPlace:
    """A scene's scan and photographs.

    camera: dslr or iphone.  part: all, train or test pictures (of the DSLR; some scenes' test pictures are not published).
    every: uses one picture in this many.  surface: ``points``, or ``mesh`` to sample ``mesh_points`` on the mesh instead.
    Raises DataError, before any training, naming the first ten files that are missing, unreadable or of another size.
    """
    if camera not in CAMERAS or part not in ("all", "train", "test") or surface not in ("points", "mesh") or every < 1:
        raise DataError(f"camera {camera!r}, part {part!r}, surface {surface!r}, every {every}: expected dslr or iphone; "
                        "all, train or test; points or mesh; 1 or more")
    home = Path(root) / "data" / scene
    if not home.is_dir():
        raise DataError(f"no such scene; {root} should be the folder with data/ and splits/", file=home)
    cloud = home / "scans" / ("pc_aligned.ply" if surface == "points" else "mesh_aligned_0.05.ply")
    if not cloud.is_file():
        other = home / "scans" / "mesh_aligned_0.05.ply"
        hint = "; its mesh exists: choose surface='mesh'" if surface == "points" and other.is_file() else ""
        raise DataError("missing", file=cloud, remedy=f"download the scene's scan{hint}")
    check_mesh(cloud)
    photographs = _photographs(home, camera, part)[::every]
    if not photographs:
        raise DataError(f"no {part} pictures with a pose", file=home / camera)
    check_pictures(home, [(path, (p.width, p.height)) for p in photographs for path in (p.path, p.mask) if path])
    hidden = cloud.with_name(f"{cloud.stem}_mask.txt")  # indices of anonymised points
    load: Callable[[], MergedScan] = (
        (lambda: points_scan(read_mesh(cloud), hidden)) if surface == "points"
        else (lambda: scattered_scan(read_mesh(cloud), mesh_points))
    )
    return PhotoPlace(f"{scene}/{camera}", load, photographs)


def _photographs(home: Path, camera: str, part: str) -> list[Photograph]:
    folder, kind = home / camera, CAMERAS[camera]
    pictures = folder / kind.pictures
    if not pictures.is_dir():
        raise DataError(f"no pictures; {kind.remedy}", file=pictures)
    facts = _json(folder / "nerfstudio" / "transforms.json")
    shots, held_out = (_list(folder / "nerfstudio" / "transforms.json", facts, key) for key in ("frames", "test_frames"))
    frames = [*shots, *held_out]
    if not all(isinstance(frame, dict) and isinstance(frame.get("file_path"), str) for frame in frames):
        raise DataError("frames without file_path", file=folder / "nerfstudio/transforms.json", remedy="download it again")
    bad = {Path(f["file_path"]).name for f in frames if f.get("is_bad")}
    lists = _json(folder / "train_test_lists.json")
    named = _list(folder / "train_test_lists.json", lists, "test")
    tests = {str(name) for name in named} or {Path(f["file_path"]).name for f in held_out}
    if part == "test" and not tests:
        raise DataError("neither train_test_lists.json nor transforms.json names test pictures", file=folder,
                        remedy="choose part='all'")
    masked = bool(lists.get("has_masks", facts.get("has_mask", (folder / kind.masks).is_dir())))
    if (folder / "colmap" / "images.txt").is_file():
        posed = read_colmap(folder / "colmap")
    elif frames:
        lens = _nerfstudio_lens(folder / "nerfstudio" / "transforms.json", facts)
        posed = [(Path(f["file_path"]).name, lens, FROM_NERFSTUDIO @ _pose(folder, f)) for f in frames]
    else:
        raise DataError("neither colmap/images.txt nor nerfstudio/transforms.json", file=folder,
                        remedy="download the scene's poses")
    held_back = part == "all" and not any((pictures / name).is_file() for name in tests)  # as in the benchmark's test scenes
    chosen = []
    for name, lens, pose in sorted(posed, key=lambda entry: entry[0]):
        wanted = not (held_back and name in tests) if part == "all" else (name in tests) == (part == "test")
        if wanted and name not in bad:
            mask = folder / kind.masks / f"{Path(name).stem}.png" if masked else None
            chosen.append(Photograph(pictures / name, lens, pose, mask))
    return chosen


def _json(path: Path) -> dict:
    """The JSON object in a file, empty where the file does not exist."""
    if not path.is_file():
        return {}
    try:
        data = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"not JSON ({error})", file=path, remedy="download it again") from None
    if not isinstance(data, dict):
        raise DataError("not a JSON object", file=path, remedy="download it again")
    return data


def _list(path: Path, facts: dict, key: str) -> list:
    """The list under a key of the file's ``facts``, empty where the key is missing."""
    if not isinstance(found := facts.get(key, []), list):
        raise DataError(f"{key} is not a list", file=path, remedy="download it again")
    return found


def _nerfstudio_lens(path: Path, facts: dict) -> Lens:
    model = str(facts.get("camera_model"))
    names = ("k1", "k2", "k3", "k4") if model == "OPENCV_FISHEYE" else ("k1", "k2", "p1", "p2") if model == "OPENCV" else ()
    try:
        values = [float(facts[key]) for key in ("fl_x", "fl_y", "cx", "cy")] + [float(facts.get(k, 0.0)) for k in names]
        return Lens.colmap(str(path), model, int(facts["w"]), int(facts["h"]), values)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise DataError(f"has no valid camera ({reason(error)})", file=path, remedy="download it again") from None


def _pose(folder: Path, frame: dict) -> np.ndarray:
    try:
        return np.asarray(frame["transform_matrix"], np.float64).reshape(4, 4)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        where = f"{folder / 'nerfstudio/transforms.json'}: {frame.get('file_path')}"
        raise DataError(f"{where}: no pose ({reason(error)})") from None


def read_colmap(folder: Path) -> list[tuple[str, Lens, np.ndarray]]:
    """Name without folder, lens and camera_to_world (OpenGL axes) of every picture of a COLMAP text model.

    Raises DataError naming the first invalid line.
    """
    lenses: dict[str, Lens] = {}
    for number, words in _rows(folder / "cameras.txt"):
        where = f"{folder / 'cameras.txt'}: line {number}"
        if not words:
            continue
        try:
            lenses[words[0]] = Lens.colmap(where, words[1], int(words[2]), int(words[3]), [float(w) for w in words[4:]])
        except (IndexError, ValueError):
            raise DataError(f"{where}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS, got {' '.join(words)[:80]!r}") from None
    posed = []
    rows = iter(_rows(folder / "images.txt"))
    for number, words in rows:
        if not words:
            continue
        where = f"{folder / 'images.txt'}: line {number}"
        try:
            w, x, y, z, *shift = (float(word) for word in words[1:8])
            lens, name = lenses[words[8]], " ".join(words[9:])
        except KeyError:
            raise DataError(f"{where}: camera {words[8]!r} is not in cameras.txt") from None
        except (IndexError, ValueError):
            raise DataError(f"{where}: expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, got {words[:10]}") from None
        norm = w * w + x * x + y * y + z * z
        if not name or not np.isfinite(shift).all() or not np.isfinite(norm) or norm < 0.5:
            raise DataError(f"{where}: no pose or no name: {words[:10]}")
        camera_to_world = np.eye(4)
        camera_to_world[:3, :3] = quaternion(w, x, y, z).T
        camera_to_world[:3, 3] = -camera_to_world[:3, :3] @ shift
        posed.append((Path(name).name, lens, camera_to_world @ TO_OPENGL))
        points = next(rows, (0, []))[1]  # the picture's points, as triples
        if len(points) % 3 or (points and not points[-1].lstrip("-").isdigit()):
            raise DataError(f"{where}: the next line should list the picture's points (it may be empty)")
    return posed


def quaternion(w: float, x: float, y: float, z: float) -> np.ndarray:
    """(3, 3) rotation matrix of a quaternion of any non-zero length."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat((x, y, z, w)).as_matrix()


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and words of all lines except comments, including empty lines."""
    try:
        if not path.is_file():  # reading a pipe would block
            raise ValueError("no such file")
        lines = path.read_text().splitlines()
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read ({error})", file=path, remedy="download it again") from None
    return [(number, line.split()) for number, line in enumerate(lines, 1) if not line.startswith("#")]
