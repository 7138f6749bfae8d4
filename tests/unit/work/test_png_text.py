"""Pictures given to `render --like`: damaged, hostile, enormous; and every picture that pointglass made."""

import json
import struct
import zlib

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.files import write_png
from pointglass.viewer.picture.camera import from_fov
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.work.pictures.png_text import png_text
from pointglass.viewer.work.pictures.shot_metadata import KEY, Shot, read_shot

CAMERA = from_fov(64, 48, 70, np.eye(4), "a")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _png(*chunks: bytes, side: int = 1) -> bytes:
    head = _chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + b"".join(chunks) + _chunk(b"IDAT", b"") + _chunk(b"IEND", b"")


def _itxt(text: bytes, packed: bool = False) -> bytes:
    return _chunk(b"iTXt", KEY.encode() + bytes([0, packed, 0, 0, 0]) + (zlib.compress(text) if packed else text))


def _shot() -> dict:
    spec = PictureSpec(CAMERA, Settings(view="filled"), background="black")
    return json.loads(Shot(spec, "matched", ("house.laz",), 120).text())


def _changed(*keys, value) -> str:
    found = _shot()
    inner = found
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    return json.dumps(found)


def test_text_of_every_kind_in_pictures_of_any_size(tmp_path):
    path, text = tmp_path / "a.png", json.dumps(_shot())
    chunks = {"plain": _itxt(text.encode()), "packed": _itxt(text.encode(), True),
              "latin": _chunk(b"tEXt", f"{KEY}\0{text}".encode()),
              "zip": _chunk(b"zTXt", f"{KEY}\0\0".encode() + zlib.compress(text.encode()))}
    for chunk in chunks.values():
        path.write_bytes(_png(_chunk(b"tEXt", b"other\0text"), chunk, side=60_000))
        assert png_text(path, KEY) == text and read_shot(path).points == 120
    path.write_bytes(_png(side=60_000))
    assert png_text(path, KEY) is None
    with pytest.raises(InputError, match="does not say how it was made"):
        read_shot(path)


def test_what_write_png_writes_is_read(tmp_path):
    shot = Shot(PictureSpec(CAMERA, Settings(view="filled"), background="sky"), "as-scanned", ("Büro.laz",), 7)
    write_png(tmp_path / "a.png", np.zeros((3, 4, 3), np.uint8), {KEY: shot.text()})
    assert read_shot(tmp_path / "a.png").text() == shot.text()


BAD = {
    "infinite points": _changed("points", value=float("inf")),
    "nan": _changed("camera", "fx", value=float("nan")),
    "400 digits": json.dumps(_shot()).replace("120", "9" * 400),
    "400 digits in the camera": _changed("camera", "fx", value=0).replace('"fx": 0', '"fx": 1' + "0" * 400),
    "400 digits in the pose": json.dumps(_shot()).replace("1.0, 0.0", "1" + "0" * 400 + ", 0.0", 1),
    "5000 digits": json.dumps(_shot()).replace("120", "9" * 5000),
    "points a text": _changed("points", value="120"),
    "points true": _changed("points", value=True),
    "points negative": _changed("points", value=-1),
    "weights a number": _changed("settings", "weights", value=5),
    "view a list": _changed("settings", "view", value=["raw"]),
    "lod a text": _changed("settings", "lod", value="2"),
    "settings a list": _changed("settings", value=[]),
    "background a list": _changed("background", value=[]),
    "scans a number": _changed("scans", value=3),
    "scans of numbers": _changed("scans", value=[3]),
    "version with an escape": _changed("version", value="\x1b[31m"),
    "scan with an escape": _changed("scans", value=["\x1b]0;x\x07"]),
    "name NUL": _changed("camera", "name", value="\0"),
    "name a number": _changed("camera", "name", value=7),
    "name upwards": _changed("camera", "name", value="./../escaped"),
    "name absolute": _changed("camera", "name", value="/tmp/escaped"),
    "pose a text": _changed("camera", "camera_to_world", value="x"),
    "pose empty": _changed("camera", "camera_to_world", value=[]),
    "comparison a list": _changed("comparison", value=[1]),
    "split a text": _changed("comparison", value={"view": "raw", "split_at": "x"}),
    "alterations a list": _changed("alterations", value=[1]),
    "brackets": "[" * 100_000,
    "no object": "[]",
    "empty": "",
}


@pytest.mark.parametrize("what", BAD)
def test_a_damaged_description_is_one_line(tmp_path, what):
    (tmp_path / "a.png").write_bytes(_png(_itxt(BAD[what].encode())))
    with pytest.raises(InputError) as caught:
        read_shot(tmp_path / "a.png")
    assert str(caught.value).startswith(str(tmp_path / "a.png")) and str(caught.value).isprintable()


def test_a_damaged_file_is_one_line(tmp_path, seed):
    path, rng = tmp_path / "a.png", np.random.default_rng(seed)
    whole = _png(_itxt(json.dumps(_shot()).encode()))
    bombs = [_png(_itxt(b"a" * (20 << 20), True)), _png(_chunk(b"iTXt", KEY.encode() + b"\0\1\0\0\0not packed")), b"",
             b"\x89PNG", _png(_chunk(b"iTXt", KEY.encode() + b"\0")), _png(_itxt(b"\xff\xfe")), b"RIFF" + whole]
    for data in [*bombs, *(whole[:n] for n in rng.integers(0, whole.index(b"IDAT") - 4, 20))]:
        path.write_bytes(data)
        with pytest.raises(InputError, match="PNG"):
            read_shot(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_shot(tmp_path)
    for _ in range(200):  # any byte
        data = bytearray(whole)
        data[rng.integers(len(data))] ^= int(rng.integers(1, 256))
        path.write_bytes(data)
        try:
            read_shot(path)
        except InputError as error:
            assert str(error).isprintable()
