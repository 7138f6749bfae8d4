"""What the program does with a file, as a child process of the fuzzer does it: the whole way, as ``info``, ``convert`` and the
window go it.  Anything but success or a PointglassError in one line is a failure."""

import io
import logging
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np

from pointglass.viewer.common.errors import InputError, PointglassError

LONGEST_LINE = 2000
"""Characters of a message; viewer.cli shortens what is longer than 1500."""


class Wrong(Exception):
    """A promise is broken though nothing was raised."""


def exercise(kind: str, path: Path, depth: int) -> str:
    """Does everything with ``path`` that its kind says; returns "read", or the line with which it was refused.

    depth: a whole number; every fourth value takes the longer way, through the command line.
    Raises what the program should not have raised, and Wrong.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for ignored in (DeprecationWarning, PendingDeprecationWarning, ResourceWarning, ImportWarning):
                warnings.simplefilter("ignore", ignored)
            KINDS[kind](path, depth)
    except PointglassError as error:
        return _checked(error)
    return "read"


def _checked(error: PointglassError) -> str:
    line = str(error)
    if not line.strip():
        raise Wrong("the message is empty")
    if len(line.splitlines()) != 1 or len(line) > 100_000:
        raise Wrong(f"the message is no line: {line[:200]!r}")
    return line


def _scan(path: Path, depth: int) -> None:
    from pointglass.viewer.readers.formats import open_source

    source = open_source(path)
    found = source.sample(500, 16)
    if found is not None:
        for chunk in found:
            _check_chunk(chunk)
    count, scans = 0, len(source.scans)
    for chunk in source.chunks():
        _check_chunk(chunk)
        if int(np.max(chunk.scan, initial=0)) >= scans:
            raise Wrong(f"scan {np.max(chunk.scan)} of {scans}")
        count += len(chunk.xyz)
    if depth % 2 == 0 and count:
        for records in source.record_chunks():
            if not all(len(values) == len(records.xyz) for values in records.columns.values()):
                raise Wrong("columns of different lengths")
        numbers = np.unique(np.array([0, count // 2, count - 1], np.int64))
        if len(source.records(numbers).xyz) != len(numbers):
            raise Wrong("records are missing")
    if path.suffix == ".e57" and depth % 2 == 1:
        _photographs(path)
    if depth % 4 == 0:
        _command("info", "--no-cache", str(path))
    if depth % 4 == 2:
        from pointglass.viewer.grid.preview import preview_scene

        preview_scene([path], points=500, least_bytes=0)


def _check_chunk(chunk) -> None:
    n = len(chunk.xyz)
    if chunk.xyz.dtype != np.float64 or chunk.xyz.shape != (n, 3):
        raise Wrong(f"xyz is {chunk.xyz.dtype} {chunk.xyz.shape}")
    if chunk.rgb is not None and (chunk.rgb.shape != (n, 3) or chunk.rgb.dtype not in (np.uint8, np.uint16)):
        raise Wrong(f"rgb is {chunk.rgb.dtype} {chunk.rgb.shape}")
    for values in (chunk.intensity, chunk.classification, chunk.station):
        if values is not None and len(values) != n:
            raise Wrong(f"{len(values)} values of {n} points")


def _photographs(path: Path) -> None:
    from pointglass.viewer.readers.e57.e57_images import read_photographs
    from pointglass.viewer.readers.e57.e57_photographs import posed_photographs

    found, warnings = posed_photographs(path)
    for line in [*warnings, *read_photographs(path, longest=64)[1]]:
        if "\n" in line:
            raise Wrong(f"a warning of several lines: {line[:200]!r}")
    for photo in found:
        photo.decode(64)


def _grid(path: Path, depth: int) -> None:
    from pointglass.viewer.grid import cache
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.grid.records.file_records import FileRecords
    from pointglass.viewer.grid.scene import CHUNK
    from pointglass.viewer.stream.chunk_source import ChunkSource

    if depth % 4 == 0:
        _command("info", "--json", str(path))
    cache.load(path, [])
    scene = open_scene(path)
    source = ChunkSource(scene)
    try:
        into = np.empty((CHUNK, 3), np.uint32)
        for chunk in range(source.chunks):
            source.read(chunk, into)
    finally:
        source.close()
    if depth % 4 == 1 and scene.count:
        values = FileRecords(scene).of(np.array([0, scene.count - 1]))
        if len(values.xyz) != 2 or len(values.station) != 2:
            raise Wrong("values are missing")


def _cameras(path: Path, depth: int) -> None:
    from pointglass.viewer.commands.film.command import read_path
    from pointglass.viewer.work.cameras.camera_files import read_cameras

    for camera in read_cameras(path, size=(64, 48) if depth % 3 == 0 else None):
        _check_name(camera.name)
        if not np.isfinite(camera.camera_to_world).all():
            raise Wrong("a camera that is not finite")
    if path.is_file():
        read_path(path, size=(64, 48))


def _check_name(name: str) -> None:
    """A name of a file that leads nowhere else."""
    if not name or name != Path(name).name or name.startswith(".") or not name.isprintable() or len(name.encode()) > 200:
        raise Wrong(f"name {name!r} is no name of a file")


def _like(path: Path, depth: int) -> None:
    from pointglass.viewer.common.file_names import safe_name
    from pointglass.viewer.work.pictures.shot_metadata import camera_line, parse_camera_line, read_shot

    shot = read_shot(path)
    _check_name(safe_name(shot.spec.camera.name, "picture"))
    shot.text()
    parse_camera_line(camera_line(shot.spec.camera))


def _project(path: Path, depth: int) -> None:
    from pointglass.viewer.work.project import read_project, scans_of

    if depth % 4 == 0:
        _command("info", "--no-cache", str(path))
    document = read_project(path)
    scans_of(path, document)


def _preferences(path: Path, depth: int) -> None:
    from pointglass.viewer.window.session.preferences import read_preferences

    _in_state_folder(path, read_preferences)


def _recent(path: Path, depth: int) -> None:
    from pointglass.viewer.window.session import recent

    def run() -> None:
        for scan in recent.recent_scans():
            _ = scan.missing
            recent.load_thumbnail(scan)
            (path / scan.thumbnail.name).unlink(missing_ok=True)
            if (path / "thumbnail.png").exists():
                (path / scan.thumbnail.name).write_bytes((path / "thumbnail.png").read_bytes())
                recent.load_thumbnail(scan)
                scan.thumbnail.unlink()

    _in_state_folder(path, run)


def _in_state_folder(path: Path, run: Callable[[], object]) -> None:
    """State never stops the window: whatever is raised is a failure."""
    import os

    os.environ["POINTGLASS_STATE"] = str(path)
    try:
        run()
    except PointglassError as error:
        raise Wrong(f"the window would not open: {error}") from None


def _unsaved(path: Path, depth: int) -> None:
    from pointglass.viewer.window.session.autosave import read_unsaved

    read_unsaved(path)


def _film(path: Path, depth: int) -> None:
    from pointglass.viewer.commands.film import encode

    encode._read(path)


def _weights(path: Path, depth: int) -> None:
    from pointglass.model.network.weights import load_weights

    load_weights(path)


def _room(path: Path, depth: int) -> None:
    from pointglass.model.data.stations import load_scene

    load_scene(path)


def _rgbd(path: Path, depth: int) -> None:
    from pointglass.model.data.images.rgbd import load_rgbd

    load_rgbd(path)


def _mesh(path: Path, depth: int) -> None:
    from pointglass.viewer.readers.meshes.mesh_file import read_mesh

    mesh = read_mesh(path)
    if not (np.isfinite(mesh.vertices).all() and np.isfinite(mesh.normals).all()):
        raise Wrong("a number is not finite")
    if not (len(mesh.faces) and int(mesh.faces.min()) >= 0 and int(mesh.faces.max()) < len(mesh.vertices)):
        raise Wrong("a face names no vertex")
    pictures = mesh.textures
    if len(pictures.of_face) and (len(pictures.of_face) != len(mesh.faces) or pictures.of_face.max() >= len(pictures.levels)):
        raise Wrong("a face names no picture")
    if depth % 4 == 1:
        from pointglass.viewer.work.sheets.mesh_cut import cut_segments, joined_lines, tolerance_of

        middle = float((mesh.bounds[0, 2] + mesh.bounds[1, 2]) / 2)
        joined_lines(cut_segments(mesh.vertices, mesh.faces, middle), tolerance_of(mesh.vertices))


def _command(*arguments: str) -> None:
    """Runs a command in this process: exit code 0, or 2 and one line; nothing else on standard error but warnings."""
    from pointglass.viewer.cli import main

    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = main(list(arguments))
    said = err.getvalue()
    lines = [line for line in said.splitlines() if not line.startswith(("pointglass: warning: ", "pointglass: compiling "))]
    if code not in (0, 2) or (len(lines) != 1 if code == 2 else lines):
        raise Wrong(f"exit code {code}, standard error: {said[:300]!r}")
    for line in [*said.split("\n"), *out.getvalue().split("\n")]:
        if not line.isprintable():
            raise Wrong(f"unprintable: {line[:300]!r}")
        if len(line) > LONGEST_LINE and line in lines:
            raise Wrong(f"{len(line)} characters in a line")
    if code == 2:
        raise InputError(lines[0])


KINDS: dict[str, Callable[[Path, int], None]] = {
    "scan": _scan, "grid": _grid, "cameras": _cameras, "like": _like, "project": _project, "preferences": _preferences,
    "recent": _recent, "film": _film, "unsaved": _unsaved, "weights": _weights, "room": _room, "rgbd": _rgbd,
    "mesh": _mesh,
}  # fmt: skip


def prepare() -> None:
    """Keeps the log quiet: commands show it, and other ways have no terminal."""
    logging.getLogger("pointglass").addHandler(logging.NullHandler())
    logging.getLogger("pointglass").propagate = False
