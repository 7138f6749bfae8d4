"""Pictures of a place, whose files have a grid each, are those of one grid of the same points, to the byte."""

import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from clouds import camera_in, room

from pointglass.viewer.common.paths import cache_dir
from pointglass.viewer.grid.build_scene import build_scene, in_memory
from pointglass.viewer.grid.building.spacing import of_candidates
from pointglass.viewer.grid.cache import load_folder
from pointglass.viewer.grid.density_layers import Lattice
from pointglass.viewer.grid.place import joined_spacing
from pointglass.viewer.grid.place.convert_files import PlaceOptions, convert_one
from pointglass.viewer.grid.place.join_grids import joined
from pointglass.viewer.grid.place.open_place import open_place
from pointglass.viewer.grid.scene import packed, unpack
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.culling.enclosed_directions import Enclosure
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.work.places.pick import pick
from pointglass.viewer.work.scan_files import files_of
from pointglass.viewer.work.selection import Selection

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from cloud_files import write_ply

VIEWS = ("raw", "filtered", "filled", "neural")


def made_files(folder, seed: int, number: int):
    """A room cut into files that overlap, of different sizes, far from the origin of coordinates."""
    random = np.random.default_rng(seed)
    xyz, rgb, _, _ = unpack(room(seed, 60_000, origin=(4e5, 5e6, 100.0)))
    owner = np.clip(np.floor((xyz[:, 0] - xyz[:, 0].min()) / 6 * number + random.normal(0, 0.4, len(xyz))), 0, number - 1)
    return [write_ply(folder / f"part{k}.ply", xyz[owner == k], rgb[owner == k]) for k in range(number)]


def both(files):
    """The place, and one grid of its points with the same cells.  Noise and spacing are estimates: the same here."""
    found: list[np.ndarray] = []
    with patch.object(joined_spacing, "of_candidates", lambda words: found.append(of_candidates(words)) or found[-1]):
        place, left_out = open_place(files, match=False)
    assert left_out == []
    one = build_scene(files, in_memory, match=False, lattice=Lattice(place.cell_size))
    # both are medians around some 350 points, others each; a room with dense boxes has few spacings about its median, so that
    # the medians may be 42 % apart (seed 192401465) with 3 % of the spacings between them; a share of .15 is four deviations
    steps = np.concatenate(found)
    assert abs(np.mean(steps[steps > 0] * place.step < one.spacing) - 0.5) < 0.15
    return replace(place, noise=one.noise, spacing=one.spacing), one


def pictures(context, scene, camera, raster, sampled, **options):
    """sampled: the scene whose sample of points decides which directions are enclosed.  Another grid of the same points has
    another sample, which changes the answer for some holes."""
    renderer = Renderer(context, scene, raster=raster)
    renderer._enclosure = Enclosure(sampled)
    try:
        frame = renderer.render(camera, Settings(view="neural"), views=VIEWS, **options)
        depth, mask = frame.depth(), frame.mask()
        return {**{view: frame.image(view).copy() for view in VIEWS}, "depth": depth.copy()}, depth.copy(), mask.copy()
    finally:
        renderer.release()


def test_files_beyond_the_numbers_of_points_are_hidden_one_by_one(context, tmp_path, seed):
    """259 stations of as many grids; a packed point tells 256 apart."""
    xyz, rgb, _, _ = unpack(room(seed, 3_000))
    files = [write_ply(tmp_path / f"part{k}.ply", xyz[k::5], rgb[k::5]) for k in range(5)]
    folders = [convert_one(file, cache_dir(), PlaceOptions(cell_size=1.0)) for file in files]
    numbers = [0] * 255 + [1, 2, 3, 4]
    grids = [load_folder(folders[number]) for number in numbers]
    place = joined(grids, [folders[number] for number in numbers])
    assert len(place.meta.scans) == 259 and all(part.can_hide for part in files_of(place))
    camera, every = camera_in(place, seed, (120, 90)), np.arange(259)
    records = place.records.numbers(slice(0, place.count))
    for gone in ((255, 258), (3, 257)):
        left = np.setdiff1d(every, gone)
        rest = joined([grids[k] for k in left], [folders[numbers[k]] for k in left])
        edits = Edits(hidden_stations=gone)
        frames = []
        for scene, some in ((place, edits), (replace(rest, spacing=place.spacing), None)):
            renderer = Renderer(context, scene, raster="cpu")
            frames.append(renderer.render(camera, Settings(view="raw"), views=("raw",), edits=some).image("raw").copy())
            renderer.release()
        assert np.array_equal(*frames)
        sight = Selection.in_sight(place, edits)
        index = np.arange(place.count)
        kept = sight.keeps(unpack(place)[0], unpack(place)[3], index)
        np.testing.assert_array_equal(kept, ~np.isin(place.records.scan_of(records), gone))


@pytest.mark.parametrize("raster", ["compute", "points", "cpu"])
def test_a_place_is_drawn_as_one_grid_of_its_points(context, agree, tmp_path, seed, raster):
    place, one = both(made_files(tmp_path, seed, 5))
    assert len(place.cell_coords) > len(one.cell_coords)  # cells of several grids at one place
    for number in range(3):
        camera = camera_in(one, seed + number, (160, 120))
        made, depth, mask = pictures(context, place, camera, raster, one)
        expected, _, _ = pictures(context, one, camera, raster, one)
        assert agree(made, expected)
        assert made["raw"].any()
    hidden = Edits(hidden_stations=frozenset({1, 3}))
    made, _, _ = pictures(context, place, camera, raster, one, edits=hidden)
    expected, _, _ = pictures(context, one, camera, raster, one, edits=hidden)
    assert agree(made, expected)
    rows, columns = np.nonzero(mask)
    for k in np.random.default_rng(seed).integers(0, len(rows), 5):
        pixel = (columns[k] + 0.5, rows[k] + 0.5)
        ours, other = (pick(scene, camera, mask, depth, pixel) for scene in (place, one))
        assert (ours is None) == (other is None)
        if ours is not None:
            assert (ours.position, ours.rgb, ours.station) == (other.position, other.rgb, other.station)
            assert np.array_equal(packed(place, ours.index), packed(one, other.index))
