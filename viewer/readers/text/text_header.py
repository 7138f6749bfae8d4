"""The names in the header of a text file of points, in the languages of those who write them, as the columns they mean.

Names are compared in lower case, without accents, units, blanks and punctuation: ``Höhe [m]`` is ``hohe``.
"""

import re
import unicodedata

OTHER = "-"
_NAMES = {
    "x": """x xcoord xcoordinate xcoordinates coordx posx pointx cartesianx worldx utmx laserx xm
        easting east eastings ekoord rechtswert rechts rw rwert ost ostwert oest estin est abscisse xkoordinate xkoord
        este estex abscisa coordenadax ascissa coordinatax oost oosten xcoordinaat leste xcoordenada vychod yjtsk
        wschod wspx wspolrzednax ost oster oster oster ostlig itä ita itakoordinaatti dogu kelet est
        восток икс абсцисса коордx долгота 东 東 东坐标 東坐標 东方向 x坐标 x座標 东坐标x 동 경도 anatoli
        longitude lon lng long longitud longitudine lange geolange laenge geogrlange lengtegraad dlugosc 经度 經度 経度""",
    "y": """y ycoord ycoordinate ycoordinates coordy posy pointy cartesiany worldy utmy lasery ym
        northing north northings nkoord hochwert hoch hw hwert nord nordwert ordonnee ykoordinate ykoord
        norte ordenada coordenaday ordinata coordinatay noord noorden ycoordinaat ycoordenada sever
        polnoc wspy wspolrzednay norr nordlig pohjoinen pohjoiskoordinaatti kuzey eszak
        север игрек ордината коордy широта 北 北坐标 北坐標 北方向 y坐标 y座標 북 위도 voras
        latitude lat latitud latitudine breite geobreite geogrbreite breedtegraad szerokosc 纬度 緯度""",
    "z": """z zcoord zcoordinate zcoordinates coordz posz pointz cartesianz worldz utmz laserz zm
        elevation elev height altitude alt level hohe hoehe hohen hohenwert zkoordinate zkoord hauteur cote altimetrie
        altura altitud elevacion cota coordenadaz quota altezza elevazione coordinataz hoogte zcoordinaat elevacao zcoordenada
        vyska nadmorskavyska wysokosc rzedna wspz wspolrzednaz hojd hoyde hojde korkeus yukseklik kot magassag ypsometro
        высота отметка зет аппликата коордz 高 高程 高度 标高 標高 高さ z坐标 z座標 높이 표고 고도""",
    "r": """r red rf colorred diffusered colourred scalarred rot rouge rojo rosso rood vermelho cervena cerveny czerwony
        czerwona rod punainen kirmizi piros voros красный красн 红 紅 红色 赤 빨강 rgbr valuered""",
    "g": """g green gf colorgreen diffusegreen colourgreen scalargreen grun gruen vert verde groen zelena zeleny zielony zielona
        gron vihrea yesil zold зеленый зелен 绿 綠 绿色 緑 초록 rgbg valuegreen""",
    "b": """b blue bf colorblue diffuseblue colourblue scalarblue blau bleu azul blu blauw modra modry niebieski niebieska
        bla sininen mavi kek синий син голубой 蓝 藍 蓝色 青 파랑 rgbb valueblue""",
    "i": """i intensity scalarintensity intens int reflectance scalarreflectance reflectivity amplitude intensitat intensitaet
        intensite intensidad intensita intensiteit intensidade intenzita intensywnosc odbicie intensitet intensiteetti yogunluk
        intenzitas reflexion remission интенсивность интенс отражение 强度 強度 反射强度 反射強度 反射率 강도 signalstrength""",
    "c": """c class classification scalarclassification classcode classid klasse klassifikation klassifizierung classe
        classificacion classificazione clase classificacao klassificatie trida klasifikace klasa klasyfikacja klass
        luokka sinif osztaly класс классификация 类别 分类 类 分類 クラス 분류""",
}  # fmt: skip
_SHORT = {"e": "x", "n": "y", "h": "z", "q": "z"}
"""Names of one letter that mean easting, northing and height where the header has no x, y, z."""
_ANGLES = ("lon", "lng", "lat", "lang", "breit", "geo", "долгот", "широт", "经", "經", "纬", "緯")
"""Beginnings of the names of angles, which are taken where the header names nothing better."""
_LETTERS = str.maketrans({"ł": "l", "ø": "o", "ß": "ss", "æ": "ae", "ð": "d", "đ": "d", "ı": "i"})
_UNIT = re.compile(r"[\[(（][^\])）]*[\])）]")
_ENCODINGS = ("utf-8", "cp1252", "cp1250", "cp1251", "gb18030", "shift_jis", "euc_kr", "cp1254", "cp437", "mac_roman")
"""Encodings in which a header is tried: the first in which it names x, y and z and most other columns is taken."""


def _plain(word: str) -> str:
    """A name in lower case, without accents, units, blanks and punctuation."""
    text = unicodedata.normalize("NFKD", _UNIT.sub("", word).casefold().translate(_LETTERS))
    return "".join(c for c in text if c.isalnum())


_COLUMN_OF = {_plain(name): column for column, names in _NAMES.items() for name in names.split()}
_BEGINS = re.compile(r"^(?:scalar|point|punkt|koord(?:inate)?|coord(?:inate|onnee|enada|inata)?)")


def columns_named(header: str, delimiter: str, count: int) -> str | None:
    """The columns that a header names, a letter each; None where it does not name ``count`` columns with x, y and z.

    header: as Latin-1 text, which holds the bytes of any encoding.  delimiter: of the rows; the header may have another.
    """
    raw, best = header.encode("latin-1", "replace"), None
    for encoding in _ENCODINGS:
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            continue
        for words in header_words(text, delimiter):
            found = _columns_of(words) if len(words) == count else None
            if found and (best is None or found.count(OTHER) < best.count(OTHER)):
                best = found
    return best


def names_angles(header: str, delimiter: str, columns: str) -> bool:
    """Whether the x and y of a header with these ``columns`` are longitude and latitude."""
    for encoding in ("utf-8", "cp1251", "gb18030"):
        words = header.encode("latin-1", "replace").decode(encoding, "replace")
        for way in header_words(words, delimiter):
            if len(way) == len(columns) and all(_plain(way[columns.index(axis)]).startswith(_ANGLES) for axis in "xy"):
                return True
    return False


def words_of(header: str, delimiter: str, count: int, columns: str | None = None) -> tuple[str, ...]:
    """The names in a header, one a field, as they are written; empty where it does not hold ``count`` names.

    columns: those that ``columns_named`` found in it; None: any ``count`` words of which one has a letter.
    """
    raw = header.encode("latin-1", "replace")
    for encoding in _ENCODINGS:
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            continue
        for words in header_words(text, delimiter):
            named = _columns_of(words) == columns if columns else any(c.isalpha() for word in words for c in word)
            if len(words) == count and named:
                return tuple(words)
    return ()


def header_words(header: str, delimiter: str) -> list[list[str]]:
    """The ways in which a header can be split into names.  It may be a comment."""
    text = header.strip().lstrip("#/%; \t\ufeff") if not delimiter else header.strip().lstrip("#/% \ufeff")
    bare = _UNIT.sub("", text)
    ways = [[word.strip() for word in bare.removesuffix(mark).split(mark)] for mark in (delimiter, "\t", ";", ",", "|")
            if mark and mark in bare]  # fmt: skip
    return [*ways, bare.split(), re.split(r"[\s,;|]+", bare.strip(" ,;|")), re.split(r"\t|\s{2,}", bare.strip())]


def _rank(name: str, column: str) -> int:
    """Which of several names of one column is taken, the lowest: x before easting before longitude."""
    return 0 if name == column else 2 if name.startswith(_ANGLES) else 1


def _columns_of(words: list[str]) -> str | None:
    names = [_plain(word) for word in words]
    columns = [_COLUMN_OF.get(name) or _COLUMN_OF.get(_BEGINS.sub("", name), OTHER) for name in names]
    if not {"x", "y", "z"} <= set(columns):
        columns = [_SHORT.get(name, column) if _SHORT.get(name) not in columns else column
                   for name, column in zip(names, columns, strict=True)]  # fmt: skip
    taken = {column: min((i for i, other in enumerate(columns) if other == column), key=lambda i: _rank(names[i], column))
             for column in columns}  # fmt: skip
    columns = [column if taken[column] == i else OTHER for i, column in enumerate(columns)]
    if not {"r", "g", "b"} <= set(columns):
        columns = [OTHER if column in "rgb" else column for column in columns]
    return "".join(columns) if {"x", "y", "z"} <= set(columns) else None
