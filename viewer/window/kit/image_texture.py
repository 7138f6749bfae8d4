"""Pictures for the interface, as textures of the window's context."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import moderngl


def texture_of(context: "moderngl.Context", image: np.ndarray) -> "moderngl.Texture":
    """A texture of (H, W, 3) uint8, opaque; whoever asks for it releases it."""
    height, width = image.shape[:2]
    rgba = np.dstack([image, np.full((height, width), 255, np.uint8)])
    return context.texture((width, height), 4, np.ascontiguousarray(rgba).tobytes())
