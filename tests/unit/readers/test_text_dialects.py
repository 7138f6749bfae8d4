"""Text files of points as programs, countries and people write them: each gives the points that were written."""

import numpy as np
import pytest

from pointglass.viewer.cli import main
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.text.text_header import columns_named
from pointglass.viewer.readers.text.text_numbers import number

COUNT = 200


def points(count: int = COUNT) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates to a millimetre, and colours that do not follow from them."""
    random = np.random.default_rng(3)
    grey = random.integers(40, 200, (count, 1))
    return np.round(random.uniform(1000, 1100, (count, 3)), 3), np.clip(grey + random.integers(-30, 30, (count, 3)), 0, 255)


def read(path, columns=None):
    """(xyz, rgb, warnings) of a file; a sample of it gives the same points."""
    source = open_source(path, columns)
    chunks = list(source.chunks())
    sample = source.sample(10 * COUNT, 50)
    assert sample is not None and sum(len(chunk.xyz) for chunk in sample) == sum(len(chunk.xyz) for chunk in chunks)
    colours = [chunk.rgb for chunk in chunks if chunk.rgb is not None]
    rgb = np.concatenate(colours) if colours else None
    return np.concatenate([chunk.xyz for chunk in chunks]), rgb, source.warnings


def comma(value: float) -> str:
    return f"{value:.3f}".replace(".", ",")


def grouped(value: float, group: str, mark: str) -> str:
    return f"{value:,.3f}".replace(",", "\0").replace(".", mark).replace("\0", group)


ROWS = {
    "labels first": ("a.csv", lambda i, p, c: f"P{i},{p[0]},{p[1]},{p[2]}"),
    "labels with blanks": ("a.csv", lambda i, p, c: f'"wall, north {i}",{p[0]},{p[1]},{p[2]}'),
    "labels last": ("a.txt", lambda i, p, c: f"{p[0]} {p[1]} {p[2]} {c[0]} {c[1]} {c[2]} wall"),
    "words with blanks last": ("a.txt", lambda i, p, c: f"{p[0]} {p[1]} {p[2]} wall{' of stone' * (i % 3)}"),
    "point numbers (PNEZD)": ("a.csv", lambda i, p, c: f"{i + 1},{p[0]},{p[1]},{p[2]},tree"),
    "row and column before": ("a.xyz", lambda i, p, c: f"{i // 20} {i % 20} {p[0]:.3f} {p[1]:.3f} {p[2]:.3f}"),
    "Fortran exponents": ("a.xyz", lambda i, p, c: " ".join(f"{v:.9E}".replace("E", "D") for v in p)),
    "decimal commas": ("a.txt", lambda i, p, c: " ".join(map(comma, p))),
    "decimal commas and tabs": ("a.txt", lambda i, p, c: "\t".join(map(comma, p))),
    "decimal commas and semicolons": ("a.csv", lambda i, p, c: ";".join(map(comma, p))),
    "decimal commas in quotes": ("a.csv", lambda i, p, c: ",".join(f'"{comma(v)}5"' for v in p)),
    "thousands in quotes": ("a.csv", lambda i, p, c: ",".join(f'"{grouped(v, ",", ".")}"' for v in p)),
    "German thousands": ("a.csv", lambda i, p, c: ";".join(grouped(v, ".", ",") for v in p)),
    "French thousands": ("a.csv", lambda i, p, c: ";".join(grouped(v, " ", ",") for v in p)),
    "Swiss thousands": ("a.csv", lambda i, p, c: ";".join(grouped(v, "'", ".") for v in p)),
    "bars": ("a.csv", lambda i, p, c: "|".join(f"{v}" for v in (*p, *c))),
    "tabs and names with blanks": ("a.txt", lambda i, p, c: "\t".join([f"P{i}" + " x" * (i % 2), *map(str, p)])),
    "no label in some rows": ("a.csv", lambda i, p, c: f"{p[0]},{p[1]},{p[2]},{'tree' if i % 2 else ''}"),
    "descriptions with commas": ("a.csv", lambda i, p, c: f"{i + 1},{p[0]},{p[1]},{p[2]},tree{', oak' * (i % 2)}"),
    "pandas index": ("a.txt", lambda i, p, c: f"{'     x  y  z' + chr(10) if i == 0 else ''}{i}  {p[0]} {p[1]} {p[2]}"),
    "row names of R": ("a.txt", lambda i, p, c: f'"{i + 1}" {p[0]} {p[1]} {p[2]} "wall {i}"'),
    "sep= of Excel": ("a.csv", lambda i, p, c: ("sep=;\nNr;Y;X;H\n" if i == 0 else "")
                      + ";".join([str(i), *map(comma, p[[1, 0, 2]])])),
    "count and names of CloudCompare": ("a.asc", lambda i, p, c: ("//X Y Z R G B\n200\n" if i == 0 else "")
                                        + " ".join(map(str, (*p, *c)))),
    "time stamps last": ("a.csv", lambda i, p, c: f"{p[0]},{p[1]},{p[2]},2024-05-01T12:00:{i % 60:02d}Z"),
}


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_rows_of_all_dialects_are_read(tmp_path, name, end):
    xyz, rgb = points()
    file, row = ROWS[name]
    lines = [row(i, *pair).replace("\n", end) for i, pair in enumerate(zip(xyz, rgb, strict=True))]
    (tmp_path / file).write_bytes(end.join(lines).encode())
    found, _, _ = read(tmp_path / file)
    np.testing.assert_allclose(found, xyz, atol=6e-4)


def test_points_that_are_numbered_are_read_with_a_line_that_says_so(tmp_path):
    xyz, _ = points()
    path = tmp_path / "a.csv"
    path.write_text("".join(f"{i},{x},{y},{z}\n" for i, (x, y, z) in enumerate(xyz)))
    found, _, warnings = read(path)
    np.testing.assert_array_equal(found, xyz)
    assert "column 1 counts" in " ".join(warnings) and "--columns -,y,x,z" in " ".join(warnings)


@pytest.mark.parametrize(
    ("row", "colour"),
    [
        (lambda p, c, i: (*p, *c, 255), 3), (lambda p, c, i: (*p, 0, *c), 4), (lambda p, c, i: (*p, i, *c), 4),
        (lambda p, c, i: (*p, *c, i), 3), (lambda p, c, i: (*p, *c, i * 200, 255), 3),
        (lambda p, c, i: (*p, *c, 0.6, 0.8, 0.0), 3), (lambda p, c, i: (*p, 0.6, 0.8, 0.0, i * 3, *c), 7),
    ],
)
def test_the_numbers_tell_which_columns_are_the_colour(tmp_path, row, colour):
    xyz, rgb = points()
    levels = np.random.default_rng(5).integers(0, 256, len(xyz))
    rows = [row(p, c, i) for p, c, i in zip(xyz.tolist(), rgb.tolist(), levels.tolist(), strict=True)]
    path = tmp_path / "a.xyz"
    path.write_text("".join(" ".join(map(str, values)) + "\n" for values in rows))
    found, colours, _ = read(path)
    np.testing.assert_array_equal(found, xyz)
    np.testing.assert_array_equal(colours, rgb)
    np.testing.assert_array_equal(colours, np.array(rows)[:, colour : colour + 3])


HEADERS = {
    "German": "Rechtswert;Hochwert;Höhe [m];Rot;Grün;Blau", "French": "Est;Nord;Altitude;Rouge;Vert;Bleu",
    "Spanish": "Este;Norte;Elevación;Rojo;Verde;Azul", "Italian": "Est;Nord;Quota;Rosso;Verde;Blu",
    "Dutch": "Oost;Noord;Hoogte;Rood;Groen;Blauw", "Portuguese": "Leste;Norte;Elevação;Vermelho;Verde;Azul",
    "Czech": "Východ;Sever;Výška;Červená;Zelená;Modrá", "Polish": "Wschód;Północ;Wysokość;Czerwony;Zielony;Niebieski",
    "Swedish": "Öst;Norr;Höjd;Röd;Grön;Blå", "Turkish": "Doğu;Kuzey;Yükseklik;Kırmızı;Yeşil;Mavi",
    "Russian": "Восток;Север;Высота;Красный;Зелёный;Синий", "Chinese": "东坐标;北坐标;高程;红;绿;蓝",
    "Japanese": "東;北;標高;赤;緑;青",
    "survey": "E;N;H;R;G;B", "spreadsheet": '"X";"Y";"Z";"Red";"Green";"Blue"', "units": "X (m);Y (m);Z (m);R;G;B",
}  # fmt: skip


@pytest.mark.parametrize("language", HEADERS)
def test_headers_in_many_languages_and_encodings_name_the_columns(tmp_path, language):
    tried = 0
    for encoding in ("utf-8", "utf-8-sig", "cp1252", "cp1250", "cp1251", "cp1254", "gb18030", "shift_jis"):
        try:
            header = HEADERS[language].encode(encoding)
        except UnicodeEncodeError:
            continue
        path = tmp_path / "a.csv"
        path.write_bytes(header + b"\n" + b"".join(b"%d;%d;%d;9;8;7\n" % (i, 2 * i, 3 * i) for i in range(9)))
        xyz, rgb, warnings = read(path)
        assert rgb is not None and xyz[2].tolist() == [2, 4, 6] and rgb[0].tolist() == [9, 8, 7] and warnings == [], encoding
        tried += 1
    assert tried >= 3


def test_the_better_of_two_names_of_a_column_is_taken():
    assert columns_named("lat,lon,alt,x,y,z", ",", 6) == "---xyz"
    assert columns_named("Name,Northing,Easting,Elevation,Description", ",", 5) == "-yxz-"
    assert columns_named("nx,ny,nz,x,y,z", ",", 6) == "---xyz" and columns_named("a,b,c", ",", 3) is None


@pytest.mark.parametrize("word", ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND", "1.#INF", "NaNQ", "-nan", "nan(snan)", "NULL",
                                  "N/A", "#N/A", "*****", "-", "inf", "-Infinity", "1.#J"])  # fmt: skip
def test_what_is_no_number_in_any_spelling_is_left_out(tmp_path, word):
    path = tmp_path / "a.csv"
    path.write_text("x,y,z\n" + "1,2,3\n" * 5 + f"1,{word},{word}\n" + "1,2,3\n")
    xyz, _, _ = read(path)
    assert len(xyz) == 7 and not np.isfinite(xyz[5, 1:]).any() and np.isfinite(np.delete(xyz, 5, 0)).all()


@pytest.mark.parametrize("valid", [0, 3])
def test_coordinates_that_are_not_numbers_do_not_make_colours_of_a_row_its_coordinates(tmp_path, valid):
    """Scanners write nan nan nan for directions without a return: one row in ``valid`` has a point, or none has."""
    xyz, rgb = points()
    returned = np.arange(COUNT) % 3 == 0 if valid else np.zeros(COUNT, bool)
    rows = [" ".join(map(str, (*(p if seen else ["nan"] * 3), *c))) for p, c, seen in zip(xyz, rgb, returned, strict=True)]
    (path := tmp_path / "a.xyz").write_text("\n".join(rows))
    read_xyz, read_rgb, _ = read(path)
    finite = np.isfinite(read_xyz).all(axis=1)
    np.testing.assert_array_equal(read_xyz[finite], xyz[returned])
    assert not valid or (read_rgb[finite] == rgb[returned]).all()


@pytest.mark.parametrize(("text", "mark", "value"), [
    ("1.5D+02", ".", 150.0), ("1.5-102", ".", 1.5e-102), ("1,5D2", ",", 150.0), ("\u22121.5", ".", -1.5),
    ("1\u202f234,5", ",", 1234.5), ("1.234,5", ",", 1234.5), ("1,234.5", ".", 1234.5), ("12,34.5", ".", None),
    ("12.5m", ".", None), ("2024-05-01", ".", None), ("1_000", ".", None), ("Nancy", ".", None), ("", ".", None),
])  # fmt: skip
def test_numbers_in_other_spellings(text, mark, value):
    assert number(text, mark) == value


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
@pytest.mark.parametrize(("suffix", "text"), [
    (".csv", "x;y;z;Größe\r\n{};{};{};7\r\n"), (".xyz", "{} {} {}\n"), (".txt", "X\tY\tZ\n{}\t{}\t{}\n"),
    (".asc", "{} {} {}\n"), (".pts", "2000\n{} {} {} 5 1 2 3\n"), (".pts", "{} {} {} 5 1 2 3\n"),
])  # fmt: skip
def test_utf_16_with_a_byte_order_mark_is_read(tmp_path, encoding, suffix, text):
    xyz = np.round(np.random.default_rng(4).random((2000, 3)) * (30, 20, 4) + (100, 200, 0), 3)
    *head, row = text.splitlines(keepends=True)
    path = tmp_path / f"a{suffix}"
    path.write_bytes(("\ufeff" + "".join(head) + "".join(row.format(*point) for point in xyz)).encode(encoding))
    source = open_source(path)
    assert np.array_equal(np.concatenate([chunk.xyz for chunk in source.chunks()]), xyz)
    runs = [chunk.xyz for chunk in source.sample(500, 50) or ()]
    assert len(np.concatenate(runs)) >= 400 and np.isin(np.concatenate(runs), xyz).all()
    assert not list(tmp_path.glob("pointglass-*")) and main(["info", "--no-cache", str(path)]) == 0


def test_an_esri_grid_in_utf_16_is_read(tmp_path):
    path = tmp_path / "a.asc"
    path.write_bytes("ncols 3\nnrows 2\nxllcorner 5\nyllcorner 6\ncellsize 1\n1 2 3\n4 5 6\n".encode("utf-16"))
    xyz = np.concatenate([chunk.xyz for chunk in open_source(path).chunks()])
    assert xyz[:, 2].tolist() == [1, 2, 3, 4, 5, 6] and xyz[0].tolist() == [5.5, 7.5, 1]


def test_damaged_utf_16_is_refused_in_words(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("x;y;z\n1;2;3\n1;2;3\n4;5;".encode("utf-16") + b"\x00\xd8\x36")
    with pytest.raises(InputError, match="line 4"):
        list(open_source(path).chunks())


def test_text_of_two_or_four_bytes_without_a_mark_is_refused_in_words(tmp_path, capsys):
    path = tmp_path / "a.csv"
    for encoding in ("utf-16-le", "utf-16-be", "utf-32"):
        path.write_bytes("x;y;z\n1;2;3\n".encode(encoding))
        with pytest.raises(InputError, match="UTF-16 text, save it as UTF-8"):
            open_source(path)


@pytest.mark.parametrize("given", [["--columns", "-,x,y,z"], ["--columns=-,x,y,z"], ["--col", "-,x,y,z"]])
def test_values_of_options_may_begin_with_a_minus(tmp_path, given, capsys):
    path = tmp_path / "a.csv"
    path.write_text("".join(f"P{i},{i},2,{i % 7}\n" for i in range(50)))
    assert main(["info", "--no-cache", *given, str(path)]) == 0
    assert "points   50" in capsys.readouterr().out
    out = tmp_path / "o.ply"
    assert main(["export", "--no-cache", *given, str(path), "--clip", "-1,-1,-1,9.5,5,8", "--out", str(out)]) == 0
    assert b"element vertex 10\n" in out.read_bytes()
