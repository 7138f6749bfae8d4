"""Development of a finished picture: point size, eye-dome lighting, tones, the lock on measured pixels, the provenance tint.

Passes over the textures of a Frame; what is not asked for does not run.  References: viewer.picture.look and
viewer.picture.provenance_tint.  Pictures are RGBA8, premultiplied, row 0 at the top.
"""

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ...picture import provenance_tint
from ...picture.look import EDL_GAIN, Look, disc, tone_curves
from ...picture.provenance import BACKGROUND, FILLED, MEASURED, PHOTOGRAPHED, REPAINTED
from ...picture.views import VIEWS
from ..device.compute_pass import Pass

if TYPE_CHECKING:
    import moderngl

    from ..device.shader import Programs

_MASKED, _REPAINTED = 1, 2
"""Of look_provenance.comp: some pixels are not measured; and the measured ones are repainted."""


def needs(look: Look, view: str, *, tint: bool, lock: bool) -> bool:
    """Whether a picture of ``view`` is developed at all; otherwise the frame's own texture is shown."""
    return tint or look.develops or (look.shapes_points and VIEWS[view].shows_points) or (lock and view == "neural")


class Rendered(Protocol):
    """What is developed: a viewer.render.frame.Frame."""

    @property
    def textures(self) -> "dict[str, moderngl.Texture]": ...

    @property
    def depth_texture(self) -> "moderngl.Texture": ...

    @property
    def ratio_depth(self) -> "moderngl.Texture | None": ...

    @property
    def mask_texture(self) -> "moderngl.Texture | None": ...

    @property
    def photo_shares(self) -> "dict[str, moderngl.Texture]": ...


class Developer:
    """Owns two targets and the tables of one picture size.  nearest: R32F, depth of the pixels of enlarged points, +inf where
    there is none; of the last picture whose points were enlarged."""

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        context = programs.context
        self.context, self.size, self._programs = context, size, programs
        self._targets = [context.texture(size, 4, dtype="f1") for _ in range(2)]
        self.nearest = context.texture(size, 1, dtype="f4")
        self._curves = context.texture((256, 1), 4, dtype="u1", alignment=1)
        self._offsets: moderngl.Texture | None = None
        self._passes: dict[tuple[str, ...], Pass] = {}
        self._disc = 0  # size of the disc in _offsets
        self._look: Look | None = None  # whose curves are uploaded

    def run(self, frame: Rendered, view: str, look: Look, *, tint: bool = False, lock: bool = False) -> "moderngl.Texture":
        """The developed picture of a view; valid until the next call or the renderer's next picture.

        tint, and lock for a neural picture, need the filtered view in the frame (except tint of a raw picture).
        """
        picture, depth, mask = frame.textures[view], frame.ratio_depth or frame.depth_texture, frame.mask_texture
        measured = frame.textures.get("filtered", picture)
        if lock and view == "neural" and mask is not None:
            picture = self._run("look_lock.comp", {"picture": picture, "measured": measured, "mask": mask})
        if VIEWS[view].shows_points and look.shapes_points:
            picture = self._shaped(picture, depth, mask if view == "filtered" else None, look)
        if tint:
            inputs = {"picture": picture, "measured": measured, "mask": mask or picture}
            colours = [provenance_tint.COLOURS[key] for key in (BACKGROUND, MEASURED, REPAINTED, FILLED)]
            passes = VIEWS[view].passes
            share = frame.photo_shares.get(view)
            inputs |= {"photographs": share} if share is not None else {}
            kind = _REPAINTED if "network" in passes else _MASKED if "filter" in passes else 0
            more = {} if share is None else {"photographed": provenance_tint.COLOURS[PHOTOGRAPHED],
                                                "keeps_measured": lock and view == "neural"}
            return self._run("look_provenance.comp", inputs, {"kind": kind, "colours": colours, **more},
                             FULLY_REPAINTED=provenance_tint.FULLY_REPAINTED, TINT=provenance_tint.TINT,
                             PHOTOGRAPHS=None if share is None else 1)
        if look.develops:
            if look != self._look:
                curves = np.zeros((256, 4), np.uint8)
                curves[:, :3] = tone_curves(look)
                self._curves.write(curves.tobytes())
                self._look = look
            picture = self._run("look_tone.comp", {"picture": picture, "curves": self._curves})
        return picture

    def _shaped(self, picture: "moderngl.Texture", depth: "moderngl.Texture", mask: "moderngl.Texture | None",
                look: Look) -> "moderngl.Texture":
        """Draws points as discs, which also gives eye-dome lighting the depth of the pixels shown; then lights them."""
        if self._disc != look.point_size or self._offsets is None:
            offsets = np.array(disc(look.point_size), np.int32)
            if self._offsets is not None:
                self._offsets.release()
            self._offsets = self.context.texture((len(offsets), 1), 2, offsets.tobytes(), dtype="i4")
            self._disc = look.point_size
        inputs = {"picture": picture, "depth": depth, "offsets": self._offsets} | ({"mask": mask} if mask is not None else {})
        picture = self._run("look_points.comp", inputs, more={"nearest": self.nearest}, MASKED=1 if mask is not None else None)
        if look.edl > 0:
            settings = {"gain": EDL_GAIN * look.edl, "radius": eye_dome_radius(self.size[1])}
            picture = self._run("look_eye_dome.comp", {"picture": picture, "depth": self.nearest}, settings)
        return picture

    def _run(self, shader: str, inputs: "dict[str, moderngl.Texture]", uniforms: "dict[str, Any] | None" = None, *,
             more: "dict[str, moderngl.Texture] | None" = None, **defines: Any) -> "moderngl.Texture":
        """Runs a pass into the target that is none of its inputs, and into ``more``."""
        uniforms, more = uniforms or {}, more or {}
        key = (shader, *inputs)
        if key not in self._passes:
            self._passes[key] = Pass(self._programs, "development", shader, outputs=("result", *more), inputs=tuple(inputs),
                                     uniforms=tuple(uniforms), **defines)  # fmt: skip
        target = self._targets[0] if all(texture is not self._targets[0] for texture in inputs.values()) else self._targets[1]
        self._passes[key].run(target, *more.values(), inputs=inputs, **uniforms)
        return target

    def release(self) -> None:
        for texture in (*self._targets, self.nearest, self._curves, self._offsets):
            if texture is not None:
                texture.release()


def read_picture(texture: "moderngl.Texture") -> np.ndarray:
    """(H, W, 4) uint8 of a picture's texture, row 0 at the top."""
    return np.frombuffer(texture.read(alignment=1), np.uint8).reshape(texture.height, texture.width, 4)


def eye_dome_radius(height: int) -> int:
    """Pixels to the neighbours that eye-dome lighting compares with: 1 at 1080 rows and below, 2 at 2160."""
    return max(1, round(height / 1080))
