"""The description of a scan: what is written is read back, older files lack entries, and a stranger's are refused by name."""

import json

import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.json_values import to_json
from pointglass.viewer.preprocess.point_attributes import AttributeLayout
from pointglass.viewer.preprocess.scan_description import (
    NO_DESCRIPTION,
    Assigned,
    ColourSummary,
    DroppedPoints,
    ExposureSummary,
    RecordOrigin,
    RunSummary,
    ScanDescription,
    ScanSummary,
    ScanWarning,
    WarningTopic,
    described_scan,
)

FULL = ScanDescription(
    ("/a/left.laz", "/a/right.e57"), "LAZ, E57", "foot", 0.3048, "Oregon", True,
    (*(ScanWarning("what it is", topic, "a.las: " if topic is WarningTopic.DEGREES else "") for topic in WarningTopic),
     ScanWarning("left.laz: 8-bit colour, left out: nothing")),
    RecordOrigin((0, 5, 9), (0, 5), (1, 2), {1: (7, 8)}, (("/a/left.laz", 12, 1 << 60), ("/a/right.e57", 3, 4)), "x y z",
                 (None, ((0.0, -1.0, 0.0, 5.0), (1.0, 0.0, 0.0, 1e6), (0.0, 0.0, 1.0, -2.5), (0.0, 0.0, 0.0, 1.0)))),
    ColourSummary("rgb", 16, "16-bit colour", 0.25), ExposureSummary(3, 2, True, 0.8, 1.25), RunSummary(0.5, False),
    AttributeLayout({2: 7, 6: 2}, 3, 9000, None), DroppedPoints(1, 2, 3),
    (ScanSummary("tripod", 5, (1.0, 2.0, 1e7), True), ScanSummary("other", 4)),
)  # fmt: skip


@pytest.mark.parametrize("known", [FULL, NO_DESCRIPTION])
def test_what_is_written_is_read_back(known):
    assert described_scan(json.loads(json.dumps(to_json(known), allow_nan=False))) == known


def test_an_entry_that_an_earlier_version_lacks_has_its_default_and_a_later_versions_one_is_ignored():
    for name, value in to_json(FULL).items():
        rest = {key: other for key, other in to_json(FULL).items() if key != name}
        found = described_scan(rest | {"of the future": value})
        assert getattr(found, name) == getattr(NO_DESCRIPTION, name)


def test_what_a_person_assigned_is_no_part_of_the_file():
    made = ScanDescription(crs="x", assigned=Assigned(crs=True))
    assert "assigned" not in to_json(made) and not described_scan(to_json(made) | {"assigned": {"crs": True}}).assigned


@pytest.mark.parametrize("entry, wrong, named", [
    ("sources", ["a", 5], "meta.sources[1]"), ("metres_per_unit", 0, "meta.metres_per_unit"),
    ("metres_per_unit", float("inf"), "meta.metres_per_unit"), ("match", 1, "meta.match"),
    ("warnings", [None], "meta.warnings[0]"), ("scans", [{"name": "a", "count": -1}], "meta.scans[0].count"),
    ("scans", [{"name": "a"}], "meta.scans[0].count is missing"),
    ("scans", [{"name": "a", "count": 1, "position": [0, 1]}], "meta.scans[0].position"),
    ("records", {"turns": {"x": [1]}}, "meta.records.turns"), ("records", {"files": [["a", 1]]}, "meta.records.files[0]"),
    ("records", {"moves": [[[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]]}, "meta.records"),
    ("records", {"first": [1 << 62]}, "meta.records.first[0]"), ("colour", [], "meta.colour"),
    ("attributes", {"class": {"256": 1}}, "meta.attributes.class"), ("dropped", {"nan": True}, "meta.dropped.nan"),
])  # fmt: skip
def test_a_wrong_entry_is_refused_by_its_name(entry, wrong, named):
    with pytest.raises(InputError) as error:
        described_scan(to_json(FULL) | {entry: wrong})
    assert str(error.value).startswith(named) and "\n" not in str(error.value)


@pytest.mark.parametrize("topic", WarningTopic)
def test_a_warning_keeps_its_topic_in_the_file_and_its_text_is_one_line(topic):
    text = f"{'a.las: ' if topic is WarningTopic.DEGREES else ''}{topic.value}x"
    found = described_scan({"warnings": [text, "a plain one"]})
    assert found.warning_texts == [text, "a plain one"] == to_json(found)["warnings"]
    assert [warning.detail for warning in found.warnings_about(topic)] == ["x"]
