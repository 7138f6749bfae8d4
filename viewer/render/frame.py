"""What a render returns: textures while they live, arrays on demand, and an honest account of how it was made."""

from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import moderngl


class Stages:
    """Times the stages of a frame.

    On a GPU by timer queries, read when asked for; in software OpenGL, where queries of compute passes are wrong, by the
    clock around a finished stage.
    """

    def __init__(self, context: "moderngl.Context", *, software: bool):
        self._context, self._software = context, software
        self._times: dict[str, float] = {}
        self._queries: dict[str, list[moderngl.Query]] = {}
        self._pool: dict[str, moderngl.Query] = {}
        self.begun = perf_counter()
        self.ended = self.begun

    def begin(self) -> None:
        """Starts a frame."""
        self._times = {}
        self.begun = perf_counter()

    def run(self, name: str, work) -> None:
        """Runs ``work`` (a call without arguments) as the stage ``name``."""
        if self._software or name in HOST_STAGES:
            start = perf_counter()
            work()
            self._context.finish() if self._software else None
            self._times[name] = (perf_counter() - start) * 1e3
            return
        if name not in self._pool:
            self._pool[name] = self._context.query(time=True)
        with self._pool[name]:
            work()
        self._times[name] = -1.0  # read from the query when asked for

    def end(self) -> None:
        """Ends the frame.  On a GPU the pictures may still be in the making; ``total`` waits for them."""
        self.ended = perf_counter()

    def milliseconds(self) -> dict[str, float]:
        """Milliseconds of each stage of the last frame; waits for the GPU."""
        return {n: self._pool[n].elapsed / 1e6 if t < 0 else t for n, t in self._times.items()}


HOST_STAGES = ("cull",)
"""Timed by the clock everywhere.  The network is not: OpenGL waits for CUDA at unmapping, so a query around it sees it."""



@dataclass
class Frame:
    """One picture in the views asked for.  Textures belong to the renderer and are valid until its next render."""

    textures: dict[str, "moderngl.Texture"]
    depth_texture: "moderngl.Texture"
    mask_texture: "moderngl.Texture | None"
    facts: dict = field(repr=False)
    stages: Stages = field(repr=False)

    def image(self, view: str) -> np.ndarray:
        """(H, W, 4) uint8, sRGB and alpha, row 0 at the top.  Raises KeyError for a view that was not asked for."""
        texture = self.textures[view]
        return np.frombuffer(texture.read(alignment=1), np.uint8).reshape(texture.height, texture.width, 4)

    def depth(self) -> np.ndarray:
        """(H, W) float32, view-space z in file units after the soft z-buffer, before the filter; +inf where empty."""
        texture = self.depth_texture
        return np.frombuffer(texture.read(alignment=1), np.float32).reshape(texture.height, texture.width)

    def mask(self) -> np.ndarray:
        """(H, W) bool: kept by the filter.  Where no filter ran, the pixels that hold a point."""
        if self.mask_texture is None:
            return np.isfinite(self.depth())
        texture = self.mask_texture
        return np.frombuffer(texture.read(alignment=1), np.uint8).reshape(texture.height, texture.width) > 127

    @property
    def stats(self) -> dict:
        """total_ms, stages (name: ms), points and cells drawn, what ran on what, approximations in force."""
        times = self.stages.milliseconds()
        return {
            "total_ms": max((self.stages.ended - self.stages.begun) * 1e3, sum(times.values())),
            "stages": times,
            **{name: fact() if callable(fact) else fact for name, fact in self.facts.items()},
        }
