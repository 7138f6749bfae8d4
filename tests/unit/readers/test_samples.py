"""Samples of each format: points of the file with their colours, spread over the file, read without the rest."""

import builtins
import os
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from cloud_files import E57Scan, edited_e57, write_e57, write_las, write_ply
from format_files import PtxScan, some, text_rows, write_ept, write_pcd, write_potree1, write_potree2, write_ptx

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.las.copc_nodes import read_nodes
from pointglass.viewer.readers.sampling import interleaved, run_starts, sampled_nodes

COUNT, WANTED, RUN = 60_000, 4_000, 50
SEED = int(os.environ.get("POINTGLASS_SEED") or np.random.default_rng().integers(1 << 31))  # printed where a test fails
TURNED = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def along(points):
    """The same points in the order of x, as a scan along a street has them."""
    order = np.argsort(points.xyz[:, 0])
    return type(points)(points.xyz[order], points.rgb[order], points.intensity[order], points.classes[order])


def columns_text(path: Path, points, delimiter=" ", header="") -> Path:
    path.write_text(header + text_rows([points.xyz, points.intensity.astype(int), points.rgb.astype(int)], delimiter))
    return path


def pts(path: Path, points) -> Path:
    rows = text_rows([points.xyz, points.intensity.astype(int), points.rgb.astype(int)]).splitlines(keepends=True)
    half = len(rows) // 2
    path.write_text(f"{half}\n{''.join(rows[:half])}{len(rows) - half}\n{''.join(rows[half:])}")
    return path


def ptx(path: Path, points) -> Path:
    half = len(points.xyz) // 2
    parts = [type(points)(points.xyz[rows], points.rgb[rows], points.intensity[rows], points.classes[rows])
             for rows in (slice(0, half), slice(half, None))]  # fmt: skip
    return write_ptx(path, [PtxScan(parts[0], rotation=TURNED, translation=(5.0, 6.0, 7.0)), PtxScan(parts[1])])


def e57(path: Path, points, **kind) -> Path:
    half = len(points.xyz) // 3
    random = np.random.default_rng(SEED)
    scans = []
    for rows, turned in ((slice(0, half), (0.8, 0.0, 0.6, 0.0)), (slice(half, None), None)):
        n = len(points.xyz[rows])
        scans.append(E57Scan(points.xyz[rows] - points.xyz[0] + 100.0, points.rgb[rows], random.random(n), quaternion=turned,
                             translation=tuple(points.xyz[0]), invalid=random.integers(0, 10, n) == 0,
                             beside={"rowIndex": np.arange(n) % 777}, **kind))  # fmt: skip
    return write_e57(path, scans)


MAKERS = {
    "las": lambda p, d: write_las(d / "a.las", p.xyz, p.rgb.astype(np.uint16) * 257),
    "laz": lambda p, d: write_las(d / "a.laz", p.xyz, p.rgb.astype(np.uint16)),
    "ply": lambda p, d: write_ply(d / "a.ply", p.xyz, p.rgb),
    "ply big-endian": lambda p, d: write_ply(d / "a.ply", p.xyz, p.rgb, order="binary_big_endian"),
    "ply ascii": lambda p, d: write_ply(d / "a.ply", p.xyz, p.rgb, order="ascii"),
    "pcd ascii": lambda p, d: write_pcd(d / "a.pcd", p, "ascii"),
    "pcd binary": lambda p, d: write_pcd(d / "a.pcd", p, "binary", pad=True),
    "pcd compressed": lambda p, d: write_pcd(d / "a.pcd", p, "binary_compressed", real="f4"),
    "pts": lambda p, d: pts(d / "a.pts", p),
    "ptx": lambda p, d: ptx(d / "a.ptx", p),
    "xyz": lambda p, d: columns_text(d / "a.xyz", p),
    "csv": lambda p, d: columns_text(d / "a.csv", p, ",", "x,y,z,intensity,red,green,blue\n"),
    "e57": lambda p, d: e57(d / "a.e57", p),
    "e57 scaled": lambda p, d: e57(d / "a.e57", p, kind="scaled", colour_full=65535),
    "e57 spherical": lambda p, d: e57(d / "a.e57", p, spherical=True, kind="float", limits=False),
    "potree 1": lambda p, d: write_potree1(d / "a", p),
    "potree 1 laz": lambda p, d: write_potree1(d / "a", p, form="laz"),
    "potree 2": lambda p, d: write_potree2(d / "a", p),
    "potree 2 brotli": lambda p, d: write_potree2(d / "a", p, encoding="BROTLI"),
    "ept": lambda p, d: write_ept(d / "a", p),
    "ept binary": lambda p, d: write_ept(d / "a", p, data="binary"),
}
RANGES_OF_THE_SAMPLE = ("e57 spherical",)
"""Here the file does not say how far its intensities go: those of a sample are stretched a little otherwise."""


def everything(chunks, intensity=True):
    """(n, columns) float64 of all points: coordinates, colours, intensities, scan."""
    rows = []
    for chunk in chunks:
        n = len(chunk.xyz)
        rgb = np.zeros((n, 3)) if chunk.rgb is None else chunk.rgb
        level = np.zeros(n) if chunk.intensity is None or not intensity else chunk.intensity
        rows.append(np.column_stack([chunk.xyz, rgb, level, np.broadcast_to(chunk.scan, n)]))
    return np.concatenate(rows)


def in_order(rows):
    return rows[np.lexsort(rows.T)]


@pytest.mark.parametrize("name", MAKERS)
def test_a_sample_is_points_of_the_file_spread_over_it(tmp_path, name):
    path = MAKERS[name](along(some(COUNT, SEED)), tmp_path)
    exact = name not in RANGES_OF_THE_SAMPLE
    whole = everything(open_source(path).chunks(), exact)
    found = open_source(path).sample(WANTED, RUN)
    assert found is not None
    sample = everything(found, exact)
    assert WANTED / 4 <= len(sample) <= 4 * WANTED
    known = set(map(bytes, np.ascontiguousarray(whole)))
    assert all(row in known for row in map(bytes, np.ascontiguousarray(sample)))
    assert len(set(map(bytes, sample))) >= len(set(map(bytes, whole[:: len(whole) // len(sample)]))) // 2  # each once
    low, high = whole[:, :3].min(axis=0), whole[:, :3].max(axis=0)
    for axis in (0, 1):
        share = np.histogram(sample[:, axis], bins=8, range=(low[axis], high[axis]))[0] / len(sample)
        expected = np.histogram(whole[:, axis], bins=8, range=(low[axis], high[axis]))[0] / len(whole)
        assert np.abs(share - expected).max() < 0.08
    assert set(np.unique(sample[:, -1])) == set(np.unique(whole[:, -1]))  # every scan


@pytest.mark.parametrize("name", [name for name in MAKERS if name not in (*RANGES_OF_THE_SAMPLE, "laz")])
def test_a_sample_of_as_many_points_as_the_file_holds_is_the_file(tmp_path, name):
    path = MAKERS[name](along(some(3_000, SEED)), tmp_path)
    whole, sample = everything(open_source(path).chunks()), everything(open_source(path).sample(4_000, 64) or ())
    np.testing.assert_array_equal(in_order(sample), in_order(whole))


class Counted:
    """Counts the bytes that are read from files."""

    def __init__(self, monkeypatch):
        self.bytes = 0
        opened = builtins.open

        def counting(*args, **options):
            file = opened(*args, **options)
            read = getattr(file, "read", None)
            if read is None or "b" not in (args[1] if len(args) > 1 else options.get("mode", "r")):
                return file
            return _Counting(file, self)

        monkeypatch.setattr(Path, "open", lambda path, *args, **options: counting(path, *args, **options))


class _Counting:
    def __init__(self, file, tally):
        self._file, self._tally = file, tally

    def read(self, *args):
        data = self._file.read(*args)
        self._tally.bytes += len(data)
        return data

    def __getattr__(self, name):
        return getattr(self._file, name)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._file.close()


@pytest.mark.parametrize("name", ["ply", "ply ascii", "pcd ascii", "pcd binary", "xyz", "csv", "e57", "e57 scaled", "potree 2"])
def test_a_sample_reads_a_small_part_of_the_file(tmp_path, monkeypatch, name):
    path = MAKERS[name](along(some(COUNT, SEED)), tmp_path)
    source = open_source(path)
    size = sum(file.stat().st_size for file in ([path] if path.is_file() else path.iterdir()))
    counted = Counted(monkeypatch)
    assert sum(len(chunk.xyz) for chunk in source.sample(2_000, 50) or ()) >= 500
    assert 0 < counted.bytes < size / 2


@pytest.mark.parametrize("name", MAKERS)
def test_samples_of_damaged_files_are_points_or_one_line_errors(tmp_path, name):
    random = np.random.default_rng(SEED)
    made = MAKERS[name](along(some(2_000, SEED)), tmp_path / "made" if (tmp_path / "made").mkdir() is None else tmp_path)
    for trial in range(12):
        path = tmp_path / str(trial) / made.name
        if made.is_dir():
            shutil.copytree(made, path)
        else:
            path.parent.mkdir()
            shutil.copy(made, path)
        files = [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.is_file())
        file = files[random.integers(len(files))]
        data = bytearray(file.read_bytes())
        if trial % 3 == 0:
            data = data[: random.integers(len(data))]
        else:
            for _ in range(random.integers(1, 20)):
                data[random.integers(len(data))] = random.integers(256)
        file.write_bytes(data)
        try:
            for chunk in open_source(path).sample(500, 20) or ():
                assert chunk.xyz.shape[1] == 3 and chunk.xyz.dtype == np.float64
        except InputError as error:
            assert "\n" not in str(error) and str(tmp_path) in str(error)


@pytest.mark.parametrize(
    "pattern",
    [
        (rb'maximum="255"', b'maximum="many"'),
        (rb'recordCount="\d+"', b'recordCount="999999999"'),
        (rb'minimum="0"', b'minimum="-9223372036854775808"'),
        (rb'fileOffset="\d+"', b'fileOffset="4"'),
    ],
)
def test_an_e57_whose_xml_and_packets_disagree_has_no_sample(tmp_path, pattern):
    path = edited_e57(e57(tmp_path / "a.e57", some(500, SEED)), pattern)
    try:
        list(open_source(path).sample(500, 20) or ())
    except InputError as error:
        assert str(error).startswith(str(path))


@pytest.mark.parametrize("seed", range(20))
def test_runs_of_several_scans_are_in_proportion(seed):
    random = np.random.default_rng((SEED, seed))
    counts = random.integers(0, 100_000, random.integers(1, 8)).tolist()
    run = int(random.integers(1, 500))
    runs = interleaved(counts, 20_000, run)
    assert {part for part, _ in runs} == {part for part, count in enumerate(counts) if count}
    for part, count in enumerate(counts):
        expected = 20_000 * count / max(sum(counts), 1) / run
        assert sum(of == part for of, _ in runs) <= max(expected, 1) + 1
    assert all(0 <= start < counts[part] for part, start in runs) and len(set(runs)) == len(runs)


@pytest.mark.parametrize("seed", range(20))
def test_runs_that_cover_a_file_do_not_overlap(seed):
    random = np.random.default_rng((SEED, seed))
    count, run = (int(n) for n in random.integers(1, 1000, 2))
    starts = np.sort(run_starts(count, count + run, run))
    assert starts[0] == 0 and (np.diff(starts) == run).all() and starts[-1] + run >= count


@pytest.mark.parametrize("seed", range(20))
def test_nodes_of_a_sample_are_whole_levels_and_a_share_of_the_next(seed):
    random = np.random.default_rng((SEED, seed))
    levels = np.sort(random.integers(0, 6, random.integers(1, 200)))
    levels -= levels.min()
    counts = random.integers(1, 5000, len(levels))
    points = int(random.integers(100, 100_000))
    chosen = sampled_nodes(levels, counts, points)
    total = sum(-(-int(counts[node]) // step) for node, step in chosen)
    assert total <= points + len(chosen)
    assert total >= min(points // 4, counts.sum()) or total >= points // 2
    deepest = max(levels[node] for node, _ in chosen)
    assert all(step == 1 for node, step in chosen if levels[node] < deepest)
    assert sorted(node for node, _ in chosen) == np.flatnonzero(levels <= deepest).tolist()


def copc_hierarchy(path: Path, levels, points, *, pages: int) -> Path:
    """What read_nodes reads of a COPC file: the info record and ``pages`` pages of nodes, each naming the next one."""
    info, entry, page_entry = 375 + 54, struct.Struct("<iiiiQii"), 32
    held = np.array_split(np.arange(len(levels)), pages)
    data, places = bytearray(info + 160), []
    place = len(data) + 7
    for rows in held:
        places.append((place, page_entry * (len(rows) + (rows is not held[-1]))))
        place += places[-1][1]
    data[375:info] = struct.pack("<2x16sHH32x", b"copc", 1, 160)
    struct.pack_into("<QQ", data, info + 40, *places[0])
    data += bytes(7)
    for page, rows in enumerate(held):
        for row in rows:
            data += entry.pack(levels[row], 0, 0, 0, 500 + 10 * int(row), 10, points[row])
        if page + 1 < pages:
            data += entry.pack(9, 0, 0, 0, *places[page + 1], -1)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("seed", range(10))
def test_the_hierarchy_of_a_copc_is_read_from_all_its_pages(tmp_path, seed):
    random = np.random.default_rng((SEED, seed))
    n = int(random.integers(5, 60))
    levels, points = random.integers(0, 9, n), random.integers(0, 1000, n)
    path = copc_hierarchy(tmp_path / "a", levels.tolist(), points.tolist(), pages=int(random.integers(1, 4)))
    nodes = read_nodes(path, int(points.sum()))
    assert nodes is not None
    order = np.argsort(nodes.place)
    np.testing.assert_array_equal(nodes.level[order], levels[points > 0])
    np.testing.assert_array_equal(nodes.points[order], points[points > 0])
    assert read_nodes(path, int(points.sum()) + 1) is None
    path.write_bytes(path.read_bytes()[: random.integers(400, path.stat().st_size)])
    assert read_nodes(path, int(points.sum())) is None


COPC = Path("/work/shared/data/scans/lion_takanawa.copc.laz")


@pytest.mark.skipif(not COPC.exists(), reason="lion_takanawa.copc.laz is not there")
def test_a_sample_of_a_copc_is_its_upper_levels():
    source = open_source(COPC)
    whole, sample = everything(source.chunks()), everything(source.sample(50_000, 1024) or ())
    known = set(map(bytes, np.ascontiguousarray(whole)))
    assert 25_000 <= len(sample) <= 100_000 and all(row in known for row in map(bytes, sample))
    extent, held = np.ptp(whole[:, :3], axis=0), np.ptp(sample[:, :3], axis=0)
    assert (held > 0.98 * extent).all()
