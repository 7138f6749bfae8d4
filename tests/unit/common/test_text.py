"""Numbers with their nouns, as people say them."""

import numpy as np
import pytest

from pointglass.viewer.common.text import bytes_text, counted, table_places


@pytest.mark.parametrize(("number", "said"), [
    (0, "0 points"), (1, "1 point"), (1.0, "1 point"), (0.5, "0.5 points"), (2, "2 points"), (12_345_678, "12,345,678 points"),
])
def test_a_number_and_its_noun(number, said):
    assert counted(number, "point") == said


@pytest.mark.parametrize(("count", "said"), [
    (1, "1 byte"), (1023, "1,023 bytes"), (1024, "1 KiB"), (1_600, "1.562 KiB"), (12 << 20, "12 MiB"), (1023 << 20, "1023 MiB"),
    (6 << 30, "6 GiB"),
])
def test_a_number_of_bytes(count, said):
    assert bytes_text(count) == said


@pytest.mark.parametrize(("decimals", "offset"), [(3, 1.0), (3, 5_000_000.0), (4, -12.5), (7, 48.0), (6, 0.0)])
def test_a_coordinate_in_a_table_has_the_decimals_of_the_files_step(decimals, offset, seed):
    """Computed as readers of LAS do: a whole number times the step, and an offset."""
    scale, random = 10.0**-decimals, np.random.default_rng(seed)
    steps = random.integers(-(10**6), 10**6, (200, 3))
    for row, numbers in zip((steps * scale + offset).tolist(), steps.tolist(), strict=True):
        for text, value, number in zip(table_places(row), row, numbers, strict=True):
            assert len(text.partition(".")[2]) <= decimals and abs(float(text) - value) < scale / 100, (text, value)
            assert round((float(text) - offset) / scale) == number


def test_a_coordinate_of_32_bits_is_written_as_such_and_one_of_a_turned_scan_loses_what_it_may(seed):
    single = np.random.default_rng(seed).uniform(-1000, 1000, (100, 3)).astype(np.float32)
    for row in single:
        texts = table_places(row.tolist())
        assert np.array_equal(np.array(texts, np.float32), row)
        assert all(len(text.replace(".", "").strip("-0")) <= 9 for text in texts)
    assert table_places([0.4830000102519989, 1.5, 3.0]) == ["0.483", "1.5", "3"]
    assert table_places([12.345678901234567, -0.1, 1e-12], loss=1e-8) == ["12.3456789", "-0.1", "0"]
    assert table_places([float("nan"), 1e300, 0.1])[:2] == ["nan", "1e+300"]
