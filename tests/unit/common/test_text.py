"""Numbers with their nouns, as people say them."""

import pytest

from pointglass.viewer.common.text import bytes_text, counted


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
