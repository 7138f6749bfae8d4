"""Open3D's point rendering, for comparison: its visualiser, with a hidden window, in a child process.

Open3D renders with OpenGL, may crash without it, and prints to stdout.  It therefore runs in a child process, which receives
points in the camera frame (x right, y down, z forward) and returns pictures, or ends with an error message.  This file is also
the child's program and imports no other module of the project.
"""

import contextlib
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import IO

import numpy as np

POINT_SIZES = (1.0, 5.0)
"""Pixels: as in the viewer, and Open3D's default."""
SECONDS = 120.0
"""Time limit of the start, and of a picture: a guard against a child that never answers."""


class Open3DError(Exception):
    """Open3D cannot render on this machine; the message gives the reason."""


def _send(pipe: IO[bytes], array: np.ndarray) -> None:
    """Writes an array: a line with its type and shape, then its bytes."""
    pipe.write(f"{array.dtype.str} {' '.join(map(str, array.shape))}\n".encode())
    pipe.write(np.ascontiguousarray(array).tobytes())
    pipe.flush()


def _receive(pipe: IO[bytes]) -> np.ndarray:
    """Reads an array of :func:`_send`.  Raises EOFError if the other process has ended."""
    kind, *shape = pipe.readline().decode().split() or [""]
    if not kind:
        raise EOFError
    shape = tuple(map(int, shape))
    content = pipe.read(int(np.prod(shape)) * np.dtype(kind).itemsize)
    if len(content) < int(np.prod(shape)) * np.dtype(kind).itemsize:
        raise EOFError
    return np.frombuffer(content, kind).reshape(shape)


class Open3DPoints:
    """A child process that renders with Open3D.  Raises Open3DError if it cannot; release with :meth:`close`."""

    def __init__(self):
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  # open as long as the child runs
        environment = {**os.environ, "PYTHONWARNINGS": "ignore"}
        self._child = subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve())], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=self._errors, env=environment,
        )
        try:
            point = np.array([[0, 0, 1]], np.float32)
            self.draw(point, np.full((1, 3), 255, np.uint8), (16, 16), 8.0, SECONDS)
        except Open3DError:
            self.close()
            raise

    def draw(self, xyz: np.ndarray, rgb: np.ndarray, size: tuple[int, int], focal: float,
             seconds: float = SECONDS) -> tuple[list[np.ndarray], list[float]]:
        """Pictures (H, W, 3) uint8, one per point size, and the milliseconds of each without the upload of the points.

        xyz: (N, 3) float32, camera frame.  rgb: (N, 3) uint8.  size: (width, height), pixels.  focal: pixels.  The principal
        point is the centre of the picture, as Open3D ignores any other.  Raises Open3DError.
        """
        child = self._child
        assert child.stdin is not None and child.stdout is not None
        watchdog = threading.Timer(seconds, child.kill)
        watchdog.start()
        try:
            for array in (np.array([*size, focal], np.float64), xyz.astype(np.float32, copy=False), rgb):
                _send(child.stdin, array)
            pictures, spent = _receive(child.stdout), _receive(child.stdout)
        except (OSError, EOFError):
            raise Open3DError(self._reason(seconds)) from None
        finally:
            watchdog.cancel()
        return list(pictures), spent.tolist()

    def _reason(self, seconds: float) -> str:
        """The last line of the child's stderr, or its exit status."""
        code = self._child.wait(timeout=30)
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        if code == -9:
            return f"Open3D did not render a picture within {seconds:.0f} s"
        return lines[-1].strip() if lines and code > 0 else f"Open3D's process ended with exit status {code}"

    def close(self) -> None:
        """Ends the child process."""
        for stream in (self._child.stdin, self._child.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._child.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
        self._errors.close()


class _Window:
    """Open3D's visualiser at one picture size; the window is kept while the points are replaced."""

    def __init__(self, width: int, height: int):
        import open3d

        self.o3d, self.width, self.height = open3d, width, height
        self.view = open3d.visualization.Visualizer()
        if not self.view.create_window(width=width, height=height, visible=False):
            raise SystemExit("Open3D cannot open a hidden OpenGL window")

    def draw(self, xyz: np.ndarray, rgb: np.ndarray, focal: float) -> tuple[np.ndarray, np.ndarray]:
        o3d, view = self.o3d, self.view
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz.astype(np.float64)))
        cloud.colors = o3d.utility.Vector3dVector(rgb / 255.0)
        view.clear_geometries()
        view.add_geometry(cloud)
        option = view.get_render_option()
        option.background_color, option.light_on = np.zeros(3), False
        parameters = o3d.camera.PinholeCameraParameters()
        middle = self.width / 2 - 0.5, self.height / 2 - 0.5  # pixel centres are integers in Open3D
        parameters.intrinsic = o3d.camera.PinholeCameraIntrinsic(self.width, self.height, focal, focal, *middle)
        parameters.extrinsic = np.eye(4)
        if not view.get_view_control().convert_from_pinhole_camera_parameters(parameters, True):
            raise SystemExit("Open3D rejected the camera")
        control = view.get_view_control()
        control.set_constant_z_near(max(1e-3, float(xyz[:, 2].min()) * 0.9))
        control.set_constant_z_far(float(xyz[:, 2].max()) * 1.1)
        pictures, spent = [], []
        for size in POINT_SIZES:
            option.point_size = size
            if not pictures:
                view.capture_screen_float_buffer(True)  # uploads the points
            start = time.perf_counter()
            shown = np.asarray(view.capture_screen_float_buffer(True))
            spent.append(1000 * (time.perf_counter() - start))
            if shown.shape != (self.height, self.width, 3):
                raise SystemExit(f"Open3D drew {shown.shape[1]}x{shown.shape[0]} pixels, not {self.width}x{self.height}")
            pictures.append(np.rint(shown * 255).astype(np.uint8))
        return np.stack(pictures), np.array(spent)


def _serve(requests: IO[bytes], answers: IO[bytes]) -> None:
    window = None
    while True:
        try:
            width, height, focal = _receive(requests).tolist()
        except EOFError:
            return
        xyz, rgb = _receive(requests), _receive(requests)
        if window is None or (window.width, window.height) != (width, height):
            if window is not None:
                window.view.destroy_window()
            window = _Window(int(width), int(height))
        for array in window.draw(xyz, rgb, focal):
            _send(answers, array)


if __name__ == "__main__":
    private = os.dup(1)
    os.dup2(2, 1)  # so that output of Open3D does not mix with the pictures
    try:
        _serve(sys.stdin.buffer, os.fdopen(private, "wb"))
    except ImportError as error:
        sys.exit(f"Open3D is not installed ({error}); it is one of the `dev` dependencies")
