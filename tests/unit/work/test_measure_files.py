"""Files of measurements (viewer.work.measuring), read again: DXF by ezdxf's reader and auditor, GeoJSON as plain JSON."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from documents import random_fits, random_profile, random_volume

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.work.measuring.measure_files import ENDINGS, write_measurements
from pointglass.viewer.work.measuring.measure_text import decimals_of, value_text
from pointglass.viewer.work.measuring.measurement import KINDS, MeasuredPoint, Measurement
from pointglass.viewer.work.measuring.values import evaluate

FEET = ScanDescription(units="foot", metres_per_unit=0.3048, crs="EPSG:2256")


@pytest.fixture
def one_of_each(seed) -> dict[str, Measurement]:
    """A measurement of every kind, at map coordinates, with names in several scripts."""
    random = np.random.default_rng(seed)
    made = {}
    for kind in KINDS:
        places = [vector(random.uniform(-1e6, 1e6, 3)) for _ in range(KINDS[kind].fewest)]
        points = [MeasuredPoint(at, 0.0, 1e-2, fit=fit) for at, fit in zip(places, random_fits(random, kind), strict=True)]
        made[kind] = Measurement(kind, tuple(points), f"{kind} é 北 \"1\"", volume=random_volume(random, kind),
                                profile=random_profile(random, kind))
    return made


def test_a_drawing_is_read_without_errors_and_holds_each_kind_on_its_layer(tmp_path, one_of_each):
    import ezdxf
    from ezdxf.math import Vec3

    path = tmp_path / "m.dxf"
    write_measurements(path, list(one_of_each.values()), FEET)
    drawing = ezdxf.readfile(path)  # type: ignore[reportPrivateImportUsage]
    assert not drawing.audit().errors and drawing.units == 2
    space = drawing.modelspace()
    low, high = np.array(drawing.header["$EXTMIN"]), np.array(drawing.header["$EXTMAX"])
    places = np.array([point.position for made in one_of_each.values() for point in made.points])
    assert (low <= places.min(axis=0) + 1e-6).all() and (high >= places.max(axis=0) - 1e-6).all()
    assert (high - low < 10 * np.ptp(places, axis=0).max()).all()
    for kind, made in one_of_each.items():
        found: list[Any] = [entity for entity in space if entity.dxf.layer == f"POINTGLASS {KINDS[kind].name.upper()}"]
        (text,) = [entity.dxf.text for entity in found if entity.dxftype() in ("TEXT", "DIMENSION")]
        length = f"{evaluate(made).value:.{decimals_of(evaluate(made))}f}"
        dimensions = [entity for entity in found if entity.dxftype() == "DIMENSION"]
        assert bool(dimensions) == (kind in ("distance", "height", "pipe", "circle", "point to plane", "plane to plane"))
        assert text.replace("<>", length) == f"{made.name}: {value_text(made, 'ft')}"
        for entity in dimensions:
            # ezdxf's get_measurement takes these points, of the world, for those of the object's frame
            direction = entity.ocs().to_wcs(Vec3.from_deg_angle(entity.dxf.angle))
            measured = direction.dot(entity.dxf.defpoint3 - entity.dxf.defpoint2)
            assert abs(measured) == pytest.approx(evaluate(made).value, rel=1e-9, abs=1e-9)  # float64 of a million: 1e-10
            (drawn,) = [each.plain_text() for each in entity.virtual_entities() if each.dxftype() == "MTEXT"]
            assert drawn == f"{made.name}: {value_text(made, 'ft')}"
        points = np.array([tuple(entity.dxf.location) for entity in found if entity.dxftype() == "POINT"])
        place = evaluate(made).place
        expected = np.array([place]) if place is not None else np.array([point.position for point in made.points])
        assert points == pytest.approx(expected, rel=0, abs=1e-6)
    first, second = (np.array(point.position) for point in one_of_each["distance"].points)
    (line,) = space.query('LINE[layer=="POINTGLASS DISTANCE"]')
    assert np.array([line.dxf.start, line.dxf.end]) == pytest.approx(np.array([first, second]), abs=1e-6)
    fit = one_of_each["circle"].fit
    assert fit is not None
    circle: Any
    (circle,) = space.query('CIRCLE[layer=="POINTGLASS CIRCLE"]')
    assert np.array(circle.ocs().to_wcs(circle.dxf.center)) == pytest.approx(np.array(fit.place), abs=1e-5)
    assert circle.dxf.radius == pytest.approx(fit.radius)
    assert np.array(circle.dxf.extrusion) == pytest.approx(np.array(fit.direction))
    assert len(space.query('CIRCLE[layer=="POINTGLASS PIPE"]')) == 2


def test_map_features_have_the_coordinates_of_the_file_and_name_its_system(tmp_path, one_of_each):
    path = tmp_path / "m.geojson"
    write_measurements(path, list(one_of_each.values()), FEET)
    read = json.loads(path.read_text(encoding="utf-8"))
    assert read["type"] == "FeatureCollection" and read["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::2256"
    assert len(read["features"]) == len(KINDS)
    kinds = {**dict.fromkeys(("area", "volume", "plane", "circle"), "Polygon"), "corner": "Point", "edge": "MultiPoint"}
    for feature in read["features"]:
        made = one_of_each[feature["properties"]["kind"]]
        result, facts, geometry = evaluate(made), feature["properties"], feature["geometry"]
        assert facts["name"] == made.name and facts["uncertainty_k2"] == result.uncertainty
        assert facts["value"] == (None if made.kind == "corner" else result.value)
        assert facts["unit"] == {0: "deg", 2: "ft^2", 3: "ft^3"}.get(result.power, "ft") if result.power is not None else "ft"
        assert geometry["type"] == kinds.get(made.kind, "LineString")
        if geometry["type"] == "Polygon":
            (ring,) = geometry["coordinates"]
            assert ring[0] == ring[-1] and len(ring) >= 4
    way = one_of_each["distance"]
    feature = next(each for each in read["features"] if each["properties"]["kind"] == "distance")
    assert feature["geometry"]["coordinates"] == [list(point.position) for point in way.points]


def test_a_table_has_a_byte_order_mark_where_it_has_other_letters_than_ascii(tmp_path, one_of_each):
    for name, marked in (("plain", False), ("北", True)):
        write_measurements(tmp_path / "m.csv", [replace(one_of_each["distance"], name=name)], FEET)
        assert (tmp_path / "m.csv").read_bytes().startswith(b"\xef\xbb\xbf") == marked
        assert f"\n{name},distance," in (tmp_path / "m.csv").read_text("utf-8-sig")


@pytest.mark.parametrize("crs", [None, "mixed"])
def test_without_a_known_system_none_is_claimed(tmp_path, one_of_each, crs):
    path = tmp_path / "m.json"
    write_measurements(path, [one_of_each["distance"]], ScanDescription(crs=crs))
    read = json.loads(path.read_text(encoding="utf-8"))
    assert "crs" not in read and read["features"][0]["properties"]["unit"] == "units"


@pytest.mark.parametrize("ending", [ending for endings in ENDINGS.values() for ending in endings])
def test_no_measurements_are_a_file_and_an_older_one_stays_where_it_cannot_be_written(tmp_path, ending):
    path = tmp_path / f"m{ending}"
    write_measurements(path, [], ScanDescription())
    assert path.stat().st_size > 0
    with pytest.raises(InputError, match=r"cannot be written .*save it elsewhere"):
        write_measurements(tmp_path / "gone" / path.name, [], ScanDescription())


def test_names_that_are_no_text_or_would_be_obeyed_are_written_escaped(tmp_path, one_of_each):
    odd = "a\n  0\nLINE\n\x1b[2J\ud800"
    made = replace(one_of_each["distance"], name=odd)
    for endings in ENDINGS.values():
        path = tmp_path / f"m{endings[0]}"
        write_measurements(path, [made], ScanDescription())
        assert path.read_bytes().decode("utf-8")
    import ezdxf

    drawing = ezdxf.readfile(tmp_path / "m.dxf")  # type: ignore[reportPrivateImportUsage]
    (text,) = drawing.modelspace().query("DIMENSION")
    assert text.dxf.text.startswith("a 0 LINE \\x1b[2J") and len(drawing.modelspace().query("LINE")) == 1


def test_another_ending_is_refused_with_those_that_there_are(tmp_path):
    for name in ("m.xlsx", "m"):
        with pytest.raises(InputError, match=r"\.csv, \.dxf, \.geojson"):
            write_measurements(tmp_path / name, [], ScanDescription())
    assert [*tmp_path.iterdir()] == []
