"""An open scan and its pictures, for Python."""

from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, Self, Unpack, overload

import numpy as np
import numpy.typing as npt

from ..camera import Camera
from ..errors import DeviceError, InputError, is_opengl_error
from ..settings import Memory, View
from ..tools.provenance import provenance, views_with_mask
from .arguments import PathLike, RenderSettings, path_of, settings_of
from .measured_points import Points

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..render.renderer import Renderer


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
        from ..grid.info import facts

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
        chosen = settings_of(view, settings)
        if view == "neural":
            prepare_network()
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
        from ..render.context import create_context
        from ..render.renderer import Renderer

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
    from ..grid.open_scene import open_scene

    files = [path_of(path) for path in paths]
    if exposures not in ("matched", "as-scanned"):
        raise InputError(f"exposures {exposures!r}: expected matched or as-scanned")
    if gpu_memory is not None and not (isinstance(gpu_memory, int) and gpu_memory > 0):
        raise InputError(f"gpu_memory {gpu_memory!r}: expected a number of bytes, such as 4 << 30, or None")
    scene = open_scene(files, cache=cache, match=exposures == "matched", columns=columns)
    name = files[0].name + (f" and {len(files) - 1} more" if len(files) > 1 else "")
    return Scan(scene, name, Memory(gpu=gpu_memory))


@cache
def prepare_network() -> None:
    """Sets the process up for the network, once: afterwards its settings are the caller's to change."""
    from ...model.common.torch_process import prepare_inference

    prepare_inference()
