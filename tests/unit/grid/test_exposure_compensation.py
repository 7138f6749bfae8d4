"""Exposure compensation in every format with stations, and colours as scanned on request."""

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las, write_ply

from pointglass.viewer.cli import main
from pointglass.viewer.commands.convert import convert_each
from pointglass.viewer.commands.info import facts, format_text
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack

GAINS = (0.9, 1.0, 1.1)


def _stations(seed, count=10_000):
    """One textured floor seen by three stations, each with its own gain: xyz, rgb, station."""
    rng = np.random.default_rng(seed)
    parts = []
    for number, gain in enumerate(GAINS):
        xyz = np.column_stack([rng.uniform(0, 3, (count, 2)), 0.001 * rng.normal(size=count)])
        true = 120 + 50 * np.sin(4 * xyz[:, :1]) + 20 * np.cos(6 * xyz[:, 1:2]) * (1, 0, -1)
        rgb = np.clip(np.rint(true * gain), 0, 255).astype(np.uint8)
        parts.append((np.round(xyz * 4096) / 4096, rgb, np.full(count, number)))
    return tuple(np.concatenate([p[k] for p in parts]) for k in range(3))


def _brightness(scene):
    """Mean colour of the scene, and the difference between neighbours, which is due to the gains only."""
    word = np.asarray(scene.points[:, 2])
    return np.stack([(word >> s) & 0xFF for s in (0, 8, 16)], 1).astype(float)


def test_exposure_compensation_shows_progress_and_can_be_cancelled(tmp_path):
    from pointglass.viewer.common.errors import Cancelled
    from pointglass.viewer.common.progress import set_sink

    xyz, rgb, station = _stations(1, 3000)
    path, steps = write_las(tmp_path / "a.laz", xyz, rgb, source=station + 7), []

    def sink(label, done, total):
        steps.append(label)
        return label != "matching the brightness"

    set_sink(sink)
    try:
        open_scene([path], cache=False, match=False)
        assert list(dict.fromkeys(steps)) == ["reading", "building the grid", "measuring the spacing", "measuring the cells",
                                              "estimating the noise"], "no brightness is matched"
        with pytest.raises(Cancelled):
            open_scene([path], cache=False)
    finally:
        set_sink(None)
    assert steps[-1] == "matching the brightness"


@pytest.mark.parametrize("kind", ["laz", "laz 16-bit", "e57", "three plys"])
def test_exposures_are_compensated_in_every_format_with_stations(tmp_path, kind):
    xyz, rgb, station = _stations(1)
    if kind.startswith("laz"):
        wide = rgb.astype(np.uint16) * (257 if "16" in kind else 1)
        files = [write_las(tmp_path / "a.laz", xyz, wide, source=station + 7)]
    elif kind == "e57":
        scans = [E57Scan(xyz[station == s], rgb[station == s]) for s in range(3)]
        files = [write_e57(tmp_path / "a.e57", scans)]
    else:
        files = [write_ply(tmp_path / f"{s}.ply", xyz[station == s], rgb[station == s]) for s in range(3)]
    matched, plain = (open_scene(files, cache=False, match=match) for match in (True, False))
    found = facts(matched)["exposures"]
    assert (found["stations"], found["matched"], found["applied"]) == (3, 3, True)
    assert found["smallest_gain"] == pytest.approx(1 / 1.1, abs=0.02)
    assert found["largest_gain"] == pytest.approx(1 / 0.9, abs=0.02)
    assert "3 of 3 stations compensated" in format_text(matched)
    assert facts(plain)["exposures"] is None
    # the floor's own pattern has this spread; three gains widen it
    assert _brightness(matched).std(0).max() < _brightness(plain).std(0).max() - 1
    assert abs(_brightness(matched).mean() - _brightness(plain).mean()) < 1


def test_exposures_of_16_bit_colours_are_compensated_like_8_bit_ones(tmp_path):
    xyz, rgb, station = _stations(6)
    files = [write_las(tmp_path / f"{factor}.las", xyz, rgb.astype(np.uint16) * factor, source=station) for factor in (1, 257)]
    narrow, wide = (unpack(open_scene([file], cache=False))[1].astype(int) for file in files)
    assert np.abs(narrow - wide).max() <= 1 and (narrow != wide).mean() < 1e-3, "but for ties of rounding"


def test_one_station_and_equal_stations_keep_every_colour(tmp_path):
    xyz, rgb, station = _stations(2)
    one = station == 0
    for source in (None, station[one]):
        file = write_las(tmp_path / "one.las", xyz[one], rgb[one], source=source)
        a, b = (open_scene([file], cache=False, match=match) for match in (True, False))
        assert np.array_equal(a.points, b.points)
    # the same floor with the same gain: two equal stations
    file = write_las(tmp_path / "two.las", xyz[one], rgb[one], source=np.arange(one.sum()) % 2)
    a, b = (open_scene([file], cache=False, match=match) for match in (True, False))
    assert np.array_equal(a.points, b.points) and facts(a)["exposures"]["applied"] is False


def test_compensated_grids_and_grids_as_scanned_have_different_cache_keys(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    xyz, rgb, station = _stations(3)
    file = write_las(tmp_path / "a.las", xyz, rgb, source=station)
    for match in (True, False, True):
        assert (facts(open_scene([file], match=match))["exposures"] is not None) == match


def test_a_scan_is_converted_again_for_other_exposures(tmp_path):
    xyz, rgb, station = _stations(3, 5000)
    write_las(tmp_path / "a.las", xyz, rgb, source=station)
    for match in (True, False, False, True):
        (folder,) = convert_each([tmp_path / "a.las"], tmp_path / "grids", match=match)
        assert (facts(open_scene(folder))["exposures"] is not None) == match


def test_convert_leaves_colours_as_scanned_when_asked(tmp_path):
    xyz, rgb, station = _stations(4)
    file = write_las(tmp_path / "a.las", xyz, rgb, source=station)
    assert main(["convert", str(file), "--out", str(tmp_path / "plain"), "--exposures", "as-scanned"]) == 0
    assert main(["convert", str(file), "--out", str(tmp_path / "matched")]) == 0
    plain, matched = (open_scene(tmp_path / name) for name in ("plain", "matched"))
    assert not np.array_equal(plain.points, matched.points)
    assert np.array_equal(np.sort(_brightness(plain)[:, 0]), np.sort(rgb[:, 0].astype(float)))


@pytest.mark.parametrize("kind", ["stations", "black"])
def test_a_compensated_folder_is_refused_for_colours_as_scanned(tmp_path, capsys, kind):
    xyz, rgb, station = _stations(7)
    if kind == "black":  # and no exposures to compensate
        xyz, rgb, station = xyz[station == 1], np.maximum(rgb[station == 1], 20), None
        rgb[::5] = 0
    file, grid, plain = write_las(tmp_path / "a.las", xyz, rgb, source=station), tmp_path / "grid", tmp_path / "plain"
    assert main(["convert", str(file), "--out", str(grid)]) == 0
    assert main(["convert", str(file), "--out", str(plain), "--exposures", "as-scanned"]) == 0
    with pytest.raises(InputError, match=r"matched exposures.*give the scan itself, or convert it again with --exp") as error:
        open_scene(grid, match=False)
    assert str(error.value).startswith(f"{grid}: ") and "\n" not in str(error.value)
    assert open_scene(grid).matched and not open_scene(plain, match=False).matched


def test_a_folder_without_compensation_counts_as_scanned(tmp_path):
    xyz, rgb, station = _stations(8)
    one = station == 1
    file = write_las(tmp_path / "one.las", xyz[one], rgb[one])
    assert main(["convert", str(file), "--out", str(tmp_path / "grid")]) == 0
    assert open_scene(tmp_path / "grid", match=False).count == one.sum()


@pytest.mark.parametrize("kind", ["laz", "ply", "wide ply"])
def test_frequent_black_among_colours_is_treated_as_missing_colour(tmp_path, kind):
    """Points without a photograph are stored as black; dark colours are spread over the lowest levels."""
    xyz, rgb = surface(20_000, 5)
    rgb = np.maximum(rgb, 20)
    lost = np.random.default_rng(5).random(len(xyz)) < 0.15

    def opened(colours, name, **how):
        if kind == "laz":
            file = write_las(tmp_path / f"{name}.laz", xyz, colours.astype(np.uint16) * 257)
        elif kind == "ply":
            file = write_ply(tmp_path / f"{name}.ply", xyz, colours)
        else:
            file = write_ply(tmp_path / f"{name}.ply", xyz, colours.astype(np.uint16) * 257, colour="ushort")
        return open_scene([file], cache=False, **how)

    holed = rgb.copy()
    holed[lost] = 0
    holed[np.flatnonzero(lost)[:50]] = (9, 3, 0)  # the border of the photographs
    scene = opened(holed, "holed")
    assert (~unpack(scene)[1].any(axis=1)).sum() == lost.sum()
    assert abs(scene.meta.colour.uncoloured - 0.15) < 0.03
    assert any("of the points are black, which is treated as missing" in text for text in scene.meta.warning_texts)
    assert not opened(holed, "holed", match=False).unlit, "as scanned means as scanned"
    assert not opened(rgb, "lit").unlit
    dark = (rgb * np.linspace(0, 0.2, len(rgb))[:, None]).astype(np.uint8)  # a dark scan: black and near black
    assert (dark.max(axis=1) == 0).mean() > 0.01 and not opened(dark, "dark").unlit


def test_missing_colour_is_decided_for_each_file_even_with_equal_names(tmp_path):
    xyz, rgb = surface(20_000, 5)
    holed, night = np.maximum(rgb, 20), rgb // 20 + 3
    holed[np.random.default_rng(5).random(len(xyz)) < 0.2] = 0
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    files = [write_ply(tmp_path / "a/scan.ply", xyz, holed), write_ply(tmp_path / "b/scan.ply", xyz + (100, 0, 0), night)]
    colours = unpack(open_scene(files, cache=False))[1]
    assert (~colours.any(axis=1)).sum() == (~holed.any(axis=1)).sum(), "the dark scan keeps its colours"


def test_black_of_another_file_remains_a_colour(tmp_path):
    xyz, rgb = surface(8_000, 6)
    rgb = np.maximum(rgb, 20)
    holed, print_ = rgb.copy(), rgb.copy()
    holed[::5] = 0
    print_[::400] = 0
    files = [write_ply(tmp_path / "a.ply", xyz, holed), write_ply(tmp_path / "b.ply", xyz + [9.0, 0, 0], print_)]
    scene = open_scene(files, cache=False)
    points, colours, _, _ = unpack(scene)
    assert scene.unlit and np.count_nonzero(~colours.any(axis=1)) == len(holed[::5])
    assert (points[~colours.any(axis=1), 0] < 8.0).all() and np.count_nonzero((colours == 1).all(axis=1)) == len(print_[::400])
