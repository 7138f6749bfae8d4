"""What a render returns: textures while they live, arrays on demand, and an honest account of how it was made."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import moderngl

    from .stage_times import Times


@dataclass
class Frame:
    """One picture in the views asked for.  Textures belong to the renderer and are valid until its next render."""

    textures: dict[str, "moderngl.Texture"]
    depth_texture: "moderngl.Texture"
    mask_texture: "moderngl.Texture | None"
    facts: dict = field(repr=False)
    times: "Times" = field(repr=False)

    def image(self, view: str) -> np.ndarray:
        """(H, W, 4) uint8, sRGB premultiplied by alpha, row 0 at the top.  Raises KeyError for a view not asked for."""
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
        """total_ms; stages (name: ms on what ran it) and host (name: ms until that had it); points and cells drawn, what ran on
        what, approximations in force.  Waits for the GPU."""
        return {
            "total_ms": self.times.total(),
            "stages": dict(self.times.milliseconds()),
            "host": dict(self.times.host),
            **{name: fact() if callable(fact) else fact for name, fact in self.facts.items()},
        }
