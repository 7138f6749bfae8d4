"""Further columns of text files: numbers under the names in the header, and one line about what is left out."""

from typing import Any

import laspy
import numpy as np
import pytest
from e57_files import contents

from pointglass.viewer import cli
from pointglass.viewer.readers.formats import open_sources

NAMES = ("GPSTime", "Deviation", "Return_Number", "rgb")


def export(*arguments):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == 0


def cloud(count=500):
    rng = np.random.default_rng(5)
    columns = {"GPSTime": np.round(3.5e8 + rng.random(count) * 100, 6), "Deviation": np.round(rng.normal(size=count), 4),
               "Return_Number": rng.integers(1, 4, count), "rgb": rng.integers(0, 2**24, count)}  # fmt: skip
    return np.round(rng.random((count, 3)) * (6, 5, 3), 3), rng.integers(0, 256, (count, 3)), columns


def write(path, xyz, rgb, columns, delimiter=",", header="X,Y,Z,R,G,B"):
    rows = zip(xyz.tolist(), rgb.tolist(), *(list(values) for values in columns.values()), strict=True)
    lines = [delimiter.join(str(value) for value in (*place, *colour, *more)) for place, colour, *more in rows]
    title = [delimiter.join([*header.split(","), *columns])] if header else []
    path.write_text("\n".join([*title, *lines, ""]))


@pytest.mark.parametrize(("name", "delimiter", "header"), [
    ("a.csv", ",", "X,Y,Z,R,G,B"), ("a.txt", ";", "Easting,Northing,Height,Red,Green,Blue"), ("a.asc", " ", "//X,Y,Z,R,G,B"),
    ("a.xyz", "\t", "x,y,z,r,g,b"), ("a.pts", " ", "#X,Y,Z,R,G,B"),
])  # fmt: skip
def test_named_columns_are_kept_as_numbers(tmp_path, capsys, name, delimiter, header):
    xyz, rgb, columns = cloud()
    write(tmp_path / name, xyz, rgb, columns, delimiter, header)
    (source,) = open_sources([tmp_path / name], None)
    read = next(iter(source.record_chunks())).columns
    assert all(np.array_equal(read[column], columns[column]) for column in NAMES)
    numbers = np.array([3, 77, 499])
    assert np.array_equal(source.records(numbers).columns["GPSTime"], columns["GPSTime"][numbers])
    export(tmp_path / name, "--out", tmp_path / "b.laz")
    las: Any = laspy.read(tmp_path / "b.laz")
    assert np.array_equal(np.round(las.xyz, 3), xyz) and np.array_equal(las.gps_time, columns["GPSTime"])
    assert np.array_equal(las.return_number, columns["Return_Number"])
    assert np.array_equal(las["Deviation"], columns["Deviation"]) and np.array_equal(las["rgb"], columns["rgb"])
    export(tmp_path / name, "--out", tmp_path / "b.e57")
    found = contents(tmp_path / "b.e57")
    assert all(np.array_equal(np.frombuffer(found[f"/data3D/0/points/pg:{column}"]), columns[column]) for column in NAMES)
    assert "left out" not in capsys.readouterr().err


def test_columns_of_words_and_without_a_name_are_named_as_left_out(tmp_path, capsys):
    xyz, rgb, columns = cloud()
    words = {"Stamp": ["2024-05-01T10:00:00"] * len(xyz), "Name": ["wall"] * len(xyz),
             "Score": [str(i) if i % 5 else "none at all" for i in range(len(xyz))]}  # fmt: skip
    write(tmp_path / "a.csv", xyz, rgb, columns | words)
    export(tmp_path / "a.csv", "--out", tmp_path / "b.las")
    told = capsys.readouterr().err
    assert "columns Stamp, Name are not numbers and left out" in told and told.count("\n") == 1
    assert "100 fields of column Score are no numbers and left out" in told
    score = laspy.read(tmp_path / "b.las")["Score"]
    assert np.isnan(score[::5]).all() and np.array_equal(score[1:5], [1, 2, 3, 4])
    write(tmp_path / "c.xyz", xyz, rgb, {"level": [255] * len(xyz)}, " ", "")
    export(tmp_path / "c.xyz", "--out", tmp_path / "c.las")
    assert "column 7 is without a name in a header and left out" in capsys.readouterr().err
