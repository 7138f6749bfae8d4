"""Sets of points: what they hold is what was put in, through JSON too, and damage is one line."""

import json
from typing import Any

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.json_values import from_json, to_json
from pointglass.viewer.picture.point_sets import NO_POINTS, PointSet
from pointglass.viewer.picture.regions import ClassChange


def test_a_set_holds_the_records_that_it_was_made_of(seed):
    random = np.random.default_rng(seed)
    for _ in range(50):
        files = tuple((f"scan {n % 2}.laz", int(random.integers(1, 40))) for n in range(random.integers(1, 5)))
        mask = random.random(sum(count for _, count in files)) < random.choice([0.0, 0.05, 0.5, 1.0])
        made = PointSet.of(mask, files)
        read = from_json(PointSet, json.loads(json.dumps(to_json(made))), "set")
        assert read == made and hash(read) == hash(made)
        assert np.array_equal(made.mask(files), mask) and made.count == mask.sum() and bool(made) == mask.any()
        assert made.unknown(files) == 0


def test_a_set_stays_with_its_files_where_others_come_and_go(seed):
    random = np.random.default_rng(seed)
    a, b = ("a.las", 30), ("b.las", 20)
    mask = random.random(50) < 0.5
    made = PointSet.of(mask, (a, b))
    assert np.array_equal(made.mask((("c.las", 7), b)), np.concatenate([np.zeros(7, bool), mask[30:]]))
    assert made.unknown((b,)) == mask[:30].sum()
    assert not made.mask((("a.las", 31),)).any()  # another file of that name


@pytest.mark.parametrize(("change", "words"), [
    (lambda item: item.update(runs="*"), "base64"), (lambda item: item.update(runs="AAAA"), "damaged"),
    (lambda item: item.update(records=2), "damaged"), (lambda item: item.update(records=0), "above 0"),
    (lambda item: item.pop("file"), "expected file"), (lambda item: item.update(more=1), "expected file"),
])  # fmt: skip
def test_a_damaged_set_is_refused_in_words(change, words):
    data: Any = to_json(PointSet.of(np.arange(100) % 3 == 0, (("a.las", 100),)))
    change(data[0])
    with pytest.raises(InputError, match=words):
        from_json(PointSet, data, "document.selection")


def test_no_points_is_empty():
    assert not NO_POINTS and NO_POINTS.count == 0 and not NO_POINTS.mask((("a", 3),)).any()


def test_edits_refuse_classes_that_cannot_be_drawn():
    some = PointSet.of(np.ones(3, bool), (("a", 3),))
    with pytest.raises(InputError, match="126 can be"):
        Edits(reclassified=tuple(ClassChange(code, some) for code in range(127)))
    with pytest.raises(InputError, match="one entry"):
        Edits(reclassified=(ClassChange(6, some), ClassChange(6, some)))
    with pytest.raises(InputError, match="from 0 to 255"):
        ClassChange(256, some)
