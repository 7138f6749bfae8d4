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
    >>> scan.close()                                             # or: with pointglass.open(...) as scan:

World frame: the scan file's own coordinates and unit of length, z up unless a camera says otherwise.  Pictures have row 0 at
the top.  The same scan, camera and settings give the same bytes.  Bad input raises :class:`InputError`, a device that cannot do
what was asked :class:`DeviceError`; both are one line that names the value and the remedy.  Importing this module loads neither
torch nor OpenGL: OpenGL loads with the first picture, torch with the first neural one.
"""

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from viewer import __version__
from viewer.camera import Camera, from_fov
from viewer.camera import look_at as _pose
from viewer.errors import DeviceError, InputError, PointglassError, is_opengl_error
from viewer.settings import Memory, Settings, View
from viewer.tools.demo import demo_scan
from viewer.tools.provenance import PROVENANCE, provenance, views_with_mask

if TYPE_CHECKING:
    from viewer.grid.scene import Scene
    from viewer.render.renderer import Renderer

__all__ = [
    "PROVENANCE", "Camera", "DeviceError", "Frame", "InputError", "PointglassError", "Points", "RenderSettings", "Scan",
    "__version__", "demo_scan", "look_at", "open", "read_cameras",
]  # fmt: skip

PathLike = str | os.PathLike[str]
Index = slice | int | Sequence[int] | npt.NDArray[np.integer[Any]] | npt.NDArray[np.bool_]


class RenderSettings(TypedDict, total=False):
    """Keyword arguments of :meth:`Scan.render`: the fields of viewer.settings.Settings but the view, whose tables say what each
    choice means (so does ``pointglass render --help``).

    quality: fast, balanced, best or paper: which network.  detail: from 0 (smooth) to 2 (every measured grain); 1: by the
    scan's noise.  weights: a weights file of your own.  precision: auto, fp32, bf16 or fp16.  device: auto, cuda or cpu; of the
    network.  filter: auto, paper-code, paper-text, npbg++ or off.  filter_strength: multiplies the depth tolerance.
    filter_levels: pyramid levels, None: the filter's own.  lod: points drawn per pixel, None: every point.
    raster: auto, points or compute.  soft_z: auto, paper-code or paper-text.  stations: auto or equal.
    """

    quality: str
    detail: float
    weights: PathLike | None
    precision: str
    device: str
    filter: str
    filter_strength: float
    filter_levels: int | None
    lod: float | None
    raster: str
    soft_z: str
    stations: str


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture and what is known about each of its pixels; arrays of your own, row 0 at the top.

    image: (H, W, 4) uint8, sRGB premultiplied by alpha; alpha 0 is background.
    depth: (H, W) float32, distance along the viewing axis in file units, of the foremost points; +inf where there are none.
        Before the filter: it has a value where the mask is False because the points there are hidden.
    mask: (H, W) bool, True where points were kept by the filter (it runs for the mask in the raw view too).
    provenance: (H, W) uint8, a key of PROVENANCE: 0 background, 1 measured, 2 measured and repainted by the network, 3 filled.
        In the raw view every pixel shown is 1, also where the mask is False.
    stats: ``total_ms``, milliseconds by stage, points and cells drawn, network and device, approximations in force.
    """

    image: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    mask: npt.NDArray[np.bool_]
    provenance: npt.NDArray[np.uint8]
    stats: dict[str, Any]


class Points:
    """The measured points of a scan, or some of them: a view that decodes an array each time one is asked for.

    ``points[index]`` takes slices, whole numbers and boolean masks, and decodes nothing; ``np.asarray(points)`` is ``xyz``.
    The order is the grid's: density layers, then place.  ``points[::100]`` thins evenly; ``points[:1000]`` is one corner.
    """

    def __init__(self, scene: "Scene", chosen: "range | np.ndarray"):
        self._scene, self._chosen = scene, chosen

    def __len__(self) -> int:
        return len(self._chosen)

    def __getitem__(self, index: Index) -> "Points":
        """Raises IndexError beyond the last point, InputError where the index is of another kind."""
        if isinstance(index, slice):
            return Points(self._scene, self._chosen[index])
        numbers = _numbers(index, len(self))
        own = self._chosen
        return Points(self._scene, own.start + own.step * numbers if isinstance(own, range) else own[numbers])

    __iter__ = None  # a loop over single points would take hours; index with slices instead

    @property
    def xyz(self) -> npt.NDArray[np.float64]:
        """(n, 3) float64 file coordinates, each at most half a step from the measured one; a step is 1/65536 of a grid cell."""
        from viewer.grid.scene import packed, positions

        return positions(self._scene, packed(self._scene, self._index), self._index)

    @property
    def rgb(self) -> npt.NDArray[np.uint8]:
        """(n, 3) uint8 sRGB, after exposure compensation unless the scan was opened with exposures="as-scanned"."""
        from viewer.grid.scene import colours, packed

        return colours(packed(self._scene, self._index))

    @property
    def intensity(self) -> npt.NDArray[np.uint16]:
        """(n,) uint16, 0 where the file holds none."""
        from viewer.grid.scene import intensities, packed

        return intensities(self._scene, packed(self._scene, self._index))

    @property
    def station(self) -> npt.NDArray[np.uint8]:
        """(n,) uint8, the row of ``Scan.stations`` and the place in ``Scan.info["scans"]``."""
        from viewer.grid.scene import packed, scan_numbers

        return scan_numbers(packed(self._scene, self._index))

    @property
    def _index(self) -> "slice | np.ndarray":
        own = self._chosen
        if not isinstance(own, range):
            return own
        return slice(own.start, own.stop, own.step) if own.step > 0 else np.arange(own.start, own.stop, own.step)

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self.xyz, dtype)

    def __repr__(self) -> str:
        return f"<pointglass.Points: {len(self):,}>"


class Scan:
    """An open scan; made by :func:`open`.  A context manager: leaving it closes the scan.

    The first picture makes an OpenGL context without a window, which lives until :meth:`close`; make all pictures of a scan on
    one thread.  Several scans may be open and be rendered in turn.
    """

    def __init__(self, scene: "Scene", name: str, memory: Memory):
        self._scene: Scene | None = scene
        self._name, self._memory = name, memory
        self._drawing: tuple[Any, Renderer] | None = None  # the context and what draws in it, once there is a picture

    @property
    def count(self) -> int:
        """How many points the scan holds."""
        return self._open.count

    @property
    def points(self) -> Points:
        """All points; ``.xyz``, ``.rgb``, ``.intensity`` and ``.station`` decode, ``points[...]`` chooses some."""
        scene = self._open
        return Points(scene, range(scene.count))

    @property
    def bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3) float64 file coordinates: lowest and highest corner of the measured points."""
        return self._open.bounds.copy()

    @property
    def stations(self) -> npt.NDArray[np.float64]:
        """(S, 3) float64 file coordinates: where each scanner stood, NaN where it is not known; S is 0 where the files do not
        tell scans apart."""
        return self._open.station_places.copy()

    @property
    def info(self) -> dict[str, Any]:
        """What ``pointglass info --json`` prints: format, spacing, noise, unit, CRS, scans, warnings; ready for JSON."""
        from viewer.grid.info import facts

        return facts(self._open)

    @overload
    def render(
        self, camera: Camera, *, view: View = "neural", full: Literal[False] = False, **settings: Unpack[RenderSettings]
    ) -> npt.NDArray[np.uint8]: ...

    @overload
    def render(
        self, camera: Camera, *, view: View = "neural", full: Literal[True], **settings: Unpack[RenderSettings]
    ) -> Frame: ...

    @overload
    def render(
        self, camera: Camera, *, view: View = "neural", full: bool, **settings: Unpack[RenderSettings]
    ) -> "npt.NDArray[np.uint8] | Frame": ...

    def render(
        self, camera: Camera, *, view: View = "neural", full: bool = False, **settings: Unpack[RenderSettings]
    ) -> "npt.NDArray[np.uint8] | Frame":
        """A picture of the scan, exact and waited for.

        camera: from :func:`look_at` or :func:`read_cameras`, or a :class:`Camera` of your own; its size is the picture's.
        view: raw (every point that lands in a pixel), filtered (hidden points removed), filled (holes filled smoothly) or
        neural (repainted by the network).  settings: see :class:`RenderSettings`.

        Returns (H, W, 4) uint8, sRGB premultiplied by alpha, row 0 at the top; with ``full`` a :class:`Frame` around it.
        Raises InputError for a setting that does not exist or a closed scan, DeviceError where OpenGL 4.3, the device asked for
        or its memory is missing.
        """
        scene = self._open
        if not isinstance(camera, Camera):
            raise InputError(f"camera {camera!r}: expected a pointglass.Camera, as look_at makes one")
        chosen = _settings(view, settings)
        if view == "neural":
            _prepare_network()
        try:
            context, renderer = self._drawing or self._begin(scene)
            with context:  # another scan's context, or somebody else's, may be the current one
                frame = renderer.render(camera, chosen, views_with_mask(view) if full else (view,))
                image = frame.image(view).copy()
                if not full:
                    return image
                mask = frame.mask()
                return Frame(image, frame.depth().copy(), mask, provenance(view, image, mask), frame.stats)
        except Exception as error:
            if is_opengl_error(error):
                size = f"{camera.width}x{camera.height}"
                raise DeviceError(f"OpenGL: {error}; make a picture smaller than {size}, or give open a gpu_memory") from error
            raise

    def close(self) -> None:
        """Frees the points on the GPU and the OpenGL context; arrays and frames stay yours.  Closing twice does nothing."""
        drawing, self._drawing, self._scene = self._drawing, None, None
        if drawing is not None:
            context, renderer = drawing
            with context:
                renderer.release()
            context.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<pointglass.Scan {self._name}: {f'{self._scene.count:,} points' if self._scene else 'closed'}>"

    @property
    def _open(self) -> "Scene":
        if self._scene is None:
            raise InputError(f"{self._name}: this scan was closed; open it again")
        return self._scene

    def _begin(self, scene: "Scene") -> "tuple[Any, Renderer]":
        from viewer.render.context import create_context
        from viewer.render.renderer import Renderer

        with ExitStack() as undo:
            context = create_context()
            undo.callback(context.release)
            self._drawing = context, Renderer(context, scene, memory=self._memory)
            undo.pop_all()
        return self._drawing


def open(
    *paths: PathLike,
    exposures: Literal["matched", "as-scanned"] = "matched",
    columns: str | None = None,
    cache: bool = True,
    gpu_memory: int | None = None,
) -> Scan:
    """Opens a scan: a file, several files of one place, or a folder that ``pointglass convert`` made.

    The first time, the files are read and a grid is built, and kept in the cache folder; after that opening takes milliseconds.
    exposures: matched: scans of one place are given the same brightness; as-scanned: colours as in the file.
    columns: what the columns of a text file of points are, such as "x,y,z,i,r,g,b"; None: as they are recognised.
    cache: False builds the grid in memory and keeps nothing.  gpu_memory: bytes that points may take on the GPU; a larger scan
    is streamed, to the same picture; None: by the device.
    Raises InputError, one line, for anything wrong with the files or the cache folder.
    """
    from viewer.grid.open_scene import open_scene

    files = [_path(path) for path in paths]
    if exposures not in ("matched", "as-scanned"):
        raise InputError(f"exposures {exposures!r}: expected matched or as-scanned")
    if gpu_memory is not None and not (isinstance(gpu_memory, int) and gpu_memory > 0):
        raise InputError(f"gpu_memory {gpu_memory!r}: expected a number of bytes, such as 4 << 30, or None")
    scene = open_scene(files, cache=cache, match=exposures == "matched", columns=columns)
    name = files[0].name + (f" and {len(files) - 1} more" if len(files) > 1 else "")
    return Scan(scene, name, Memory(gpu=gpu_memory))


def look_at(
    eye: npt.ArrayLike,
    target: npt.ArrayLike,
    *,
    up: npt.ArrayLike = (0.0, 0.0, 1.0),
    fov: float = 60.0,
    size: tuple[int, int] = (960, 720),
    name: str = "",
) -> Camera:
    """A camera at ``eye`` that looks at ``target``, with square pixels and the principal point in the middle.

    eye, target: (3,) file coordinates.  up: (3,) the direction that is upward in the picture.  fov: vertical field of view in
    degrees, above 0 and below 180.  size: (width, height) in pixels.  Raises InputError naming the first bad value.
    """
    places = _vector("eye", eye), _vector("target", target)
    if np.array_equal(*places):
        raise InputError(f"eye and target are both {places[0].tolist()}; a camera needs a direction to look in")
    axis = _vector("up", up)
    if not axis.any():
        raise InputError("up [0, 0, 0]: expected a direction, such as (0, 0, 1)")
    try:
        width, height = size
    except (TypeError, ValueError):
        raise InputError(f"size {size!r}: expected (width, height) in pixels, such as (960, 720)") from None
    try:
        degrees = float(fov)
    except (TypeError, ValueError):
        raise InputError(f"field of view {fov!r}: expected degrees above 0 and below 180") from None
    Camera(width, height, 1, 1, 0, 0, np.eye(4), name)  # refuses a bad size in words before anything is computed from it
    return from_fov(width, height, degrees, _pose(*places, axis), name)


def read_cameras(path: PathLike, *, size: tuple[int, int] | None = None) -> list[Camera]:
    """The cameras of a file: nerfstudio transforms.json or camera_path.json, a COLMAP folder, a TUM trajectory.

    size: (width, height) every camera is resized to.  Raises InputError, one line with file, frame and value.
    """
    from viewer.tools.camera_files import read_cameras as read

    return read(_path(path), size=size)


@cache
def _prepare_network() -> None:
    """Sets the process up for the network, once: afterwards its settings are the caller's to change."""
    from model.common.torch_process import prepare_inference

    prepare_inference()


def _settings(view: str, given: RenderSettings) -> Settings:
    """Raises InputError naming the first setting that does not exist or has a value it cannot have."""
    known = [field.name for field in fields(Settings) if field.name != "view"]
    for name in given:
        if name not in known:
            meant = get_close_matches(name, known, 1)
            hint = f"did you mean {meant[0]}?" if meant else f"expected one of {', '.join(known)}"
            raise InputError(f"render has no setting {name!r}; {hint}")
    values: dict[str, Any] = dict(given)
    if values.get("weights") is not None:
        values["weights"] = str(_path(values["weights"]))
    try:
        return Settings(view=view, **values)
    except TypeError:  # compared with a number, or looked up in a table
        shown = ", ".join(f"{name}={value!r}" for name, value in {"view": view, **values}.items())
        raise InputError(f"render({shown}): a value is of the wrong kind; see pointglass.RenderSettings") from None


def _path(path: PathLike) -> Path:
    try:
        return Path(path)
    except TypeError:
        raise InputError(f"{path!r}: expected the path of a file or folder; give several as open(a, b)") from None


def _vector(name: str, value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    try:
        vector = np.array(value, np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name} {value!r}: expected three finite numbers, x, y and z")
    return vector


def _numbers(index: object, count: int) -> npt.NDArray[np.int64]:
    """(n,) running numbers from 0, of one whole number, an array of them, or a mask (count,)."""
    array = np.atleast_1d(np.asarray(index))
    if array.ndim == 1 and array.dtype == bool and len(array) == count:
        return np.flatnonzero(array)
    if array.ndim != 1 or (array.dtype.kind not in "iu" and array.size):
        raise InputError(f"points[{index!r}]: expected a slice, whole numbers, or a mask of {count:,} booleans")
    numbers = array.astype(np.int64)
    if numbers.size and not (-count <= numbers.min() and numbers.max() < count):
        raise IndexError(f"points[{index!r}]: there are {count:,} points")
    return np.where(numbers < 0, numbers + count, numbers)
