"""Numbers with their nouns, as people say them."""

import pytest

from viewer.words import counted


@pytest.mark.parametrize(("number", "said"), [
    (0, "0 points"), (1, "1 point"), (1.0, "1 point"), (0.5, "0.5 points"), (2, "2 points"), (12_345_678, "12345678 points"),
])
def test_a_number_and_its_noun(number, said):
    assert counted(number, "point") == said
