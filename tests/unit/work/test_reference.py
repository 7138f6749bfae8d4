"""A reference system and a unit that a person assigns: found by code or name, undone, kept in the project, in every output."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pointglass.viewer import cli
from pointglass.viewer.commands.exporting.command import export
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.readers import crs
from pointglass.viewer.window.interaction.reference_panel import assign_crs, assign_unit
from pointglass.viewer.window.panels.status_bar import units_text
from pointglass.viewer.window.session.work import DocumentState
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import read_project, write_project
from pointglass.viewer.work.reference import UNITS, with_reference, wkt_of
from pointglass.viewer.work.selection import Selection


def small_scan(path, seed):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, 50, (3000, 3)) + (500_000, 5_000_000, 100)
    scene = scene_from_arrays(xyz, rng.integers(40, 256, (3000, 3), dtype=np.uint8))
    export(Selection(scene), path)
    return scene


class Context:
    """What the panel's actions use of a window."""

    def __init__(self, scene):
        work = DocumentState()
        work.begin([])
        work.accept()
        work.edit("open", scans=(ScanFile("a.laz"), ScanFile("b.laz")))
        self.scene, self.renewed = scene, 0
        self.session = type("Session", (), {"work": work})

    @property
    def document(self):
        return self.session.work.document

    @property
    def facts(self):
        return self.session.work.facts(self.scene.meta)

    def renew_picture(self):
        self.renewed += 1


@pytest.fixture
def context(seed):
    rng = np.random.default_rng(seed)
    return Context(scene_from_arrays(rng.random((200, 3)), np.full((200, 3), 90, np.uint8)))


def test_an_assignment_reaches_the_status_bar_and_is_undone(context):
    assert units_text(context.facts) == "unit unknown"
    assign_crs(context, "2225")
    assert units_text(context.facts) == "US ft · EPSG:2225" and not context.renewed
    assign_unit(context, UNITS["millimetre"])
    assert units_text(context.facts) == "mm · EPSG:2225"
    assign_crs(context, "EPSG:25832")
    assert units_text(context.facts) == "m · EPSG:25832", "a system brings its own unit"
    for expected in ("mm · EPSG:2225", "US ft · EPSG:2225", "unit unknown"):
        context.session.work.undo()
        assert units_text(context.facts) == expected
    context.session.work.redo()
    assert all(scan.crs == "EPSG:2225" for scan in context.document.scans)


@pytest.mark.parametrize("text", ["999999", "no such place", "EPSG:5783"])
def test_an_unknown_code_changes_nothing(context, text):
    before = context.document
    with pytest.raises(InputError, match=r"epsg\.io"):
        assign_crs(context, text)
    assert context.document is before


def test_without_pyproj_the_problem_is_told_and_the_scan_is_shown_as_the_file_says(context, monkeypatch):
    crs.assigned.cache_clear()
    monkeypatch.setattr(crs, "_crs", lambda definition: (_ for _ in ()).throw(ImportError("No module named 'pyproj'")))
    with pytest.raises(InputError, match="pip install pyproj"):
        assign_crs(context, "25832")
    scans = tuple(replace(scan, crs="EPSG:25832") for scan in context.document.scans)
    context.session.work.edit("as from a project", scans=scans)
    assert context.facts is context.scene.meta
    assert "pip install pyproj" in (context.session.work.reference_problem or "")
    context.session.work.undo()
    assert context.facts is context.scene.meta and context.session.work.reference_problem is None


def test_systems_are_found_by_code_name_and_area():
    systems = crs.catalogue()
    assert len({code for code, _, _ in systems}) == len(systems) > 5000
    assert crs.matching("25832", systems)[0][:2] == ("EPSG:25832", "ETRS89 / UTM zone 32N")
    assert crs.matching("epsg:2583", systems)[0][0] == "EPSG:2583"
    assert "EPSG:25833" in [code for code, _, _ in crs.matching("etrs89 33n", systems)]
    for _, name, area in crs.matching("lambert norway", systems):
        assert "lambert" in f"{name} {area}".lower() and "norway" in f"{name} {area}".lower()
    assert crs.matching("  ", systems) == [] == crs.matching("qqqq", systems)


@pytest.mark.parametrize("suffix", [".laz", ".e57"])
@pytest.mark.parametrize(("code", "metres", "expected"), [
    ("EPSG:25832", None, ("ETRS89 / UTM zone 32N", 1.0)),
    ("EPSG:2225", None, ("NAD83 / California zone 1 (ftUS)", 1200 / 3937)),
    (None, 0.001, ("local coordinates", 0.001)), ("EPSG:25832", 0.01, ("EPSG:25832 in centimetre", 0.01)),
])
def test_an_export_opened_again_has_what_was_assigned(tmp_path, seed, suffix, code, metres, expected):
    rng = np.random.default_rng(seed)
    scene = scene_from_arrays(rng.random((500, 3)), rng.integers(40, 256, (500, 3), dtype=np.uint8))
    meta = with_reference(scene.meta, [ScanFile("a.laz", metres_per_unit=metres, crs=code)])
    out = tmp_path / f"out{suffix}"
    export(Selection(replace(scene, meta=meta)), out)
    again = open_scene([out], cache=False).meta
    assert again.crs == expected[0]
    if suffix == ".laz":  # E57 is in metres by its standard
        assert again.metres_per_unit == pytest.approx(expected[1], rel=1e-9)


def test_nothing_assigned_changes_nothing(seed):
    meta = ScanDescription(crs="x", units="foot", metres_per_unit=0.3048)
    assert with_reference(meta, [ScanFile("a.laz")]) is meta and wkt_of(meta) is None


def test_info_and_export_of_a_project_agree_with_what_was_assigned(tmp_path, capsys, seed):
    small_scan(tmp_path / "a.laz", seed)
    capsys.readouterr()
    project = tmp_path / "p.pointglass"
    write_project(project, Document((ScanFile(str(tmp_path / "a.laz"), crs="EPSG:2225"),)))
    assert read_project(project).scans[0].crs == "EPSG:2225"
    assert cli.main(["info", str(project), "--json", "--no-cache"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["crs"], facts["units"]) == ("EPSG:2225", "US survey foot")
    assert facts["metres_per_unit"] == pytest.approx(1200 / 3937, rel=1e-12)
    assert cli.main(["info", str(project), "--no-cache"]) == 0
    assert "EPSG:2225 (assigned in the project)" in capsys.readouterr().out
    assert cli.main(["export", str(project), "--out", str(tmp_path / "b.laz"), "--no-cache"]) == 0
    capsys.readouterr()
    assert cli.main(["info", str(tmp_path / "b.laz"), "--json", "--no-cache"]) == 0
    assert json.loads(capsys.readouterr().out)["crs"].startswith("NAD83 / California")
    write_project(project, Document((ScanFile(str(tmp_path / "a.laz"), crs="EPSG:1"),)))
    assert cli.main(["info", str(project), "--no-cache"]) == 2
    assert "EPSG:1: there is no such" in capsys.readouterr().err
