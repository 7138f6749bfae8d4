"""The provenance map against its definition, pixel by pixel, on random pictures."""

import numpy as np
import pytest

from pointglass.viewer.picture.provenance import PROVENANCE, provenance, views_with_mask
from pointglass.viewer.picture.views import VIEWS


def plain(view: str, alpha: int, kept: bool) -> int:
    """Reference implementation, one pixel."""
    if alpha == 0:
        return 0
    if view == "raw":
        return 1
    if not kept:
        return 3
    return 2 if view == "neural" else 1


@pytest.mark.parametrize("view", VIEWS)
def test_each_pixel_is_what_the_definition_says(view, seed):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (23, 31, 4)).astype(np.uint8)
    image[..., 3] *= rng.random((23, 31)) < 0.7
    mask = rng.random((23, 31)) < 0.5
    found = provenance(view, image, mask)
    assert found.dtype == np.uint8 and found.shape == mask.shape and set(np.unique(found)) <= set(PROVENANCE)
    assert found.tolist() == [[plain(view, int(image[y, x, 3]), bool(mask[y, x])) for x in range(31)] for y in range(23)]


@pytest.mark.parametrize("view", VIEWS)
def test_a_picture_with_a_mask_holds_its_own_view_and_a_filtered_one(view):
    views = views_with_mask(view)
    assert view in views and set(views) - {"raw"}
