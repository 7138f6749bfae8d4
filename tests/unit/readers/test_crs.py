"""Names and units of reference systems, looked up by code or assigned."""

import subprocess
import sys

import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.crs import assigned, from_geokeys, from_text, title


@pytest.mark.parametrize(("code", "unit", "metres"), [(25832, "metre", 1.0), (2994, "foot", 0.3048), (4326, "degree", None),
                                                      (2222, "foot", 0.3048), (2225, "US survey foot", 1200 / 3937)])
def test_codes_have_their_units(code, unit, metres):
    for text in (f"EPSG:{code}", str(code), f" epsg:{code} "):
        name, found, length = assigned(text)
        assert (name, found) == (f"EPSG:{code}", unit)
        assert length == (metres if metres is None else pytest.approx(metres, rel=1e-9))
    assert from_text(f"EPSG:{code}")[1:] == assigned(str(code))[1:]


def test_files_that_name_a_code_have_its_units():
    assert from_geokeys({1024: 1, 3072: 2225})[:2] == ("EPSG:2225", "US survey foot")
    assert from_geokeys({1024: 1, 3072: 31467}) == ("EPSG:31467", "metre", 1.0)
    assert from_geokeys({1024: 1, 3072: 65000}) == ("EPSG:65000", "unknown", None)
    assert from_text("+proj=utm +zone=33 +datum=WGS84") == ("+proj=utm +zone=33 +datum=WGS84", "metre", 1.0)
    assert from_text("+proj=lcc +units=us-ft +lat_1=33 +lat_2=45")[1] == "US survey foot"
    assert from_text("+nonsense")[1:] == ("unknown", None)
    assert from_text("the site's own grid") == ("the site's own grid", "unknown", None)


@pytest.mark.parametrize("text", ["", "zone 32", "EPSG:", "999999", "EPSG:5783", "-1"])
def test_codes_without_a_horizontal_system_are_refused_in_one_line(text):
    """EPSG:5783 is a system of heights."""
    with pytest.raises(InputError, match=r"epsg\.io") as refused:
        assigned(text)
    assert "\n" not in str(refused.value)


def test_codes_have_a_title():
    assert title("EPSG:25832") == "ETRS89 / UTM zone 32N"
    assert title("EPSG:999999") is None and title("my own") is None


def test_opening_a_file_without_a_code_does_not_import_pyproj():
    wkt = 'PROJCS["a",UNIT["metre",1]]'
    code = f"import sys; from pointglass.viewer.readers import crs; crs.from_wkt({wkt!r}); crs.from_geokeys({{3076: 9001}})"
    code += "; sys.exit('pyproj' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
