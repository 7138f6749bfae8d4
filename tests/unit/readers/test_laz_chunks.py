"""Invalid chunk tables of LAZ files are refused: lazrs would end the process, or panic."""

import io
import struct

import laspy
import lazrs
import numpy as np
import pytest
from cloud_files import surface, write_las

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.formats import open_source

COUNT = 2000


def write_laz(path, *, point_format=7, chunk=None):
    """chunk: points of each chunk, of variable size as in COPC; None: the default of lazrs."""
    header = laspy.LasHeader(point_format=point_format, version="1.4" if point_format > 5 else "1.2")
    header.scales, header.offsets = np.full(3, 1 / 4096), np.zeros(3)
    las = laspy.LasData(header)
    xyz, rgb = surface(COUNT)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rgb.astype(np.uint16).T * 257
    if chunk is None:
        las.write(str(path))
        return path
    out = io.BytesIO()
    las.write(out)
    raw, record = out.getvalue(), lazrs.LazVlr.new_for_compression(point_format, 0, True)
    begin, length = laspy.open(io.BytesIO(raw)).header.offset_to_point_data, header.point_format.size
    told = bytes(record.record_data())
    head = bytearray(raw[:begin]) + struct.pack("<H16sHH32s", 0, b"laszip encoded", 22204, len(told), b"") + told
    head[104] |= 0x80
    struct.pack_into("<II", head, 96, len(head), 1 + struct.unpack_from("<I", head, 100)[0])
    out = io.BytesIO()
    out.write(head)
    compressor = lazrs.LasZipCompressor(out, record)
    for start in range(0, COUNT, chunk):
        compressor.compress_many(raw[begin + start * length : begin + min(start + chunk, COUNT) * length])
        compressor.finish_current_chunk()
    compressor.done()
    path.write_bytes(out.getvalue())
    return path


def places(data) -> dict[str, int]:
    """The offsets of the parts that tests change."""
    points = struct.unpack_from("<I", data, 96)[0]
    length = struct.unpack_from("<H", data, 105)[0]
    return {"record": data.index(b"laszip encoded") + 52, "points": points, "table": struct.unpack_from("<Q", data, points)[0],
            "layers": points + 8 + length + 4}


@pytest.mark.parametrize("chunk", [None, 300, 2000])
@pytest.mark.parametrize("point_format", [2, 3, 6, 7, 8])
def test_whole_files_are_read(tmp_path, point_format, chunk):
    if point_format == 6:
        path = write_las(tmp_path / "a.laz", surface(COUNT)[0])
    else:
        path = write_laz(tmp_path / "a.laz", point_format=point_format, chunk=chunk)
    scene = open_scene(path, cache=False)
    assert scene.count == COUNT and not any("more follow" in text for text in scene.meta.warning_texts)


@pytest.mark.parametrize("chunk", [None, 300])
@pytest.mark.parametrize(("part", "at", "kind", "value", "said"), [
    ("record", 12, "I", 0, "chunks"), ("record", 32, "H", 0, "how it is compressed"),
    ("record", 32, "H", 9, "how it is compressed"), ("record", 36, "H", 29, "not made of 36 bytes"),
    ("points", 0, "q", 100, "table of chunks"), ("points", 0, "q", 10**9, "table of chunks"),
    ("table", 4, "I", 2**32 - 1, "4,294,967,295 chunks"), ("table", 4, "I", 0, f"0 of {COUNT:,} points"),
    ("table", 4, "I", 10_000, ""), ("layers", 0, "I", 2**32 - 1, "chunk 1 of"), ("layers", 36, "I", 10**6, "chunk 1 of"),
])  # fmt: skip
def test_invalid_chunk_tables_are_refused_on_opening(tmp_path, chunk, part, at, kind, value, said):
    path = write_laz(tmp_path / "a.laz", chunk=chunk)
    data = bytearray(path.read_bytes())
    struct.pack_into("<" + kind, data, places(data)[part] + at, value)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.laz: .*(again|damaged)") as error:
        open_source(path)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_different_counts_are_refused_or_give_a_warning(tmp_path):
    for chunk, count, told in ((300, 2300, "2,000 of 2,300 points"), (300, 1700, "counts 1,700 points, its chunks hold 2,000")):
        path = write_laz(tmp_path / "a.laz", chunk=chunk)
        data = bytearray(path.read_bytes())
        struct.pack_into("<Q", data, 247, count)
        path.write_bytes(data)
        with pytest.raises(InputError, match=told):
            open_source(path)
    xyz, rgb = surface(50_100)
    path = write_las(tmp_path / "b.laz", xyz, rgb)
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, 107, 49_000)  # all in the first of its two chunks
    path.write_bytes(data)
    assert any("49,000 points, but more follow" in text for text in open_source(path).warnings)


def test_a_chunk_that_states_more_points_than_memory_holds_is_read(tmp_path):
    """lazrs would allocate the largest chunk that the record allows, here 77 GB, and end the process if it cannot."""
    path = write_laz(tmp_path / "a.laz")
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, places(data)["record"] + 12, 2**31)
    path.write_bytes(data)
    assert sum(len(chunk.xyz) for chunk in open_source(path).chunks()) == COUNT


def test_a_header_that_counts_no_points_is_refused(tmp_path):
    path = write_laz(tmp_path / "a.laz")
    data = bytearray(path.read_bytes())
    struct.pack_into("<Q", data, 247, 0)
    struct.pack_into("<I", data, 107, 0)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.laz: holds no points"):
        open_scene(path, cache=False)
