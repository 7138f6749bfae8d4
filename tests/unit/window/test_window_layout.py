"""The layout without a window: what the picture gets, and when panels fold.  Recent scans, kept on disk."""

import numpy as np
import pytest

from pointglass.viewer.window.kit.layout import INSPECTOR, NARROW, OUTLINER, Panels, arrange
from pointglass.viewer.window.session.recent import MOST, load_thumbnail, recent_scans, remember


@pytest.mark.parametrize("seed", range(20))
def test_nothing_overlaps_and_nothing_lies_outside_the_window(seed):
    rng = np.random.default_rng(seed)
    scale = float(rng.choice([1.0, 1.5, 2.0]))
    width, height = float(rng.integers(320, 4000)), float(rng.integers(200, 2200))
    panels = Panels(bool(rng.integers(2)), bool(rng.integers(2)))
    made = arrange(width, height, scale, panels)
    assert (made.outliner is not None, made.inspector is not None) == (panels.outliner, panels.inspector)
    assert made.status is not None
    for rect in (made.picture, made.outliner, made.inspector, made.status, made.uncovered):
        if rect is not None:
            assert rect.left >= 0 and rect.top >= 0 and rect.width > 0 and rect.height > 0
            assert rect.right <= width + 1e-9 and rect.top + rect.height <= height + 1e-9
    assert made.picture.top + made.picture.height <= made.status.top + 1e-9
    left = made.outliner.right if made.outliner else 0.0
    right = made.inspector.left if made.inspector else width
    if made.covering:
        assert (made.picture.left, made.picture.right) == (0.0, width)
    else:
        assert (made.picture.left, made.picture.right) == pytest.approx((left, right))
        assert made.uncovered == made.picture


def test_the_picture_has_68_percent_of_a_common_window_and_all_of_it_where_panels_are_folded():
    assert arrange(1280.0, 720.0, 1.0, Panels()).picture.width >= 0.68 * 1280
    assert arrange(3840.0, 2160.0, 1.0, Panels()).picture.width == 3840 - OUTLINER[2] - INSPECTOR[2]
    assert arrange(1000.0, 700.0, 1.0, Panels(False, False)).picture.width == 1000


def test_panels_fold_once_where_it_becomes_narrow_and_open_again_as_they_were():
    panels = Panels(True, False)
    panels.fit(NARROW + 1, 1.0)
    assert (panels.outliner, panels.inspector) == (True, False)
    panels.fit(NARROW - 1, 1.0)
    assert (panels.outliner, panels.inspector) == (False, False)
    panels.inspector = True  # opened by hand: it stays
    panels.fit(NARROW - 50, 1.0)
    assert panels.inspector
    panels.fit(NARROW + 1, 1.0)
    assert (panels.outliner, panels.inspector) == (True, True)
    panels.fit(1.5 * NARROW, 2.0)
    assert (panels.outliner, panels.inspector) == (False, False), "narrow by the screen's scale"


def test_recent_scans_are_the_latest_first_each_once_and_keep_their_thumbnail(tmp_path, monkeypatch, seed):
    monkeypatch.setenv("POINTGLASS_STATE", str(tmp_path / "state"))
    assert recent_scans() == []
    rng = np.random.default_rng(seed)
    picture = rng.integers(0, 255, (90, 400, 3), np.uint8)
    files = [tmp_path / f"{number}.laz" for number in range(MOST + 3)]
    for number, file in enumerate(files):
        remember([file], file.name, number, picture)
    remember([files[5]], "again", 99, None)
    kept = recent_scans()
    assert len(kept) == MOST and kept[0].title == "again" and kept[1].title == files[-1].name
    shown = load_thumbnail(kept[0])
    assert shown is not None and shown.shape == (200, 320, 3), "the thumbnail of the first start"
    pictures = {path.name for path in (tmp_path / "state").glob("*.png")}
    assert pictures == {scan.thumbnail.name for scan in kept}, "those of forgotten scans are gone"
    assert not list((tmp_path / "state").glob("*.partial")) and kept[0].missing.startswith(str(files[5]))


@pytest.mark.parametrize("text", ["", "{", "[1]", '[{"paths": 3}]', "null"])
def test_a_damaged_list_of_recent_scans_is_empty_and_is_written_anew(tmp_path, monkeypatch, text):
    monkeypatch.setenv("POINTGLASS_STATE", str(tmp_path))
    (tmp_path / "recent.json").write_text(text)
    assert recent_scans() == []
    remember([tmp_path / "a.laz"], "a", 1, None)
    assert [scan.title for scan in recent_scans()] == ["a"]
