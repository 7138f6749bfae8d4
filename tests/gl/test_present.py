"""What the window shows of a picture, against the plain sum that the host repeats it by."""

import numpy as np
import pytest

from pointglass.viewer.picture.background import COLOURS, composite
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.window.viewport.present import Canvas

pytestmark = pytest.mark.gl


@pytest.mark.parametrize("column", [None, 0, 1, 30, 53])
@pytest.mark.parametrize("background", COLOURS)
def test_the_canvas_shows_what_the_host_would_put_together(context, seed, column, background):
    """Any alpha over the background, colours brighter than theirs among them; two pictures that meet at a line."""
    rng = np.random.default_rng(seed)
    left, right = images = rng.integers(0, 256, (2, 37, 53, 4)).astype(np.uint8)
    programs = Programs(context)
    canvas, textures = Canvas(context, programs, (53, 37)), [context.texture((53, 37), 4, image.tobytes()) for image in images]
    try:
        canvas.show(textures[0], None if column is None else textures[1], column or 0, background)
        whole = left if column is None else np.concatenate([left[:, :column], right[:, column:]], axis=1)
        assert np.array_equal(canvas.read(), composite(whole, background))
    finally:
        context.detect_framebuffer(0).use()  # the canvas must not stay bound
        for resource in (canvas, *textures, programs):
            resource.release()
