"""``pointglass report``: the pages of a project's viewpoints, notes and measurements, its issues and its table."""

import csv
import io
import re
import zipfile
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from dated_scans import dates_in_colour
from documents import random_note
from PIL import Image

from pointglass.viewer.cli import main
from pointglass.viewer.commands.report import report_job
from pointglass.viewer.commands.report.pages import WIDTH, Pages, line_width, wrapped
from pointglass.viewer.commands.report.report_pdf import Wording, picture_count, report_pages
from pointglass.viewer.commands.report.view_pictures import in_sight, view_of
from pointglass.viewer.commands.section.sheet_text import text_width
from pointglass.viewer.common import fonts
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.picture.camera import look_at
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.picture.dates.date_comparison import DateComparison
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.work.comparing.distance_statistics import BINS
from pointglass.viewer.work.comparing.scene_changes import keys_of
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.notes.shared_pictures import remember_attached
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.viewpoint import Viewpoint

BOUNDS = np.array([[0, 0, 0], [1, 2, 3.0]])
SCENE = cast(Any, SimpleNamespace(meta=ScanDescription(metres_per_unit=1.0), count=1234567, bounds=BOUNDS))


def view(name: str, eye=(4.0, 1.0, 1.5), at=(4.0, 5.0, 1.5)) -> Viewpoint:
    rows = look_at(np.array(eye, float), np.array(at, float))
    return Viewpoint(name, tuple(tuple(map(float, row)) for row in rows), 60.0)  # type: ignore[arg-type]


def written(figures) -> str:
    """All texts of all pages."""
    return "\n".join(text.get_text() for figure in figures for axes in figure.axes for text in axes.texts)


def test_lines_are_as_wide_as_the_page_and_lose_no_letter(seed):
    random = np.random.default_rng(seed)
    words = ["".join(random.choice(list("abcdeé ßÄ管"), random.integers(1, 90))) for _ in range(60)]
    text = "\n".join(" ".join(words[k : k + 7]) for k in range(0, 60, 7))
    lines = wrapped(text, 60.0, 9.5)
    assert all(line_width(line, 9.5) <= 60.0 for line in lines if len(line) > 1)
    assert all(abs(line_width(line, 9.5) - text_width(line, 9.5)) < 1.5 for line in lines if "管" not in line), "as it is drawn"
    assert "".join("".join(lines).split()) == "".join(text.split())
    assert wrapped("one\n\ntwo $x$\x00", 60.0, 9.5) == ["one", "", "two $x$\\x00"]


def test_pages_fill_from_the_top_and_nothing_is_below_the_foot(seed):
    random = np.random.default_rng(seed)
    pages = Pages("foot")
    for _ in range(60):
        if random.random() < 0.4:
            pages.pictures([(np.zeros((20, 30, 3), np.uint8), float(random.uniform(40, WIDTH)))])
        else:
            pages.text("word " * int(random.integers(1, 80)))
    figures = pages.finished()
    assert len(figures) > 3
    for figure in figures:
        assert all(axes.get_position().y0 * 297 >= 16 - 1e-6 for axes in figure.axes[1:])
        assert min(text.get_position()[1] for text in figure.axes[0].texts) == 9.0, "the foot line is the lowest"
        assert max(text.get_position()[1] for text in figure.axes[0].texts) <= 297 - 18


def test_the_report_has_every_note_viewpoint_and_measurement(tmp_path, seed):
    random = np.random.default_rng(seed)
    Image.fromarray(np.zeros((40, 60, 3), np.uint8)).save(tmp_path / "p.png")
    notes = tuple(replace(random_note(random, text, picture), link="https://a.org/b") for text, picture in (
        ("Crack $1$\nbehind it more", str(tmp_path / "p.png")), ("", str(tmp_path / "none.jpg")), ("x" * 300, "")))  # fmt: skip
    ends = tuple(MeasuredPoint(vector(random.normal(size=3)), 0.01, 0.001, "a") for _ in range(2))
    document = Document((ScanFile("/a/house é.laz"),), view=view("last view"), viewpoints=(view("Hall"), view("Attic")),
                        annotations=notes, measurements=(Measurement("distance", ends, "Beam"),))
    drawn, told, steps = [], [], []

    def picture(at, shown, numbers):
        drawn.append((at.name, numbers))
        return np.zeros((8, 12, 3), np.uint8)

    figures = report_pages(SCENE, document, document.viewpoints[:1], Wording("House", "A. Person", "2026-11-28"), picture,
                           told.append, lambda: steps.append(1))  # fmt: skip
    text = written(figures)
    for part in ("House", "A. Person", "house é.laz", "1,234,567 points", "Hall", "Crack $1$", "behind it more", "Note 2",
                 "Beam", "https://a.org/b", f"1 of {len(figures)}"):  # fmt: skip
        assert part in text, part
    assert "Attic" not in text and len(told) == 1 and "none.jpg" in told[0]
    assert [name for name, _ in drawn[:2]] == ["last view", "Hall"]
    assert [numbers for _, numbers in drawn[2:]] == [(0,), (1,), (2,)]
    assert len(steps) == picture_count(document, document.viewpoints[:1])


def test_a_note_is_seen_from_where_it_was_written_else_from_a_view_that_shows_it():
    ahead, behind = view("ahead"), view("behind", at=(4.0, -5.0, 1.5))
    note = Annotation("x", (4.2, 5.0, 1.4))
    assert in_sight(note, ahead) and not in_sight(note, behind)
    document = Document(view=behind, viewpoints=(behind, ahead))
    assert view_of(note, document) is ahead and view_of(replace(note, view=ahead), document) is ahead
    assert view_of(note, Document(view=behind)) is None
    assert view_of(replace(note, view=behind), Document()) is behind, "as a person wrote it, though it does not show the place"


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A wall with a note on it and one behind the camera."""
    folder = tmp_path_factory.mktemp("report")
    x, z = np.meshgrid(np.arange(0, 8, 0.02), np.arange(0, 3, 0.02))
    rows = np.stack([x.ravel(), np.full(x.size, 5.0), z.ravel(), *np.full((3, x.size), 90)], axis=1)
    np.savetxt(folder / "wall.xyz", rows, fmt="%.3f")
    Image.fromarray(np.zeros((40, 60, 3), np.uint8)).save(folder / "p.jpg")
    notes = (Annotation("Crack", (4.0, 5.0, 1.5), "done", picture=str(folder / "p.jpg"), view=view("")),
             Annotation("unseen", (4.0, -50.0, 1.5)))  # fmt: skip
    document = Document((ScanFile(str(folder / "wall.xyz")),), viewpoints=(view("Hall"),), annotations=notes,
                        settings=Settings(view="filled"))
    path = folder / "house.pointglass"
    write_project(path, document)
    return path


def test_the_command_writes_pages_issues_and_a_table(project, tmp_path, capsys):
    folder = ["--no-cache", "--author", "A. Person"]
    assert main(["report", str(project), "--out", str(tmp_path / "r.pdf"), *folder]) == 0
    data = (tmp_path / "r.pdf").read_bytes()
    pages = len(re.findall(rb"/Type /Page\b", data))
    assert f"{pages} page" in capsys.readouterr().out and data.count(b"/Subtype /Image") == 3
    assert main(["report", str(project), "--out", str(tmp_path / "r.bcf"), *folder]) == 0
    archive = zipfile.ZipFile(tmp_path / "r.bcf")
    (shown,) = [name for name in archive.namelist() if name.endswith("snapshot.png")]
    picture = np.asarray(Image.open(io.BytesIO(archive.read(shown))))
    assert np.abs(picture[400, 600].astype(int) - (127, 216, 139)).max() <= 3, "the marker, in the middle of the view"
    assert sum(name.endswith("p.jpg") for name in archive.namelist()) == 1
    assert main(["report", str(project), "--out", str(tmp_path / "r.csv"), *folder]) == 0
    assert [row["text"] for row in csv.DictReader((tmp_path / "r.csv").open())] == ["Crack", "unseen"]


def test_the_report_of_a_comparison_has_the_histogram_of_its_distances(tmp_path, seed, monkeypatch):
    scans = dates_in_colour(tmp_path, seed, 12_000)
    earlier, later = keys_of(open_scene(scans, cache=False))
    comparison = DateComparison(earlier, later, limit=0.6)
    document = Document(tuple(map(ScanFile, map(str, scans))), settings=Settings(view="filtered"), comparison=comparison,
                        view=view("last view", (1.0, 1.2, 2.6), (2.0, 2.5, 1.0)))  # fmt: skip
    pages = []
    monkeypatch.setattr(report_job, "write_figures", lambda out, figures: pages.append([figure for figure, _ in figures]))
    for shown in ("change", "after"):
        write_project(tmp_path / "p.pointglass", replace(document, comparison=replace(comparison, shown=shown)))
        assert main(["report", str(tmp_path / "p.pointglass"), "--out", str(tmp_path / "r.pdf"), "--no-cache"]) == 0
    of_change, of_one = map(written, pages)
    assert "after.xyz, compared with before.xyz" in of_change and "changed by more than" in of_change
    (bars,) = [axes.patches for figure in pages[0] for axes in figure.axes if len(axes.patches) == BINS]
    rose = [bar.get_height() for bar in bars if bar.get_x() > 0.3]
    assert sum(bar.get_height() for bar in bars) == pytest.approx(100) and 3 < sum(rose) < 8, "a sixteenth rose by 0.5"
    assert "Comparison" not in of_one, "one date alone has no distances"


@pytest.mark.parametrize(("options", "told"), [
    (["--out", "r.docx"], "--out r.docx: .docx is not written; use .pdf, .bcf, .bcfzip or .csv"),
    (["--out", "none/r.pdf"], "its folder does not exist"),
    (["--out", "r.pdf", "--viewpoint", "Cellar"], "the project has no such viewpoint; it has Hall"),
])
def test_what_cannot_be_made_is_refused_in_one_line(project, tmp_path, monkeypatch, capsys, options, told):
    monkeypatch.chdir(tmp_path)
    assert main(["report", str(project), *options]) == 2
    assert told in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_a_scan_has_no_report(project, tmp_path, capsys):
    assert main(["report", str(project.with_name("wall.xyz")), "--out", str(tmp_path / "r.pdf")]) == 2
    assert "a report is made of a project" in capsys.readouterr().err


def test_letters_that_no_font_has_are_named_once_in_reports_and_on_sheets(project, tmp_path, monkeypatch, capsys):
    def asked_again():
        fonts.machine_fonts.cache_clear()
        fonts.font_with.cache_clear()

    (tmp_path / "fonts").mkdir()
    asked_again()
    with monkeypatch.context() as patched:
        patched.setenv(fonts.ENVIRONMENT, str(tmp_path / "fonts"))
        for command, ending in (("report", "pdf"), ("section", "pdf"), ("section", "png"), ("section", "dxf")):
            cut = ["--elevation", "0", "--from", "0", "--title", "管Ø北管"] if command == "section" else ["--author", "管Ø北管"]
            assert main([command, str(project), *cut, "--out", str(tmp_path / f"{command}.{ending}"), "--no-cache"]) == 0
            line = "pointglass: warning: letters are drawn as boxes: no font on this machine has 管 北; install a font"
            assert capsys.readouterr().err.count(line) == (ending != "dxf"), (command, ending)
    asked_again()


@pytest.mark.slow
def test_a_picture_outside_the_project_is_sent_only_where_it_was_attached_here(project, tmp_path, capsys):
    def attached(stranger, out):
        assert main(["report", str(stranger), "--out", str(out), "--no-cache"]) == 0
        return [name for name in zipfile.ZipFile(out).namelist() if name.endswith(".jpg")]

    private = tmp_path / "private.jpg"
    Image.fromarray(np.full((30, 40, 3), 77, np.uint8)).save(private)
    (project.parent / "link.jpg").symlink_to(private)
    links = [(path, project.with_name(f"stranger{number}.pointglass"), tmp_path / f"{number}.bcf")
             for number, path in enumerate((private, project.parent / "link.jpg"))]
    for path, stranger, out in links:
        notes = (Annotation("look", (4.0, 5.0, 1.5), picture=str(path), view=view("")),)
        write_project(stranger, Document((ScanFile(str(project.with_name("wall.xyz"))),), annotations=notes))
        assert not attached(stranger, out)
        assert f"{path.name}: is left out: it lies outside the project's folder" in capsys.readouterr().err
        pdf = out.with_suffix(".pdf")
        assert main(["report", str(stranger), "--out", str(pdf), "--no-cache"]) == 0
        assert pdf.read_bytes().count(b"/Subtype /Image") == 1 and "is left out" in capsys.readouterr().err
    remember_attached(str(private))
    assert len(attached(*links[1][1:])) == 1 and "left out" not in capsys.readouterr().err
