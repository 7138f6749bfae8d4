"""The photographs of a renderer's scene: its E57 files' own, or those given, and whether a picture uses them."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from ...common.errors import InputError
from ...readers.photographs.placed_photographs import posed
from ..device.context import describe_device
from .photo_library import PhotoLibrary, library_of
from .photo_shader import ResidentPool

if TYPE_CHECKING:
    import moderngl

    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...picture.edits import Edits
    from ...picture.photographs.placed_photograph import PlacedPhotograph
    from ...picture.settings import Settings
    from ...readers.photographs.posed_photograph import PosedPhotograph
    from .photo_pool import PhotoPool


class ScenePhotographs:
    """Makes the library when the first picture wants it.  wake: as of PhotoLibrary.  shaders: whether compute shaders colour;
    None: on a GPU.  placed: photographs of the document that colour the next picture beside those of the scan."""

    shaders: bool | None = None

    def __init__(self, scene: "Scene", wake: Callable[[], None] = lambda: None):
        self._scene, self._wake = scene, wake
        self.placed: tuple[PlacedPhotograph, ...] = ()
        self._libraries: dict[str, PhotoLibrary | None] = {}
        self._with_placed: tuple[tuple[str, tuple[PlacedPhotograph, ...]], PhotoLibrary] | None = None
        self._lone: PhotoLibrary | None = None  # of a photograph that none of these holds
        self._last: PhotoLibrary | None = None
        self._resident: ResidentPool | None = None

    def give(self, folder: str, photographs: "list[PosedPhotograph]", *, checked: bool = True) -> None:
        """The photographs of a folder, the value of Settings.photos that names it.  checked: as of PhotoLibrary."""
        if folder not in self._libraries:
            made = PhotoLibrary(self._scene, photographs, self._wake, checked=checked) if photographs else None
            self._libraries[folder] = made

    def knows(self, photos: str) -> bool:
        """Whether a value of Settings.photos needs nothing to be given."""
        return photos in ("auto", "off") or photos in self._libraries

    def library(self, photos: str) -> PhotoLibrary | None:
        """The photographs that a value of Settings.photos means, with those placed; None where there are none."""
        if not self.placed or photos == "off":
            return self._unplaced(photos)
        if self._with_placed is None or self._with_placed[0] != (photos, self.placed):
            if self._with_placed is not None:
                self._with_placed[1].release()
            own = self._unplaced(photos)
            all_of_them = [*(own.photographs if own is not None else ()), *map(posed, self.placed)]
            self._with_placed = (photos, self.placed), PhotoLibrary(self._scene, all_of_them, self._wake)
        return self._with_placed[1]

    def _unplaced(self, photos: str) -> PhotoLibrary | None:
        if photos not in self._libraries:
            if not self.knows(photos):
                raise InputError("its photographs were not read", option="photos", value=photos)
            self._libraries[photos] = None if photos == "off" else library_of(self._scene, self._wake)
        return self._libraries[photos]

    def ready(self, camera: "Camera", settings: "Settings", edits: "Edits | None", *, wait: bool) -> list[int]:
        """Numbers of the photographs that colour a picture, as PhotoLibrary.ready.  None where points show another value than
        their colour, and of orthographic cameras."""
        off = settings.photos == "off" or (edits is not None and edits.recolours) or camera.orthographic is not None
        self._last = None if off else self.library(settings.photos)
        return [] if self._last is None else self._last.ready(camera, wait=wait)

    def alone(self, photo: "PosedPhotograph", *, wait: bool) -> "PhotoPool | None":
        """A photograph by itself, as PhotoLibrary.alone: of the scan, of a folder, placed, or one that none of them holds."""
        self.library("auto")
        made = [*self._libraries.values(), self._with_placed and self._with_placed[1], self._lone]
        for library in made:
            if library is not None and (number := library.number_of(photo)) is not None:
                return library.alone(number, wait=wait)
        if self._lone is not None:
            self._lone.release()
        self._lone = PhotoLibrary(self._scene, [photo], self._wake)
        return self._lone.alone(0, wait=wait)

    @property
    def pool(self) -> "PhotoPool":
        """Of the library that was last asked."""
        assert self._last is not None
        return self._last.pool

    def resident(self, context: "moderngl.Context") -> ResidentPool | None:
        """A copy of the pool for compute shaders; None where compiled loops colour: in software OpenGL, and where a shader
        cannot address so much."""
        device, pool = describe_device(context), self.pool
        used = not device.software if self.shaders is None else self.shaders
        if not used or pool.words.nbytes > device.storage_limit:
            return None
        if self._resident is None or self._resident.pool is not pool:
            if self._resident is not None:
                self._resident.release()
            self._resident = ResidentPool(context, pool)
        return self._resident

    @property
    def arrived(self) -> bool:
        """Whether a photograph that the last picture lacked is there now, or one in it has not faded in."""
        return self._last is not None and self._last.arrived

    def free_gpu(self) -> None:
        """Frees what is on the GPU; the next picture that needs it makes it again."""
        if self._resident is not None:
            self._resident.release()
            self._resident = None

    def release(self) -> None:
        self.free_gpu()
        if self._with_placed is not None:
            self._with_placed[1].release()
            self._with_placed = None
        if self._lone is not None:
            self._lone.release()
            self._lone = None
        for library in self._libraries.values():
            if library is not None:
                library.release()
        self._libraries.clear()
        self._last = None
