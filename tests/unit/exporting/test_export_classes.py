"""Regions and classes on export: exactly the chosen records, exactly their class changed, all other bytes as in the file."""

import json
from dataclasses import replace

import laspy
import numpy as np
import pytest
from las_files import WAVEFORMS, random_las
from untyped import any_typed, read_las

import pointglass
from pointglass.viewer.cli import main
from pointglass.viewer.picture.point_sets import PointSet
from pointglass.viewer.picture.regions import ClassChange, Region
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import read_project, write_project

FORMATS = [number for number in range(11) if number not in WAVEFORMS]


def raw(path) -> np.ndarray:
    return np.array(laspy.read(path).points.array)


def project_of(folder, path, random):
    """A project with a hidden region, one that is shown, and two classes given; and the masks of these, by record."""
    count = laspy.read(path).header.point_count
    key = ((path.name, count),)
    hidden, first, other = (random.random(count) < share for share in (0.3, 0.4, 0.2))
    first &= ~other
    regions = Region("gone", PointSet.of(hidden, key), shown=False), Region("roof", PointSet.of(other, key))
    changes = ClassChange(6, PointSet.of(first, key)), ClassChange(17, PointSet.of(other, key))
    document = Document((ScanFile(str(path)),), regions=regions, reclassified=changes)
    write_project(folder / "work.pointglass", document)
    return folder / "work.pointglass", hidden, first, other


@pytest.mark.parametrize("name", ["scan.las", "scan.laz"])
def test_export_changes_the_class_of_exactly_these_points_and_nothing_else(tmp_path, seed, name):
    random = np.random.default_rng(seed)
    path = tmp_path / name
    point_format = random_las(path, seed, point_format=int(random.choice(FORMATS)))
    before = raw(path)
    project, hidden, first, other = project_of(tmp_path, path, random)
    for more, kept in (((), ~hidden), (("--region", "roof"), other & ~hidden), (("--region", "gone"), hidden)):
        if not kept.any():
            continue
        assert main(["export", str(project), "--out", str(tmp_path / "out.laz"), "--no-cache", *more]) == 0
        wanted = before.copy()
        if point_format < 6:
            flags = wanted["raw_classification"] & 0xE0
            wanted["raw_classification"][first], wanted["raw_classification"][other] = flags[first] | 6, flags[other] | 17
        else:
            wanted["classification"][first], wanted["classification"][other] = 6, 17
        assert raw(tmp_path / "out.laz").tobytes() == wanted[kept].tobytes()
    assert raw(path).tobytes() == before.tobytes()


def test_export_of_classes_goes_by_the_present_class(tmp_path, seed):
    random = np.random.default_rng(seed)
    path = tmp_path / "scan.las"
    random_las(path, seed, point_format=6, count=2000)
    project, hidden, first, other = project_of(tmp_path, path, random)
    classes = np.array(laspy.read(path).classification)
    classes[first], classes[other] = 6, 17
    document = replace(read_project(project), hidden_classes=(17,))
    write_project(project, document)
    assert main(["export", str(project), "--out", str(tmp_path / "out.las"), "--no-cache", "--class", "6,17"]) == 0
    assert np.array_equal(np.array(laspy.read(tmp_path / "out.las").classification), classes[(classes == 6) & ~hidden])
    assert main(["export", str(path), "--out", str(tmp_path / "own.las"), "--no-cache", "--class", "6"]) == 0
    assert len(laspy.read(tmp_path / "own.las").points) == (np.array(laspy.read(path).classification) == 6).sum()


def test_info_of_a_project_says_which_points_it_hides_and_gives_a_class(tmp_path, seed, capsys):
    path = tmp_path / "scan.las"
    random_las(path, seed, point_format=6, count=2000)
    project, hidden, first, other = project_of(tmp_path, path, np.random.default_rng(seed))
    held = ["2 regions", f"{hidden.sum():,} points in regions that are not shown",
            f"a new class for {first.sum() + other.sum():,} points"]  # fmt: skip
    assert main(["info", str(project), "--no-cache"]) == 0
    assert f"project  {', '.join(held)}" in capsys.readouterr().out
    assert main(["info", str(project), "--no-cache", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["project"] == held


@pytest.mark.parametrize("target", ["ply", "e57"])
def test_other_formats_have_the_class_or_a_line_says_that_they_do_not(tmp_path, seed, target, capfd):
    path = tmp_path / "scan.las"
    random_las(path, seed, point_format=1, count=500)
    project, hidden, first, other = project_of(tmp_path, path, np.random.default_rng(seed))
    out = tmp_path / f"out.{target}"
    assert main(["export", str(project), "--out", str(out), "--no-cache"]) == 0
    assert main(["export", str(out), "--out", str(tmp_path / "back.las"), "--no-cache"]) == 0
    classes = np.array(laspy.read(path).classification)
    classes[first], classes[other] = 6, 17
    assert np.array_equal(np.array(laspy.read(tmp_path / "back.las").classification), classes[~hidden])


def test_bad_options_are_refused_in_a_line(tmp_path, seed, capfd):
    path = tmp_path / "scan.las"
    random_las(path, seed, point_format=1, count=100)
    for more, words in ((("--class", "ground"), "expected codes"), (("--region", "roof"), "no such region")):
        assert main(["export", str(path), "--out", str(tmp_path / "out.las"), "--no-cache", *more]) == 2
        assert words in capfd.readouterr().err and not (tmp_path / "out.las").exists()
    key = ((path.name, 100),)
    high = ClassChange(64, PointSet.of(np.ones(100, bool), key))
    write_project(tmp_path / "high.pointglass", Document((ScanFile(str(path)),), reclassified=(high,)))
    assert main(["export", str(tmp_path / "high.pointglass"), "--out", str(tmp_path / "out.las"), "--no-cache"]) == 2
    assert "0 to 31" in capfd.readouterr().err and not (tmp_path / "out.las").exists()


def test_a_set_of_another_file_does_nothing_and_a_line_says_so(tmp_path, seed, capfd):
    path = tmp_path / "scan.las"
    random_las(path, seed, point_format=1, count=100)
    project, *_ = project_of(tmp_path, path, np.random.default_rng(seed))
    random_las(path, seed + 1, point_format=1, count=101)
    write_project(project, read_project(project))  # a person has looked at the other file and saved
    assert main(["export", str(project), "--out", str(tmp_path / "out.las"), "--no-cache"]) == 0
    assert "another number of points now" in capfd.readouterr().err
    assert raw(tmp_path / "out.las").tobytes() == raw(path).tobytes()


def test_classes_given_to_another_file_are_not_written_before_a_person_has_looked(tmp_path, seed, capfd):
    """Sets go by numbers of records: the same points in another order are other points, and only the checksum tells."""
    path, out = tmp_path / "scan.las", tmp_path / "out.las"
    random_las(path, seed, point_format=1, count=100)
    project, *_ = project_of(tmp_path, path, np.random.default_rng(seed))
    assert main(["export", str(project), "--out", str(out), "--no-cache"]) == 0
    out.unlink()
    scan = read_las(path)
    scan.points = scan.points[np.arange(99, -1, -1)]
    scan.write(path)
    assert main(["export", str(project), "--out", str(out), "--no-cache"]) == 2
    said = capfd.readouterr().err.strip().splitlines()[-1]
    assert all(part in said for part in ("scan.las", "another file of this name", "may hold other points", "save the project"))
    assert not out.exists()
    write_project(project, read_project(project))
    assert main(["export", str(project), "--out", str(out), "--no-cache"]) == 0


def test_python_exports_classes(tmp_path, seed):
    path = tmp_path / "scan.las"
    random_las(path, seed, point_format=6, count=2000)
    classes = np.array(laspy.read(path).classification)
    with pointglass.open(path, cache=False) as scan:
        count = scan.export(tmp_path / "out.las", classes=[2, 6, 9])
        with pytest.raises(pointglass.PointglassError, match="expected codes"):
            scan.export(tmp_path / "no.las", classes=any_typed(["ground"]))
    assert count == np.isin(classes, (2, 6, 9)).sum()
    assert raw(tmp_path / "out.las").tobytes() == raw(path)[np.isin(classes, (2, 6, 9))].tobytes()


def test_a_class_that_no_point_has_is_named_with_those_that_there_are(tmp_path, capsys):
    las = laspy.create(point_format=6, file_version="1.4")
    las.xyz = np.random.default_rng(5).random((100, 3))
    las.classification = np.repeat([2, 6], 50)
    las.write(tmp_path / "a.las")
    for ending, asked, said in ((".las", "77", "no point has class 77; give some of those that there are: 2, 6"),
                                (".spz", "7,77", "no point has class 7 or 77"),
                                (".e57", "6,77", None)):
        out = tmp_path / f"b{ending}"
        code = main(["export", str(tmp_path / "a.las"), "--class", asked, "--out", str(out), "--no-cache"])
        assert (code, out.exists()) == ((2, False) if said else (0, True))
        assert (said or "50 points in") in "".join(capsys.readouterr())
    clip = ["--class", "2", "--clip", "5,5,5,6,6,6"]
    assert main(["export", str(tmp_path / "a.las"), *clip, "--out", str(tmp_path / "c.las"), "--no-cache"]) == 2
    assert "leave no point of class 2" in capsys.readouterr().err
