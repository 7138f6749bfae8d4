"""No limit drops or changes something without a word: depth of an octree, stations, classes, scales of intensity."""

import json

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las
from format_files import some, write_potree1

import pointglass
from pointglass.viewer.commands.info import format_text
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.preprocess import exposure_compensation, point_colour
from pointglass.viewer.readers.class_codes import class_codes
from pointglass.viewer.readers.formats import open_source


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    """An empty cache of the test's own."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))


def ply_with(path, name: str, values: np.ndarray, kind: str):
    """A PLY with one more property."""
    xyz, _ = surface(len(values))
    names = {"<f4": "float", "<f8": "double", "<i4": "int", "<u2": "ushort"}
    rows = np.zeros(len(values), [("xyz", "<f4", 3), ("more", kind)])
    rows["xyz"], rows["more"] = xyz, values
    head = "".join(f"property float {axis}\n" for axis in "xyz") + f"property {names[kind]} {name}\n"
    path.write_bytes(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(values)}\n{head}end_header\n".encode()
                     + rows.tobytes())
    return path


@pytest.mark.parametrize("version", ["1.4", "1.8"])
def test_nodes_of_any_depth_are_read(tmp_path, version):
    """Coincident points make an octree deep: 70 levels below the root, one point each."""
    points = some(1)
    write_potree1(tmp_path / "deep", points, version=version)
    before = open_source(tmp_path / "deep" / "cloud.js").count or 0
    folder = next((tmp_path / "deep" / "data").rglob("r.bin")).parent
    record = next(folder.rglob("r.bin")).read_bytes()[:20]
    for level in range(60, 71):
        (folder / f"r{'0' * level}.bin").write_bytes(record)
    source = open_source(tmp_path / "deep" / "cloud.js")
    assert source.count == before + 11 == sum(len(chunk.xyz) for chunk in source.chunks())


def test_classes_that_are_not_codes_are_counted(tmp_path):
    path = ply_with(tmp_path / "a.ply", "scalar_Classification", np.array([0, 5, 255, 256, -1, 2.5, np.nan, 7.0]), "<f4")
    scene = open_scene(path)
    (warning,) = [text for text in scene.meta.warning_texts if "class" in text]
    assert "4 points have a class that is not a whole number from 0 to 255, such as 256" in warning
    with pointglass.open(path) as scan:
        assert set(scan.points.classification[np.isfinite(scan.points.classification)]) == {0, 5, 255, 256, -1, 2.5, 7}
    assert class_codes(np.array([300.0, -4, np.nan, 12])).tolist() == [255, 0, 0, 12]


def test_classes_that_are_codes_are_not_mentioned(tmp_path):
    path = ply_with(tmp_path / "a.ply", "classification", np.arange(8), "<i4")
    assert not [text for text in open_scene(path).meta.warning_texts if "class" in text]


def test_exposures_of_too_many_stations_are_said_to_be_left_as_they_are(tmp_path, monkeypatch):
    for module in (exposure_compensation, point_colour):
        monkeypatch.setattr(module, "MOST_STATIONS", 3)
    xyz, rgb = surface(4000)
    for count, said in ((3, False), (4, True)):
        path = write_las(tmp_path / f"{count}.las", xyz, rgb, source=np.arange(len(xyz)) % count)
        warnings = open_scene(path, cache=False).meta.warning_texts
        assert any(f"exposures of {count} stations or flight lines are not compensated: at most 3" in text
                   for text in warnings) == said  # fmt: skip


@pytest.mark.slow
def test_more_than_256_scans_are_all_listed_and_the_limit_of_the_picture_is_stated(tmp_path):
    xyz, rgb = surface(10)
    places = [(10.0 * (i % 20), 10.0 * (i // 20), 0.0) for i in range(300)]
    scans = [E57Scan(xyz=xyz, rgb=rgb, name=f"setup {i}", translation=place) for i, place in enumerate(places)]
    with pointglass.open(write_e57(tmp_path / "a.e57", scans)) as scan:
        assert len(scan.info["scans"]) == len(scan.stations) == 300
        said = "300 scans: the picture hides and colours those from the 256th on as one"
        assert any(said in text for text in scan.info["warnings"])
        station = scan.points.station
        assert np.bincount(station).tolist() == [10] * 300
        nearest = np.linalg.norm(scan.points.xyz - scan.stations[station], axis=1)
        assert nearest.max() < 8


@pytest.mark.parametrize(("values", "kind"), [
    (np.arange(2000), "<i4"), (np.arange(2000), "<u2"), (np.linspace(-20, 3, 2000), "<f4"), (np.linspace(0, 1, 2000), "<f8"),
    (np.arange(2000) * 100.0, "<f8"),
])  # fmt: skip
def test_intensities_are_shown_and_handed_out_in_the_scale_of_the_file(tmp_path, values, kind):
    path = ply_with(tmp_path / "a.ply", "intensity", values, kind)
    with pointglass.open(path) as scan:
        found = scan.points.intensity
        assert found.dtype == np.dtype(kind) and np.array_equal(np.sort(found), values.astype(kind))
        layout = scan._open.attributes
        assert layout.low is not None and layout.high is not None
        assert layout.in_file(layout.low) == pytest.approx(values.astype(kind).min(), abs=1e-6)
        assert layout.in_file(layout.high) == pytest.approx(values.astype(kind).max(), rel=1e-6)
        assert layout.as_stored(layout.in_file(1234.0)) == pytest.approx(1234.0)
        (line,) = [line for line in format_text(scan._open).splitlines() if line.startswith("intensity")]
        first, last = line.split()[1].replace(",", ""), line.split()[3].replace(",", "")
        assert float(first) == pytest.approx(values.min(), abs=1e-4) and float(last) == pytest.approx(values.max(), rel=1e-4)
        json.dumps(scan.info, allow_nan=False)


def test_files_with_different_scales_of_intensity_say_so(tmp_path):
    paths = [ply_with(tmp_path / f"{i}.ply", "intensity", np.linspace(-i, 3, 100), "<f4") for i in (1, 2)]
    with pointglass.open(*paths) as scan:
        assert scan._open.attributes.ends is None
        assert "each file by its own scale" in format_text(scan._open)
        assert sorted(scan.points.intensity)[:2] == [np.float32(-2), np.sort(np.linspace(-2, 3, 100).astype("f4"))[1]]
