"""An open scan and its pictures, for Python."""

from __future__ import annotations

import html
import os
import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, Self, Unpack, overload

import numpy as np
import numpy.typing as npt

from ..common.errors import DeviceError, InputError, is_opengl_error
from ..common.progress import progress
from ..picture.camera import Camera
from ..picture.provenance import views_with_mask
from ..picture.settings import Memory, Settings
from ..picture.views import ViewName
from .add_meshes import BesideMeshes
from .arguments import PathLike, RenderSettings, cameras_of, memory_of, path_of, python_names, settings_of
from .facts_table import facts_table
from .measured_points import Points
from .pictures import Frame, Picture, as_picture
from .scan_outputs import ScanOutputs
from .scan_photographs import Photograph, photographs_of

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..picture.meshes.mesh_layer import MeshLayer
    from ..render.renderer import Renderer


class Scan(BesideMeshes, ScanOutputs):
    """An open scan; made by :func:`open` or :func:`from_points`.  A context manager: leaving it closes the scan.

    The first picture makes an OpenGL context without a window, which lives until :meth:`close`.  A scan makes all its pictures
    on the thread that made the first one, and in the process: another thread opens the scan once more, and processes are
    started with "spawn".  Several scans may be open and be rendered in turn.
    """

    def __init__(self, scene: Scene, name: str, memory: Memory):
        self._scene: Scene | None = scene
        self._name, self._memory = name, memory
        self._meshes: tuple[MeshLayer, ...] = ()
        self._drawing: tuple[Any, Renderer] | None = None  # the context and what draws in it, once there is a picture
        self._owner: tuple[int, threading.Thread] | None = None  # process and thread of the first picture
        self._busy = threading.Lock()

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
        return self._open.scan_places.copy()

    @property
    def info(self) -> dict[str, Any]:
        """What ``pointglass info --json`` prints: format, spacing, noise, unit, CRS, scans, warnings; ready for JSON."""
        from ..commands.info import facts

        return facts(self._open)

    @property
    def photographs(self) -> list[Photograph]:
        """The photographs in the scan's E57 files, also those without a pose; their pictures are decoded when asked for."""
        return photographs_of(self._open)

    @overload
    def render(
        self, camera: Camera, *, view: ViewName = "neural", full: Literal[False] = False, **settings: Unpack[RenderSettings]
    ) -> Picture: ...

    @overload
    def render(
        self, camera: Camera, *, view: ViewName = "neural", full: Literal[True], **settings: Unpack[RenderSettings]
    ) -> Frame: ...

    @overload
    def render(
        self, camera: Camera, *, view: ViewName = "neural", full: bool, **settings: Unpack[RenderSettings]
    ) -> Picture | Frame: ...

    @overload
    def render(
        self, camera: Iterable[Camera], *, view: ViewName = "neural", full: Literal[False] = False,
        **settings: Unpack[RenderSettings],
    ) -> list[Picture]: ...  # fmt: skip

    @overload
    def render(
        self, camera: Iterable[Camera], *, view: ViewName = "neural", full: Literal[True], **settings: Unpack[RenderSettings]
    ) -> list[Frame]: ...

    @overload
    def render(
        self, camera: Iterable[Camera], *, view: ViewName = "neural", full: bool, **settings: Unpack[RenderSettings]
    ) -> list[Picture] | list[Frame]: ...

    def render(
        self, camera: Camera | Iterable[Camera], *, view: ViewName = "neural", full: bool = False,
        **settings: Unpack[RenderSettings],
    ) -> Any:  # fmt: skip
        """A picture of the scan, exact and waited for; of several cameras a list of pictures.

        camera: from :func:`look_at` or :func:`read_cameras`, or a :class:`Camera` of your own; its size is the picture's.  Of a
        list, progress is shown on standard error; all pictures are held in memory, so render many large ones one by one.
        view: raw (every point that lands in a pixel), filtered (hidden points removed), filled (holes filled smoothly) or
        neural (repainted by the network).  settings: see :class:`RenderSettings`.

        Returns (H, W, 4) uint8, sRGB premultiplied by alpha, row 0 at the top, which notebooks show and ``save`` writes; with
        ``full`` a :class:`Frame` around it.
        Raises InputError for a setting that does not exist, a closed scan, or another thread than that of the first picture;
        DeviceError where OpenGL 4.3, the device asked for or its memory is missing, and after a fork.
        """
        scene = self._open
        cameras = [camera] if isinstance(camera, Camera) else cameras_of(camera)
        chosen = settings_of(view, settings)
        if not cameras:
            return []
        with python_names(), self._turn():
            if self._drawing is None:
                from ..commands.photo_option import check_photographs

                check_photographs(chosen)  # refused before the grid is made ready for pictures
            if view == "neural":
                prepare_network()
            if isinstance(camera, Camera):
                return self._picture(scene, camera, chosen, full)
            made = []
            with progress(len(cameras), "rendering", " pictures") as meter:
                for one in cameras:
                    made.append(self._picture(scene, one, chosen, full))
                    meter.update(1)
            return made

    def _picture(self, scene: Scene, camera: Camera, chosen: Settings, full: bool) -> Picture | Frame:
        from ..commands.photo_option import use_photographs
        from ..picture.spec import PictureSpec
        from ..render.described_picture import Composer, render
        from ..work.pictures.shot_metadata import describe_shot

        spec, view = PictureSpec(camera, chosen, edits=self._edits, background="black"), chosen.view
        try:
            context, renderer = self._drawing or self._begin(scene)
            use_photographs(renderer, chosen)
            with context:  # another scan's context, or somebody else's, may be the current one
                frame = render(renderer, spec, more=views_with_mask(view) if full else ())
                composer = Composer(context)
                try:
                    pixels = composer.image(frame, view, spec).copy()
                    image = as_picture(pixels, describe_shot(scene, spec).drawn_with(renderer.choice.timed))
                    if not full:
                        return image
                    return Frame(image, frame.depth().copy(), frame.mask(), composer.provenance(frame, spec), frame.stats)
                finally:
                    composer.release()
        except Exception as error:
            if is_opengl_error(error):
                size = f"{camera.width}x{camera.height}"
                raise DeviceError(f"OpenGL: {error}",
                                  remedy=f"make a picture smaller than {size}, or give open a gpu_memory") from error
            raise

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """Refuses what OpenGL cannot do: to draw on two threads, or after a fork."""
        from ..render.device.context import check_not_forked

        check_not_forked()
        if not self._busy.acquire(blocking=False):
            raise InputError(f"{self._name}: another thread is using this scan", remedy="open the scan once in each thread")
        try:
            here = os.getpid(), threading.current_thread()
            if self._drawing is not None and self._owner is not None and self._owner[1] is not here[1]:
                raise InputError(f"{self._name}: made its first picture on the thread {self._owner[1].name}, this is "
                                 f"{here[1].name}; a scan makes all its pictures on one thread: open it once in each")
            self._owner = here
            yield
        finally:
            self._busy.release()

    def publish(self, folder: PathLike, *, at: int | PathLike = "auto", view: str = "neural", size: int = 1024,
                title: str = "") -> int:
        """Writes a folder whose index.html shows panoramas in any browser, as ``pointglass publish``; returns how many places.

        at: at most so many planned places, "stations", "auto" (stations where they are known, else planned), or a camera file,
        of whose cameras the positions are taken.  size: 512, 1024 or 2048 pixels of a side of the six pictures around a place.
        title: of the page; "": the scan's name.
        Raises InputError, one line, where the folder holds other files or another publication is being written into it, and
        for the first argument of a wrong kind.
        """
        from .publish_folder import publish_folder

        if not isinstance(title, str):
            raise InputError("expected a text", option="title", value=title)

        scene = self._open
        with python_names(), self._turn():
            context, renderer = self._drawing or self._begin(scene)
            with context:
                named = title or self._name.rpartition(".")[0] or self._name  # a name without an ending is one, too
                return publish_folder(scene, renderer, path_of(folder), at, view, size, named, prepare_network)

    def close(self) -> None:
        """Frees the points on the GPU and the OpenGL context; arrays and frames stay yours.  Closing twice does nothing.

        Raises InputError on another thread than that of the first picture.
        """
        if self._drawing is not None and self._owner is not None and self._owner[0] == os.getpid():
            with self._turn():
                context, renderer = self._drawing
                self._drawing = None
                with context:
                    renderer.release()
                context.release()
        self._drawing, self._scene = None, None  # a forked process leaves the context to its parent

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<pointglass.Scan {self._name}: {f'{self._scene.count:,} points' if self._scene else 'closed'}>"

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        if self._scene is None:
            return f"<p>{html.escape(repr(self))}</p>"
        return facts_table(self._name, self._scene)

    @property
    def _open(self) -> Scene:
        if self._scene is None:
            raise InputError(f"{self._name}: this scan was closed", remedy="open it again")
        return self._scene

    def _begin(self, scene: Scene) -> tuple[Any, Renderer]:
        from ..render.device.context import create_context
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
    """Opens a scan: a file, several files of one place, or a folder that ``pointglass convert`` made; mesh files (glTF, OBJ,
    STL, PLY with faces) are laid beside it as :meth:`Scan.add_mesh` does.

    The first time, the files are read and a grid is built, and kept in the cache folder; after that opening takes milliseconds.
    exposures: matched: scans of one place are given the same brightness; as-scanned: colours as in the file.
    columns: what the columns of a text file of points are, such as "x,y,z,i,r,g,b"; None: as they are recognised.
    cache: False builds the grid in memory and keeps nothing.  gpu_memory: bytes that points may take on the GPU; a larger scan
    is streamed, to the same picture; None: by the device.
    Raises InputError, one line, for anything wrong with the files or the cache folder.
    """
    from ..grid.open_scene import open_scene
    from ..readers.meshes.mesh_formats import scans_and_meshes

    files, meshes = scans_and_meshes([path_of(path) for path in paths])
    if exposures not in ("matched", "as-scanned"):
        raise InputError("expected matched or as-scanned", option="exposures", value=exposures)
    memory = Memory(gpu=memory_of(gpu_memory))
    with python_names():
        scene = open_scene(files, cache=cache, match=exposures == "matched", columns=columns)
    name = files[0].name + (f" and {len(files) - 1} more" if len(files) > 1 else "")
    scan = Scan(scene, name, memory)
    for mesh in meshes:
        scan.add_mesh(mesh)
    return scan


@cache
def prepare_network() -> None:
    """Sets the process up for the network, once: afterwards its settings are the caller's to change."""
    from ...model.common.process.torch_process import prepare_inference

    prepare_inference()
