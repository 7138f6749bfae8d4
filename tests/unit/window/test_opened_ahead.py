"""What is opened beside the start of the window is what the window would open, once, and only where it is in the cache."""

import numpy as np
import pytest
from cloud_files import surface, write_las

from pointglass.viewer.common.errors import Cancelled
from pointglass.viewer.common.progress import set_sink
from pointglass.viewer.grid import open_scene as opening
from pointglass.viewer.grid.scene import packed
from pointglass.viewer.window.planning import opened_ahead
from pointglass.viewer.window.planning.opened_ahead import OpenedAhead
from pointglass.viewer.window.session import loading

AS_GIVEN = {"match": True, "columns": None}


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Two files, whose common grid is in the cache."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    made = [write_las(tmp_path / f"{k}.las", *surface(2000, k, (3.0 * k, 0.0, 0.0))) for k in range(2)]
    opening.open_scene(made)
    return made


def test_the_load_of_the_same_files_takes_what_was_opened_and_the_next_one_opens_them_itself(files, monkeypatch):
    ahead = OpenedAhead()
    for module in (loading, opened_ahead):
        monkeypatch.setattr(module, "AHEAD", ahead)
    ahead.begin([files[0].parent], **AS_GIVEN)
    assert loading.preview_scene(files) is None  # as it would be without
    assert not ahead.opens(files[:1], **AS_GIVEN) and not ahead.opens(files, match=False, columns=None)
    opened = []
    real = opening.open_scene
    monkeypatch.setattr(opening, "open_scene", lambda *given, **options: opened.append(given) or real(*given, **options))
    first, second = opened_ahead.open_scene(files), opened_ahead.open_scene(files)
    assert len(opened) == 1 and first is not second
    (ahead := OpenedAhead()).begin(files, **AS_GIVEN)
    assert ahead.take(files[:1], **AS_GIVEN) is None and ahead.take(files, **AS_GIVEN) is None  # another load came first
    assert first.meta == second.meta and np.array_equal(packed(first), packed(second))


def test_what_is_not_in_the_cache_is_not_opened(files, tmp_path):
    other = write_las(tmp_path / "other.las", *surface(2000, 7))
    for asked in ([other], [tmp_path / "nothing.las"]):
        (ahead := OpenedAhead()).begin(asked, **AS_GIVEN)
        assert ahead.take(asked, **AS_GIVEN) is None


def test_a_load_that_is_cancelled_waits_no_longer(files, monkeypatch):
    ahead = OpenedAhead()
    monkeypatch.setattr(ahead, "_open", lambda: (setattr(ahead, "_files", files), ahead._known.set()))  # and never ends
    ahead.begin(files, **AS_GIVEN)
    set_sink(lambda _label, _done, _total: False)
    try:
        with pytest.raises(Cancelled):
            ahead.take(files, **AS_GIVEN)
    finally:
        set_sink(None)
    assert ahead.take(files, **AS_GIVEN) is None
