"""pointglass from Python: open a scan, place a camera, get a picture as a NumPy array.

    >>> import pointglass
    >>> scan = pointglass.open(pointglass.demo_scan())           # or "house.e57", or several files of one place
    >>> scan.count
    1350000
    >>> scan.bounds.shape, scan.stations.shape                   # file coordinates, float64
    ((2, 3), (1, 3))
    >>> every_hundredth = scan.points[::100]                     # nothing is decoded yet
    >>> every_hundredth.xyz.shape, every_hundredth.rgb.dtype
    ((13500, 3), dtype('uint8'))
    >>> camera = pointglass.look_at((4.8, 3.2, 1.5), (3.0, 2.0, 1.2), fov=64, size=(160, 120))
    >>> image = scan.render(camera, view="filled")               # "neural" by default
    >>> image.shape, image.dtype
    ((120, 160, 4), dtype('uint8'))
    >>> frame = scan.render(camera, view="filled", full=True)
    >>> filled = frame.provenance == 3                           # see PROVENANCE
    >>> bool((filled & frame.mask).any()), frame.depth.shape
    (False, (120, 160))
    >>> plan = pointglass.orthographic((3.0, 2.0, 1.0), height=5.0, size=(160, 120))               # 24 pixels a metre
    >>> scan.render(plan, view="filled").shape
    (120, 160, 4)
    >>> scan.close()                                             # or: with pointglass.open(...) as scan:

    >>> mine = pointglass.from_points([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1.0, 0, 0]] * 3)        # arrays of your own
    >>> mine.points.rgb[0]
    array([255,   0,   0], dtype=uint8)

World frame: the scan file's own coordinates and unit of length, right-handed, z up unless a camera says otherwise.
Camera frame of ``camera_to_world``: OpenGL's, x right, y up, the camera looks along -z; its fourth column is the position.
View frame, ``camera.view_rotation``: x right, y down, z forward.
Pixels: row 0 at the top, column 0 at the left; pixel (column i, row j) covers [i, i+1] x [j, j+1], its centre is at +0.5.
A point (x, y, z) of the view frame lies at column ``cx + fx * x / z`` and row ``cy + fy * y / z``; of an orthographic camera
``camera.orthographic`` stands for z in both, and ``camera.unproject`` gives the place seen in a pixel of either.
Depth: z of the view frame, so the distance along the viewing axis, not along the ray; in file units, +inf without points.
The place seen in a pixel is ``camera.position + depth * (camera.forward + right - up)``, with
``right = (column + 0.5 - cx) / fx * camera.right`` and ``up = (row + 0.5 - cy) / fy * camera.up``.
Colour: uint8 sRGB, premultiplied by alpha; alpha 0 is background.

The same scan, camera and settings give the same bytes.  Pictures display in notebooks, and ``save`` writes PNGs from which
``pointglass render SCAN --like PNG`` draws them again.  Work of more than a few seconds shows a bar on a terminal, else a line
on standard error now and then.  A scan draws on one thread and in one process: other threads open it again, and processes are
started with ``multiprocessing.set_start_method("spawn")``.

Bad input raises :class:`InputError`, a device that cannot do what was asked :class:`DeviceError`; both are one line that names
the value and the remedy.  Importing this module loads neither torch nor OpenGL: OpenGL loads with the first picture, torch with
the first neural one.
"""

import sys

if "".join(
    sys.orig_argv[sys.orig_argv.index("-m") + 1 :][:1] if sys.argv[:1] == ["-m"] else sys.argv[:1]
).replace("\\", "/").rpartition("/")[2] in ("pointglass", "pointglass.exe", "pointglass.viewer"):
    # This is the command line, not a program that imports pointglass: Ctrl-C and SIGTERM end it with one line and exit code 130
    # from here on, before anything else is imported.  viewer/__main__.py then takes charge of them
    # (model/common/process/signals.py).
    import _signal  # pyright: ignore[reportMissingImports]  # the module signal takes longer to load
    import os

    def _stopped(_number: int, _frame: object) -> None:
        os.write(2, b"pointglass: stopped\n")
        os._exit(130)

    for _stop in (_signal.SIGINT, _signal.SIGTERM, *([_signal.SIGBREAK] if hasattr(_signal, "SIGBREAK") else [])):
        if _signal.getsignal(_stop) in (_signal.SIG_DFL, _signal.default_int_handler):
            _signal.signal(_stop, _stopped)

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if "__path__" not in globals():  # a checkout: this file beside viewer/ and model/; in a wheel it is pointglass/__init__.py
    __path__ = [str(Path(__file__).resolve().parent)]
    assert __spec__ is not None
    __spec__.submodule_search_locations = __path__
    __package__ = __name__

from .viewer import __version__

if TYPE_CHECKING:
    from .viewer.commands.demo import demo_scan
    from .viewer.common.errors import DeviceError, InputError, PointglassError
    from .viewer.interface.arguments import RenderSettings
    from .viewer.interface.compare_scans import compare
    from .viewer.interface.from_points import from_points
    from .viewer.interface.measured_points import Points
    from .viewer.interface.notebook.published_frame import show_published
    from .viewer.interface.open_scan import Scan, open
    from .viewer.interface.pictures import Frame, Picture
    from .viewer.interface.place_camera import look_at, orthographic, read_cameras, write_cameras
    from .viewer.interface.scan_photographs import Photograph
    from .viewer.interface.volume_between import volume_between
    from .viewer.interface.volume_in_box import volume_in_box
    from .viewer.picture.camera import Camera
    from .viewer.picture.provenance import PROVENANCE
    from .viewer.work.comparing.compare import Distances
    from .viewer.work.fits.fit import Fit

__all__ = [
    "PROVENANCE", "Camera", "DeviceError", "Distances", "Fit", "Frame", "InputError", "Photograph", "Picture",
    "PointglassError", "Points", "RenderSettings", "Scan", "__version__", "compare", "demo_scan", "from_points", "look_at",
    "open", "orthographic", "read_cameras", "show_published", "volume_between", "volume_in_box",
    "write_cameras",
]  # fmt: skip

_MODULES = {
    "picture.camera": ["Camera"],
    "common.errors": ["DeviceError", "InputError", "PointglassError"],
    "interface.arguments": ["RenderSettings"],
    "interface.compare_scans": ["compare"],
    "interface.from_points": ["from_points"],
    "interface.measured_points": ["Points"],
    "interface.notebook.published_frame": ["show_published"],
    "interface.open_scan": ["Scan", "open"],
    "interface.scan_photographs": ["Photograph"],
    "interface.pictures": ["Frame", "Picture"],
    "interface.place_camera": ["look_at", "orthographic", "read_cameras", "write_cameras"],
    "interface.volume_between": ["volume_between"],
    "interface.volume_in_box": ["volume_in_box"],
    "commands.demo": ["demo_scan"],
    "picture.provenance": ["PROVENANCE"],
    "work.comparing.compare": ["Distances"],
    "work.fits.fit": ["Fit"],
}
"""Module below viewer -> what is imported from it when it is first asked for: the command line starts without NumPy."""
_WHERE = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(f"{__name__}.viewer.{_WHERE[name]}"), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


if __name__ == "__main__":  # ``python -m pointglass`` in a checkout; in a wheel .ci/wheel_main.py does it
    import_module("pointglass.viewer.__main__").main()
