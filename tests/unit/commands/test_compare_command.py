"""``pointglass compare``: its three files, what it refuses, and that failures leave nothing."""

import csv
from itertools import pairwise

import laspy
import numpy as np
import pytest
from cloud_files import write_ply
from matplotlib.figure import Figure
from PIL import Image
from untyped import any_typed, read_las

import pointglass
from pointglass.viewer.cli import main
from pointglass.viewer.commands.comparing.change_map import VIEWS, change_map
from pointglass.viewer.commands.comparing.command import FILES
from pointglass.viewer.commands.comparing.distances_laz import coordinate_steps
from pointglass.viewer.work.comparing.distance_statistics import NO_COUNTERPART, colours_of, statistics_of


def write_las(path, xyz, *, crs=None, step=1e-4, **dimensions) -> str:
    """LAS 1.4 of (n, 3) points, without colour."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, step), np.floor(xyz.min(axis=0))
    if crs is not None:
        import pyproj

        header.add_crs(pyproj.CRS(crs))
    made = laspy.LasData(header)
    made.x, made.y, made.z = xyz.T
    for name, values in dimensions.items():
        made[name] = values
    made.write(str(path))
    return str(path)


def floor(random, count: int, origin=(3.0, 5.0, 2.0)) -> np.ndarray:
    return np.c_[random.uniform(0, 2, (count, 2)), random.normal(0, 0.002, count)] + origin


@pytest.fixture
def scans(seed, tmp_path):
    """Paths of a floor twice, a quarter of which is 5 mm higher and an eighth of which has no counterpart."""
    random = np.random.default_rng(seed)
    before, after = floor(random, 80_000), floor(random, 80_000)
    before = before[before[:, 0] < 4.75]
    after[(after[:, 0] < 4) & (after[:, 1] < 6), 2] += 0.005
    classes = random.integers(1, 7, len(after)).astype(np.uint8)
    intensity = random.integers(0, 65536, len(after)).astype(np.uint16)
    return (write_las(tmp_path / "before.las", before),
            write_las(tmp_path / "after.las", after, classification=classes, intensity=intensity), tmp_path)


def table(path) -> dict[str, dict[str, str]]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        rows = list(csv.DictReader(file))
    return {kind: {row["name"]: row["value"] for row in rows if row["table"] == kind} for kind in ("comparison", "statistic")}


@pytest.mark.slow
@pytest.mark.parametrize("method", ["m3c2", "c2c"])
def test_points_table_and_picture_show_a_lifted_quarter(scans, method, capsys):
    before, after, folder = scans
    out = folder / "new" / "out"
    assert main(["compare", before, after, "--out", str(out), "--method", method]) == 0
    assert sorted(path.name for path in out.iterdir()) == sorted(FILES)
    made, own = read_las(out / "distances.laz"), read_las(after)
    np.testing.assert_allclose(made.xyz, own.xyz, atol=1e-4)
    np.testing.assert_array_equal(made.classification, own.classification)
    np.testing.assert_array_equal(made.intensity, own.intensity)
    x, y, distance = np.array(made.x), np.array(made.y), np.array(made.distance)
    lifted, still, alone = (x < 3.9) & (y < 5.9), (x > 4.1) & (x < 4.7), x > 4.85
    assert np.nanmedian(distance[lifted]) == pytest.approx(0.005, abs=2e-4)
    assert abs(np.nanmedian(distance[still])) < 2e-4
    assert np.isnan(distance[alone]).mean() > 0.99 and np.isfinite(distance[lifted | still]).mean() > 0.99
    inside = np.abs(distance - 0.005 * lifted) <= np.array(made.uncertainty)
    assert inside[lifted | still].mean() == pytest.approx(0.95, abs=0.04)
    rgb = np.stack([made.red, made.green, made.blue], axis=1)[lifted | alone | still] // 257
    unsure = np.array(made.uncertainty, float)
    expected = colours_of(distance, unsure, statistics_of(distance.astype(float), unsure).limit)
    assert (np.abs(rgb.astype(int) - expected[lifted | alone | still]).max(axis=1) <= 2).mean() > 0.98
    with pointglass.open(before) as one, pointglass.open(after) as other:  # the grid's order of points is another one
        found, order = pointglass.compare(one, other, method=method), np.lexsort(np.rint(other.points.xyz * 1e4).T)
    in_file = np.lexsort(np.rint(own.xyz * 1e4).T)
    np.testing.assert_array_equal(found.distance[order].astype(np.float32), distance[in_file])
    np.testing.assert_array_equal(found.uncertainty[order].astype(np.float32), unsure[in_file].astype(np.float32))
    facts = table(out / "distances.csv")
    assert facts["comparison"]["method"] == method
    assert int(facts["statistic"]["points"]) == len(own.points)
    assert float(facts["statistic"]["share without counterpart"]) == pytest.approx(np.isnan(distance).mean(), abs=1e-6)
    assert float(facts["statistic"]["mean"]) == pytest.approx(np.nanmean(distance), abs=1e-6)
    with Image.open(out / "distances.png") as picture:
        assert picture.size == (1920, 1200)
    said = capsys.readouterr()
    assert f"{np.isfinite(distance).sum():,} points compared" in said.out and not said.err
    assert "about 5 % do so by chance" in said.out and "not aligned" not in said.out, "an eighth alone is no sign of that"
    assert main(["compare", before, after, "--out", str(out), "--method", method]) == 0
    assert "replaces" in capsys.readouterr().err


def test_the_statistics_count_every_point(seed):
    random = np.random.default_rng(seed)
    distance, uncertainty = random.normal(0, 0.01, 5000), random.uniform(0, 0.02, 5000)
    distance[random.random(5000) < 0.2] = np.nan
    found = statistics_of(distance, uncertainty)
    assert found.bins.sum() == found.known == np.isfinite(distance).sum()
    assert found.changed == (np.abs(distance) > uncertainty).sum()
    assert found.median == pytest.approx(np.nanmedian(distance))
    sure, unsure = colours_of(np.array([0.01, 0.01]), np.array([0.001, 0.05]), 0.01).astype(int)
    assert abs(unsure[0] - unsure[2]) < 40 < 60 < abs(sure[0] - sure[2])  # pale
    nothing = statistics_of(np.full(10, np.nan), np.full(10, np.nan))
    assert nothing.known == 0 and np.isnan(nothing.mean)


def test_a_map_shows_the_most_certain_change_behind_a_ceiling_and_what_has_no_counterpart(seed):
    random = np.random.default_rng(seed)
    flat = random.uniform(0, 1, (40_000, 2))
    below = random.random(40_000) < 0.5
    xyz = np.c_[flat, np.where(below, 0.0, 1.0)]
    left = flat[:, 0] < 0.45
    distance = np.where(below & left, -0.004, 0.0) + random.normal(0, 1e-4, 40_000)
    distance[flat[:, 0] > 0.8] = np.nan
    made = change_map(xyz, distance, np.full(40_000, 0.001), VIEWS["from above"], 0.01, 0.01)
    width = made.rgb.shape[1]
    assert (made.rgb[5:-5, int(0.9 * width) : -5] == NO_COUNTERPART).all()
    blue = made.rgb[5:-5, 5 : int(0.4 * width)].astype(int)
    assert (blue[..., 2] - blue[..., 0] > 60).mean() > 0.99
    middle = made.rgb[5:-5, int(0.55 * width) : int(0.75 * width)]
    assert (np.abs(middle.astype(int) - 240) < 12).mean() > 0.99


def test_steps_of_coordinates_hold_far_points(seed):
    random = np.random.default_rng(seed)
    xyz = random.uniform(0, 10.0 ** random.uniform(0, 7), (1000, 3)) + random.uniform(-1e7, 1e7, 3)
    scales, offsets = coordinate_steps(xyz, 0.005)
    steps = np.rint((xyz - offsets) / scales)
    assert steps.min() >= 0 and steps.max() < 2**31
    assert (np.abs(steps * scales + offsets - xyz) <= scales * 0.51).all()


@pytest.mark.parametrize(("change", "said"), [
    (lambda tmp, xyz: write_las(tmp / "b.las", xyz, crs="EPSG:2225"), "is in US survey foot, a.las is in metre"),
    (lambda tmp, xyz: write_las(tmp / "b.las", xyz, crs="EPSG:25833"), "has the reference system"),
    (lambda tmp, xyz: write_las(tmp / "b.las", xyz + 50, crs="EPSG:25832"), "do not overlap"),
    (lambda tmp, xyz: write_las(tmp / "b.las", xyz[:40], crs="EPSG:25832"), "has 40 points, at least 100"),
    (lambda tmp, xyz: str(tmp / "nowhere.laz"), "no such file"),
])
def test_what_cannot_be_compared_is_refused_in_one_line_and_leaves_nothing(change, said, seed, tmp_path, capsys):
    xyz = floor(np.random.default_rng(seed), 3000)
    before, after = write_las(tmp_path / "a.las", xyz, crs="EPSG:25832"), change(tmp_path, xyz)
    assert main(["compare", before, after, "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and said in err, err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("options", [("--registration", "-1"), ("--registration", "nan"), ("--range", "0"), ("--depth", "inf")])
def test_lengths_that_are_none_are_refused(options, scans, capsys):
    before, after, folder = scans
    assert main(["compare", before, after, "--out", str(folder / "out"), *options]) == 2
    assert f"{options[0]} {float(options[1])}: expected a length" in capsys.readouterr().err


def test_an_unknown_unit_is_said_and_the_scan_itself_is_never_replaced(seed, tmp_path, capsys):
    random = np.random.default_rng(seed)
    one = write_las(tmp_path / "a.las", floor(random, 5000), crs="EPSG:25832")
    xyz = floor(random, 5000)
    other = write_ply(tmp_path / "b.ply", xyz, np.zeros((5000, 3), np.uint8))
    assert main(["compare", one, str(other), "--out", str(tmp_path / "out")]) == 0
    assert "b.ply states no unit of length" in capsys.readouterr().err
    assert main(["compare", one, one, "--out", str(tmp_path / "same")]) == 0
    assert "a.las is compared with itself" in capsys.readouterr().err
    again = str(tmp_path / "out" / "distances.laz")
    assert main(["compare", one, again, "--out", str(tmp_path / "out")]) == 2
    assert "is one of the scans that are compared" in capsys.readouterr().err


def write_ptx(path, xyz, place) -> str:
    """One scan of (n, 3) points in file coordinates, measured from ``place``."""
    x, y, z = place
    head = [str(len(xyz)), "1", f"{x} {y} {z}", "1 0 0", "0 1 0", "0 0 1", "1 0 0 0", "0 1 0 0", "0 0 1 0", f"{x} {y} {z} 1"]
    rows = [f"{a:.6f} {b:.6f} {c:.6f} 0.5" for a, b, c in xyz - np.array(place)]
    path.write_text("\n".join([*head, *rows]) + "\n")
    return str(path)


def test_positive_is_towards_the_scanner_that_the_file_states(seed, tmp_path, capsys):
    random = np.random.default_rng(seed)
    before, after = floor(random, 4000), floor(random, 4000) - (0, 0, 0.01)
    for after_file, said in ((write_ptx(tmp_path / "a.ptx", after, (4.0, 6.0, -3.0)), "towards the scanner"),
                             (write_las(tmp_path / "a.las", after), "towards the nearest scanner of the scan before")):
        assert main(["compare", write_ptx(tmp_path / "b.ptx", before, (4.0, 6.0, -3.0)), after_file, "--out",
                     str(tmp_path / "out")]) == 0
        assert f"positive is {said}" in capsys.readouterr().out
        made = read_las(tmp_path / "out" / "distances.laz")
        assert np.nanmedian(made.distance) == pytest.approx(0.01, abs=0.001)
        assert set(np.unique(made.station)) == {0}


@pytest.mark.parametrize("method", ["m3c2", "c2c"])
def test_scans_without_any_counterpart_are_told_so(method, seed, tmp_path, capsys, monkeypatch):
    """Walls, so that two of the maps are thin: their labels do not lie over each other."""
    random = np.random.default_rng(seed)
    before, after = floor(random, 4000), floor(random, 4000)
    before[:2, 2] += 20
    after[:, 2] += 10
    before, after = np.roll(before, 1, axis=1), np.roll(after, 1, axis=1)
    pages, save = [], Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda page, *given, **named: (pages.append(page), save(page, *given, **named)))
    out = tmp_path / "out"
    assert main(["compare", write_las(tmp_path / "Büro.las", before), write_las(tmp_path / "a.las", after), "--out",
                 str(out), "--method", method]) == 0
    said = capsys.readouterr().out
    assert "0 points compared, 4,000 without a counterpart" in said
    assert "100 % of the points have no counterpart: another place, another unit, or not aligned?" in said
    assert np.isnan(read_las(out / "distances.laz").distance).all()
    assert (out / "distances.csv").read_bytes().startswith(b"\xef\xbb\xbf"), "spreadsheets take the name for Latin letters"
    assert table(out / "distances.csv")["statistic"]["share without counterpart"] == "1"
    assert table(out / "distances.csv")["comparison"]["before"].endswith("Büro.las")
    for drawn in pages[0].axes[: len(VIEWS)]:
        for axis, side in ((drawn.xaxis, 0), (drawn.yaxis, 1)):
            boxes = [label.get_window_extent() for label in axis.get_ticklabels()]
            ends = sorted((box.min[side], box.max[side]) for box in boxes)
            assert ends and all(after[0] > before[1] for before, after in pairwise(ends))
    with Image.open(out / "distances.png") as picture:
        assert picture.size == (1920, 1200)


def test_scans_are_compared_where_a_project_has_moved_them(seed, tmp_path, capsys):
    from pointglass.viewer.work.document import Document, ScanFile
    from pointglass.viewer.work.project import write_project

    random = np.random.default_rng(seed)
    before, after = floor(random, 4000), floor(random, 4000)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = random.uniform(-50, 50, 3)
    names = [write_las(tmp_path / "b.las", before, step=1e-5),
             write_las(tmp_path / "a.las", (after + (0, 0, 0.004) - shift) @ turn, step=1e-5)]
    rows = tuple(tuple(row) for row in np.vstack([np.c_[turn, shift], [0, 0, 0, 1]]).tolist())
    write_project(tmp_path / "p.pointglass", Document((ScanFile(names[0]), ScanFile(names[1], transform=any_typed(rows)))))
    out = ["--out", str(tmp_path / "out"), "--project", str(tmp_path / "p.pointglass")]
    assert main(["compare", *names, *out]) == 0
    made = read_las(tmp_path / "out" / "distances.laz")
    np.testing.assert_allclose(made.xyz, after + (0, 0, 0.004), atol=3e-4)
    assert np.nanmedian(made.distance) == pytest.approx(0.004, abs=0.001)
    capsys.readouterr()
    assert main(["compare", names[0], write_las(tmp_path / "c.las", after), *out]) == 2
    assert "p.pointglass: has moved neither of the scans" in capsys.readouterr().err
    assert main(["compare", names[0], str(tmp_path / "p.pointglass"), *out[:2]]) == 2
    assert "is a project: comparing reads scans; name both scans" in capsys.readouterr().err
