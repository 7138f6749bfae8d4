"""A handle between two dates: each side shows one file alone, and `render --like` repeats the picture."""

from dataclasses import replace

import numpy as np
import pytest
from dated_scans import dates_in_colour

from pointglass.viewer import cli
from pointglass.viewer.common.files import write_png
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.composition import joined
from pointglass.viewer.picture.dates.date_comparison import DateComparison
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.render.described_picture import picture_of
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.window.session.two_dates import dates_of
from pointglass.viewer.work.comparing.scene_changes import keys_of, spec_with_changes
from pointglass.viewer.work.pictures.shot_metadata import KEY, describe_shot, read_shot
from pointglass.viewer.work.scan_files import files_of


@pytest.mark.parametrize("views", [("filled", "filled"), ("raw", "filtered")])
def test_each_side_is_the_picture_of_its_date_alone_and_is_drawn_again(context, tmp_path, seed, views, capsys):
    scans = dates_in_colour(tmp_path, seed)
    scene = open_scene(scans, cache=False)
    renderer = Renderer(context, scene)
    camera = from_fov(160, 100, 70, look_at((1.0, 1.2, 2.6), (2.0, 2.5, 1.0)), "shot")
    plain = PictureSpec(camera, Settings(view=views[0]), views, background="gradient", split_at=0.37)
    spec = dates_of(files_of(scene), 0, 1).spec(plain)
    image = picture_of(renderer, spec)
    alone = []
    for view, hidden in zip(views, (1, 0), strict=True):
        one = replace(plain, views=(view,), edits=Edits(hidden_stations=(hidden,)))
        alone.append(picture_of(renderer, one))
    renderer.release()
    column = round(0.37 * 160)
    below = slice(20, None)  # the titles
    assert np.array_equal(image[below, :column], alone[0][below, :column])
    assert np.array_equal(image[below, column:], alone[1][below, column:])
    assert not np.array_equal(alone[0], alone[1])
    assert np.array_equal(image, joined([np.dstack([a, np.full(a.shape[:2], 255, np.uint8)]) for a in alone], "black",
                                        spec.titles, 0.37))
    made = tmp_path / "shot.png"
    write_png(made, image, {KEY: describe_shot(scene, spec, exposures="matched").text()})
    assert read_shot(made).spec == spec
    assert cli.main(["render", *map(str, scans), "--like", str(made), "--out", str(tmp_path / "b"), "--no-cache"]) == 0
    assert (tmp_path / "b" / "shot.png").read_bytes() == made.read_bytes()
    assert "may differ" not in capsys.readouterr().err


@pytest.mark.parametrize("beside", [False, True])
def test_colours_of_a_comparison_are_made_again_from_the_picture_or_one_line_says_what_is_missing(context, tmp_path, seed,
                                                                                                  beside, capsys):
    scans = dates_in_colour(tmp_path, seed, 12_000)
    scene = open_scene(scans, cache=False)
    renderer = Renderer(context, scene)
    camera = from_fov(160, 100, 70, look_at((1.0, 1.2, 2.6), (2.0, 2.5, 1.0)), "shot")
    edits = Edits(comparison=DateComparison(*keys_of(scene), limit=0.6))
    spec = PictureSpec(camera, Settings(view="filtered"), ("filled", "filtered") if beside else (), edits)
    own = picture_of(renderer, spec)
    if beside:
        spec = dates_of(files_of(scene), 0, 1).spec(spec_with_changes(scene, spec))
        assert spec.edits.comparison is None and spec.other_edits.changes is not None
    else:
        spec = spec_with_changes(scene, spec)
    image = picture_of(renderer, spec)
    renderer.release()
    right = image[20:, 80:].astype(int)
    assert not np.array_equal(image, own) and (right[..., 0] > right[..., 2] + 60).any(), "what rose is red"
    made = tmp_path / "shot.png"
    write_png(made, image, {KEY: describe_shot(scene, spec, exposures="matched").text()})
    assert cli.main(["render", *map(str, scans), "--like", str(made), "--out", str(tmp_path / "b"), "--no-cache"]) == 0
    assert (tmp_path / "b" / "shot.png").read_bytes() == made.read_bytes()
    capsys.readouterr()
    assert cli.main(["render", str(scans[1]), "--like", str(made), "--out", str(tmp_path / "c"), "--no-cache"]) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert "before.xyz is not open" in last and not (tmp_path / "c").exists()
