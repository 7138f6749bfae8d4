"""The compiled conversion of LAS records equals laspy's own, of every point format, on random bytes."""

import laspy
import numpy as np
import pytest

from pointglass.viewer.readers.las.las_conversion import chunk_of_records
from pointglass.viewer.readers.las.las_source import _chunk


@pytest.mark.parametrize("point_format", range(11))
def test_conversion_equals_that_of_laspy(point_format, seed):
    rng = np.random.default_rng(seed)
    form = laspy.PointFormat(point_format)
    form.add_extra_dimension(laspy.ExtraBytesParams("more", "uint8"))  # lengths and offsets become odd
    records = np.frombuffer(rng.bytes(5000 * form.size), form.dtype())
    scales, offsets = rng.normal(size=3) * (1e-3, 1.0, 1e7), rng.normal(size=3) * (1e6, 0.1, 1.0)
    expected = _chunk(laspy.ScaleAwarePointRecord(records, form, scales, offsets), set(form.dimension_names))
    found, bounds = chunk_of_records(records, scales, offsets)
    for name in ("xyz", "rgb", "intensity", "station", "classification"):
        one, other = getattr(expected, name), getattr(found, name)
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_array_equal(one, other, strict=True)
    np.testing.assert_array_equal(bounds, [expected.xyz.min(axis=0), expected.xyz.max(axis=0)])
