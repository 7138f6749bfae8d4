"""Whole records of a source: the same points as its chunks, in any selection."""

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.source import Chunk, Source


class ThreeChunks(Source):
    """Nine points in chunks of three."""

    def chunks(self):
        for first in (0, 3, 6):
            rows = np.arange(first, first + 3)
            yield Chunk(np.c_[rows, rows, rows].astype(float), np.c_[rows, rows, rows].astype(np.uint8),
                        rows.astype(np.uint16) * 100, scan=first // 3)


@pytest.mark.parametrize("numbers", [[0], [8], [2, 3], [0, 4, 8], list(range(9)), []])
def test_records_are_found_by_their_running_number(tmp_path, numbers):
    found = ThreeChunks(tmp_path / "a", "three").records(np.array(numbers, np.int64))
    assert found.xyz[:, 0].tolist() == numbers
    if numbers:
        assert found.rgb is not None and found.rgb[:, 2].tolist() == numbers
        assert found.columns["intensity"].tolist() == [100 * number for number in numbers]
        assert np.broadcast_to(found.scan, len(numbers)).tolist() == [number // 3 for number in numbers]


def test_a_file_with_fewer_points_than_before_is_refused(tmp_path):
    with pytest.raises(InputError, match="9 points, fewer than"):
        ThreeChunks(tmp_path / "a", "three").records(np.array([9]))
