"""Named columns of text files: in Python and where a point is inspected, by the name that the header gives them."""

import numpy as np
import pytest

import pointglass
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.records.file_records import FileRecords

HEADER = ("GPSTime", "Return Number", "Dip (degrees)")
NAMES = ("GPSTime", "Return Number", "Dip")
"""Without units in brackets."""


@pytest.mark.parametrize("name", ["a.csv", "a.txt"])
def test_named_columns_of_text_are_there_for_every_point(tmp_path, monkeypatch, name):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    rng = np.random.default_rng(4)
    xyz = np.round(rng.random((3000, 3)) * 4, 4)
    values = np.column_stack([3e5 + np.arange(3000) / 8, rng.integers(1, 6, 3000), np.round(rng.normal(0, 40, 3000), 3)])
    mark = "," if name == "a.csv" else "\t"
    np.savetxt(tmp_path / name, np.c_[xyz, values], fmt="%.4f", delimiter=mark, header=mark.join(["X", "Y", "Z", *HEADER]),
               comments="")  # fmt: skip
    points = pointglass.open(tmp_path / name).points
    assert set(NAMES) <= set(points.attributes)
    at = np.lexsort(xyz.T)
    order = np.lexsort(points.xyz.T)
    for index, column in enumerate(NAMES):
        np.testing.assert_array_equal(points[column][order], values[at, index])
        np.testing.assert_array_equal(points[order[:7]][column], values[at[:7], index])  # few, read one by one
    found = FileRecords(open_scene(tmp_path / name)).of(order[5:6])  # as a point is inspected
    assert found.exact and [found.columns[column][0] for column in NAMES] == values[at[5]].tolist()
