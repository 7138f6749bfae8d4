"""Points of LAZ files are decoded in processes of their own: exactly, in pieces of any size, and a damaged file ends at most
such a process.  The records that lazrs compressed are the reference."""

import io
import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

import lazrs
import numpy as np
import pytest
from test_laz_chunks import write_laz

from pointglass.viewer import cli
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.las import laz_points
from pointglass.viewer.readers.las.laz_points import LazError, LazPoints
from pointglass.viewer.readers.las.laz_worker import items_of, layers_of, refusal

GPS_LAYER = 8
"""Number of the layer of GPS times in point formats 6 to 10."""


def made(folder: Path, seed: int, *, point_format: int, extra: int, chunks: list[int], kind: str) -> tuple[LazPoints, bytes]:
    """A file that consists of these chunks of points, and its records.  kind: random bytes; smooth; or like the first point."""
    rng = np.random.default_rng(seed)
    described = lazrs.LazVlr.new_for_compression(point_format, extra, True)
    length, record, count = described.item_size(), bytes(described.record_data()), sum(chunks)
    raw = rng.integers(0, 256, (count, length)).astype(np.uint8)
    if kind == "smooth":
        raw[:] = np.arange(count)[:, None] // rng.integers(1, 50, length) % 256
    elif kind == "same":
        raw[:, 12:] = raw[0, 12:]
    if point_format > 5:  # lazrs confuses the waveforms of formats 9 and 10 where scanner channels alternate
        raw[:, 15] &= 0b11001111
    data, place = io.BytesIO(), []
    for start, size in zip(np.cumsum([0, *chunks]).tolist(), chunks):
        piece = io.BytesIO()
        compressor = lazrs.LasZipCompressor(piece, described)
        compressor.compress_many(raw[start : start + size].tobytes())
        compressor.done()
        piece.seek(0)
        ((_, held),) = lazrs.read_chunk_table(piece, described)
        place.append((data.tell(), held))
        data.write(piece.getvalue()[8 : 8 + held])
    path = folder / f"{seed}.chunks"
    path.write_bytes(data.getvalue())
    begin, held = np.array(place, np.int64).T
    return LazPoints(path, record, length, np.array(chunks, np.int64), held, begin), raw.tobytes()


@pytest.mark.parametrize("extra", [0, 5])
@pytest.mark.parametrize("point_format", range(11))
def test_every_point_format_is_decoded_exactly_in_pieces_of_any_size(tmp_path, seed, point_format, extra):
    rng = np.random.default_rng(seed)
    chunks = [1, *rng.integers(1, 400, 5).tolist(), 2]
    for kind in ("random", "smooth", "same"):
        points, raw = made(tmp_path, seed, point_format=point_format, extra=extra, chunks=chunks, kind=kind)
        count = sum(chunks)
        for most in (1 << 20, 150, 37):
            found = list(points.blocks(most))
            assert b"".join(found) == raw and max(map(len, found)) <= most * points.length
        for start, stop in np.sort(rng.integers(0, count + 1, (6, 2))).tolist():
            assert points.read(start, stop) == raw[start * points.length : stop * points.length]
        assert points.read(0, count + 5) == raw
        third = points.chunk(int(points.place[3]), int(points.held[3]), chunks[3])
        assert third == points.read(sum(chunks[:3]), sum(chunks[:4]))


@pytest.mark.parametrize(("soon", "kept"), [(10_000, True), (100, False)])
def test_a_process_is_kept_where_a_reader_stops_early_and_its_answer_comes_soon(monkeypatch, tmp_path, seed, soon, kept):
    monkeypatch.setattr(laz_points, "_SOON", soon)
    laz_points._end_all()
    points, raw = made(tmp_path, seed, point_format=7, extra=0, chunks=[400, 400, 400], kind="random")
    blocks = points.blocks(400)
    first = next(blocks)
    blocks.close()
    assert len(laz_points._idle) == kept
    assert first + points.read(400, 1200) == raw  # no answer is left over for the next request


def streams_of(points: LazPoints) -> list[int]:
    """The bytes at which the streams of the first chunk begin."""
    layers = layers_of(points.record)
    if layers == 0:
        return [points.length]
    sizes = np.frombuffer(points.path.read_bytes(), "<u4", layers, points.length + 4).astype(np.int64)
    return (points.length + 4 + 4 * layers + np.append(0, sizes[:-1].cumsum()))[sizes > 0].tolist()


@pytest.mark.parametrize("point_format", range(11))
def test_a_stream_that_begins_as_none_does_is_refused_before_it_is_decoded(tmp_path, seed, point_format):
    points, raw = made(tmp_path, seed, point_format=point_format, extra=2, chunks=[700], kind="random")
    good = points.path.read_bytes()
    for place in streams_of(points):
        for value, refused in ((0xFFFFFFFF, True), (0xFFFFFFFE, False)):
            data = bytearray(good)
            struct.pack_into(">I", data, place, value)
            why = refusal(io.BytesIO(data), 0, len(data), points.record)
            assert (why is not None) == refused
            if refused:
                points.path.write_bytes(data)
                with pytest.raises(LazError, match="begins as no program writes it"):
                    points.read(0, 700)
    points.path.write_bytes(good)
    assert points.read(0, 700) == raw


def without_end(points: LazPoints) -> None:
    """Makes the GPS times of the first chunk switch their sequence without end, which fills the decoder's stack."""
    data = bytearray(points.path.read_bytes())
    place, size = points.length, len(data) - points.length
    if layers := layers_of(points.record):
        sizes = struct.unpack_from(f"<{layers}I", data, points.length + 4)
        place, size = points.length + 4 + 4 * layers + sum(sizes[:GPS_LAYER]), sizes[GPS_LAYER]
    data[place : place + size] = b"\xff\xff\xff\xfe" + b"\xff" * (size - 4)
    points.path.write_bytes(data)


@pytest.mark.parametrize("point_format", [1, 3, 4, 5, 6, 7, 8, 9, 10])
def test_a_chunk_that_ends_its_decoder_is_refused_and_others_are_read(tmp_path, seed, point_format):
    points, _ = made(tmp_path, seed, point_format=point_format, extra=0, chunks=[600], kind="random")
    other, raw = made(tmp_path, seed + 1, point_format=point_format, extra=0, chunks=[600], kind="random")
    without_end(points)
    with pytest.raises(LazError, match="ends the decoder"):
        points.read(0, 600)
    with pytest.raises(LazError, match="ends the decoder"):
        list(points.blocks(100))
    assert other.read(0, 600) == raw


@pytest.mark.parametrize(("point_format", "harm"), [(3, "start"), (7, "start"), (3, "stack")])
def test_commands_refuse_damaged_chunks_in_one_line(tmp_path, capsys, point_format, harm):
    path = write_laz(tmp_path / "a.laz", point_format=point_format)
    source = open_source(path)
    laz, data = source._laz, bytearray(path.read_bytes())
    begin, held = int(laz.place[0]), int(laz.held[0])
    chunk = LazPoints(tmp_path / "chunk", laz.record, laz.length, laz.points, laz.held, laz.place * 0)
    chunk.path.write_bytes(data[begin : begin + held])
    if harm == "start":
        place = streams_of(chunk)[-1]
        data[begin + place : begin + place + 4] = b"\xff" * 4
    else:
        without_end(chunk)
        data[begin : begin + held] = chunk.path.read_bytes()
    path.write_bytes(data)
    with pytest.raises(InputError):
        list(source.chunks())
    for command in (["info"], ["convert", "--out", str(tmp_path / "grid")], ["export", "--out", str(tmp_path / "b.laz")]):
        assert cli.main([command[0], str(path), *command[1:]]) == 2
        said = capsys.readouterr()
        (line,) = [line for line in said.err.splitlines() if line]
        assert "a.laz: truncated or damaged: 0 of 2,000 points" in line and line.endswith("copy or export it again")
        assert said.out == ""


def test_the_processes_end_with_their_parent(tmp_path):
    points, _ = made(tmp_path, 1, point_format=3, extra=0, chunks=[50], kind="smooth")
    points.read(0, 50)
    script = (
        "import sys, time; from pathlib import Path; import numpy as np; "
        "from pointglass.viewer.readers.las import laz_points as l; "
        f"p = l.LazPoints(Path({str(points.path)!r}), bytes.fromhex({points.record.hex()!r}), {points.length}, np.array([50]), "
        f"np.array([{points.held[0]}]), np.array([0])); p.read(0, 50); print(l._idle[0].pid, flush=True); "
    )
    for rest in ("", "time.sleep(60)"):
        with subprocess.Popen([sys.executable, "-c", script + rest], stdout=subprocess.PIPE, text=True) as parent:
            assert parent.stdout is not None
            worker = int(parent.stdout.readline())
            parent.send_signal(signal.SIGKILL if rest else 0)
            parent.wait()
        for _ in range(100):
            state = Path(f"/proc/{worker}/stat")
            if not state.exists() or state.read_text().split(")")[1].split()[0] == "Z":
                break
            signal.sigtimedwait([], 0.05)
        else:
            raise AssertionError("the process that decodes goes on")


def test_a_process_is_used_again(tmp_path):
    points, _ = made(tmp_path, 1, point_format=3, extra=0, chunks=[50, 50], kind="smooth")
    points.read(0, 100)
    (first, *_), count = laz_points._idle[-1:], len(laz_points._idle)
    list(points.blocks(10))
    points.read(5, 70)
    assert laz_points._idle[-1] is first and len(laz_points._idle) == count and os.getpid() != first.pid


def test_the_description_of_points_is_read_as_lazrs_reads_it():
    for point_format, layers in ((0, 0), (3, 0), (6, 9), (7, 10), (8, 11), (10, 12)):
        for extra in (0, 3):
            described = lazrs.LazVlr.new_for_compression(point_format, extra, False)
            record = bytes(described.record_data())
            assert sum(size for _, size, _ in items_of(record)) == described.item_size()
            assert layers_of(record) == (layers + extra if layers else 0)
