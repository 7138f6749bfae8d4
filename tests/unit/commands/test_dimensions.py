"""Measured lengths on sheets and in drawings of a cut, by the command, read back by ezdxf and as texts of a PDF."""

import re
import zlib
from typing import Any

import ezdxf
import numpy as np
import pytest
from test_paper_sheets import AT, SIDES, room  # noqa: F401

from pointglass.viewer import cli
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.work.dimensioning.dimensions import Dimension, laid_apart
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.fits.fit import Fit
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.project import write_project

RADIUS, THIN = 0.35, 0.0215


@pytest.fixture
def project(room, tmp_path):  # noqa: F811
    """The width of the room in the cut, three times; a height; a way that leans out of a plan; one beside the plan; two pipes,
    of which the thin one is wide enough for a dimension at 1:20, but not at 1:50."""
    def between(kind: str, first, second) -> Measurement:
        ends = [np.array(end) * [*SIDES, 1.0] + [*AT, 0.0] for end in (first, second)]
        return Measurement(kind, tuple(MeasuredPoint(vector(end), noise=0.001) for end in ends), kind)

    def pipe(x: float, radius: float) -> Measurement:
        fit = Fit("pipe", (AT[0] + x, AT[1] + 2.0, 0.0), (0.0, 0.0, 1.0), radius, 0.0, 2.0, 180.0, 0.001, 500,
                  radius_uncertainty=0.002, tilt_uncertainty=0.1)
        return Measurement("pipe", (MeasuredPoint(vector(np.array([AT[0] + x + radius, AT[1] + 2.0, 1.0])), fit=fit),), "pipe")

    made = [*(between("distance", (0, 0.5, 1.2), (1, 0.5, 1.2)) for _ in range(3)),
            between("height", (0.5, 0.5, 0), (0.5, 0.5, 2)),
            between("distance", (0.2, 0.2, 1.15), (0.2, 0.3, 1.25)), between("distance", (0, 0, 2.4), (1, 0, 2.4)),
            pipe(3.0, RADIUS), pipe(5.0, THIN)]
    write_project(tmp_path / "p.pointglass", Document((ScanFile(str(room)),), measurements=tuple(made)))
    return tmp_path / "p.pointglass"


def test_lengths_in_a_cut_are_dimensions_of_a_drawing(project, tmp_path, capsys):
    out = tmp_path / "plan.dxf"
    assert cli.main(["section", str(project), "--plan", "1.2", "--out", str(out)]) == 0
    drawing = ezdxf.readfile(out)  # type: ignore[reportPrivateImportUsage]
    assert not drawing.audit().has_errors and drawing.styles.get("POINTGLASS").dxf.font == "arial.ttf"
    found: list[Any] = list(drawing.modelspace().query('DIMENSION[layer=="POINTGLASS DIMENSIONS"]'))
    leaning = 0.1 * SIDES[1]
    assert sorted(each.get_measurement() for each in found) == pytest.approx(
        sorted([SIDES[0]] * 3 + [leaning, 2 * RADIUS]), rel=1e-9)
    texts = {each.dxf.text for each in found}
    assert "Ø <> ± 0.004 units" in texts and f"<> ({np.hypot(leaning, 0.1):.3f} ± 0.003 units in space)" in texts
    lines = [each.dxf.defpoint.y for each in found if each.get_measurement() > 1]
    assert np.diff(sorted(lines)).min() > 0.05, "dimensions of one length lie apart"
    assert cli.main(["section", str(project), "--line", f"{AT[0]},{AT[1] + 3},{AT[0] + 8},{AT[1] + 3}", "--out", str(out)]) == 0
    section: Any = ezdxf.readfile(out).modelspace().query("DIMENSION")  # type: ignore[reportPrivateImportUsage]
    assert sorted(each.get_measurement() for each in section) == pytest.approx([2.0] + [SIDES[0]] * 3, rel=1e-9)
    assert cli.main(["section", str(project), "--plan", "1.2", "--no-dimensions", "--out", str(out)]) == 0
    assert not ezdxf.readfile(out).modelspace().query("DIMENSION")  # type: ignore[reportPrivateImportUsage]


@pytest.mark.parametrize(("options", "count"), [([], 5), (["--scale", "1:20"], 6), (["--scale", "1:500"], 3),
                                                (["--paper", "A0"], 6), (["--paper", "A4"], 5)])
def test_a_sheet_has_the_dimensions_of_the_drawing(project, tmp_path, options, count):
    out, sizes = tmp_path / "plan.pdf", []
    line = ["section", str(project), "--plan", "1.2", *options, "--no-picture", "--trace"]
    for without in ([], ["--no-dimensions"]):
        assert cli.main([*line, *without, "--out", str(out)]) == 0
        data = out.read_bytes()
        streams = [zlib.decompressobj().decompress(part.split(b"stream\n", 1)[1]) for part in data.split(b"endobj")
                   if b"FlateDecode" in part and b"stream\n" in part and b"/Length" in part]
        sizes.append(sum(stream.count(b"Tj") + stream.count(b"TJ") for stream in streams))
    assert cli.main([*line, "--out", str(out.with_suffix(".dxf"))]) == 0
    drawing = ezdxf.readfile(out.with_suffix(".dxf"))  # type: ignore[reportPrivateImportUsage]
    assert sizes[0] - sizes[1] == count, "as many texts more as there are dimensions"
    assert len(drawing.modelspace().query("DIMENSION")) == count


def test_sides_totals_and_areas_are_drawn_in_the_frame_and_what_is_too_short_is_counted(room, tmp_path, capsys):  # noqa: F811
    def at(*places) -> tuple[MeasuredPoint, ...]:
        return tuple(MeasuredPoint(vector(np.array([AT[0] + x, AT[1] + y, 1.2])), noise=0.001) for x, y in places)

    wide, deep = SIDES
    made = [Measurement("polyline", at((1, 1), (4, 1), (4, 3)), "way"),
            Measurement("area", at((5, 1), (7, 1), (7, 4), (5, 4)), "a"),
            *(Measurement("distance", at((0, y), (wide, y)), "wall") for y in (0, deep)),
            Measurement("distance", at((2, 2), (2.001, 2)), "short")]
    project, out = tmp_path / "p.pointglass", tmp_path / "plan.dxf"
    write_project(project, Document((ScanFile(str(room)),), measurements=tuple(made)))
    assert cli.main(["section", str(project), "--plan", "1.2", "--out", str(out)]) == 0
    said = "1 measured length without a dimension: shorter than 2 mm on paper, or seen from the end"
    printed = capsys.readouterr().out
    assert said in printed and " units in all" in printed
    space: Any = ezdxf.readfile(out).modelspace()  # type: ignore[reportPrivateImportUsage]
    found = list(space.query("DIMENSION"))
    assert sorted(each.get_measurement() for each in found) == pytest.approx(sorted([3.0, 2.0, wide, wide]))
    (frame,) = space.query('LWPOLYLINE[layer=="POINTGLASS FRAME"]')
    (left, bottom), _, (right, top), _ = (place[:2] for place in frame.get_points())
    assert all(left < each.dxf.text_midpoint.x < right and bottom < each.dxf.text_midpoint.y < top
               and bottom < each.dxf.defpoint.y < top for each in found)
    area, perimeter, total = sorted(space.query("MTEXT"), key=lambda each: ["6.00", "peri", "tota"].index(each.text[:4]))
    assert area.text.endswith(" units²")
    assert re.fullmatch(r"perimeter 10\.00\d* ± 0\.00\d+ units", perimeter.text)
    assert re.fullmatch(r"total 5\.00\d* ± 0\.00\d+ units", total.text)
    assert area.dxf.insert.x == perimeter.dxf.insert.x == pytest.approx(AT[0] + 6)
    assert (area.dxf.insert.y + perimeter.dxf.insert.y) / 2 == pytest.approx(AT[1] + 2.5)
    assert area.dxf.insert.y > perimeter.dxf.insert.y + area.dxf.char_height
    assert total.dxf.insert.x == pytest.approx(AT[0] + 4) and total.dxf.insert.y > AT[1] + 3 + total.dxf.char_height
    assert cli.main(["section", str(project), "--plan", "1.2", "--trace", "--out", str(out.with_suffix(".pdf"))]) == 0
    printed = capsys.readouterr().out
    assert said in printed and " m in all" in printed  # a sheet has a scale and takes an unnamed unit as the metre, as it says


def test_no_text_lies_on_another_or_on_a_line(seed):
    random = np.random.default_rng(seed)
    for _ in range(5):
        ends = random.uniform(0, 10, (12, 2, 2))
        ends[6:, 1, 1] = ends[6:, 0, 1] = random.uniform(4, 6)  # level, over each other
        made = [Dimension(tuple(a), tuple(b), "<> ± 0.003 m", 3) for a, b in ends.tolist()]
        found = laid_apart(made, 0.1, lambda text: 0.06 * len(text))
        assert [(each.start, each.end) for each in found] == [(each.start, each.end) for each in made]
        middles = []
        for each in found:
            turn = np.radians(each.angle)
            assert -90 < each.angle <= 90 + 1e-6
            middles.append(each.line.mean(axis=0) + 0.1 * np.array([-np.sin(turn), np.cos(turn)]))
        far = np.linalg.norm(np.array(middles)[:, None] - middles, axis=2) + np.eye(12)
        assert far.min() > 0.14, "texts lie apart by their height at least"
