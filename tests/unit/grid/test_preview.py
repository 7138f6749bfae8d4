"""The preview shown while a grid is built: a spread sample with its positions and colours, or none."""

import numpy as np
import pytest
from cloud_files import write_las, write_ply

from pointglass.viewer.grid.preview import preview_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.readers.sampling import run_starts

COUNT = 200_000
ORIGIN = (636_000.0, 5_848_000.0, 400.0)


def street(seed=0):
    """Points in the order of a scan along a street, its colour changing from end to end."""
    rng = np.random.default_rng(seed)
    along = np.sort(rng.uniform(0, 300, COUNT))
    xyz = np.column_stack([along, rng.uniform(0, 10, COUNT), rng.uniform(0, 3, COUNT)]) + ORIGIN
    rgb = np.column_stack([along / 300 * 255, np.full(COUNT, 90), 255 - along / 300 * 255]).astype(np.uint8)
    return xyz, rgb


@pytest.mark.parametrize("name", ["a.laz", "a.las", "a.ply"])
@pytest.mark.parametrize("wide", [False, True])
def test_a_preview_is_spread_over_the_whole_file_in_its_colours(tmp_path, name, wide):
    xyz, rgb = street()
    if name == "a.ply":
        path = write_ply(tmp_path / name, xyz, rgb)
    else:
        path = write_las(tmp_path / name, xyz, rgb.astype(np.uint16) * (257 if wide else 1))
    scene = preview_scene([path], points=20_000, seconds=60, least_bytes=0)
    assert scene is not None and 4_000 < scene.count <= 40_000
    made, colours, _, _ = unpack(scene)
    assert np.abs(scene.bounds - [xyz.min(0), xyz.max(0)]).max() < 60
    shown = colours[:, 0] / 255 * 300 + ORIGIN[0]
    assert np.abs(shown - made[:, 0]).max() < 2.5  # each point has the colour of its own place
    share = np.histogram(made[:, 0] - ORIGIN[0], bins=4, range=(0, 300))[0] / scene.count
    assert share.min() > 0.1
    assert scene.meta.sources == (str(path),)


def test_small_damaged_and_unknown_files_have_no_preview(tmp_path):
    xyz, rgb = street()
    whole = write_las(tmp_path / "a.laz", xyz, rgb)
    assert preview_scene([whole]) is None  # it opens as fast
    data = whole.read_bytes()
    for cut in (100, 400, len(data) // 2):
        (tmp_path / "cut.laz").write_bytes(data[:cut])
        assert preview_scene([tmp_path / "cut.laz"], least_bytes=0) is None
    (tmp_path / "b.laz").write_bytes(b"\0" * 5000)
    assert preview_scene([tmp_path / "b.laz"], least_bytes=0) is None
    assert preview_scene([tmp_path / "none.laz"], least_bytes=0) is None


@pytest.mark.parametrize("seed", range(20))
def test_every_beginning_of_the_list_of_runs_is_spread_over_the_file(seed):
    rng = np.random.default_rng(seed)
    count, run = int(rng.integers(10_000, 10_000_000)), int(rng.integers(1, 2000))
    align = int(rng.choice([1, 5000, 50_000]))
    starts = run_starts(count, int(rng.integers(run, 400_000)), run, align)
    assert len(starts) and (starts >= 0).all() and (starts < count).all() and len(np.unique(starts)) == len(starts)
    if len(starts) >= 16:
        beginning = starts[: len(starts) // 2]
        assert np.diff(np.sort(beginning)).max() < 0.5 * count


def test_without_time_there_is_no_preview(tmp_path):
    xyz, rgb = street()
    path = write_las(tmp_path / "a.las", xyz, rgb)
    assert preview_scene([path], points=20_000, seconds=0.0, least_bytes=0) is None  # too few points to show


def test_the_window_previews_a_cached_scan_only_where_the_cache_is_not_used(tmp_path):
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.window.session import loading

    rng = np.random.default_rng(1)
    path = tmp_path / "big.xyz"
    np.savetxt(path, np.c_[rng.random((60_000, 3)) * 5, rng.integers(0, 256, (60_000, 3))], fmt="%.9f %.9f %.9f %d %d %d")
    assert loading.preview_scene([path]) is not None
    open_scene(path)
    assert loading.preview_scene([path]) is None, "it opens as fast"
    assert loading.preview_scene([path], cache=False) is not None
