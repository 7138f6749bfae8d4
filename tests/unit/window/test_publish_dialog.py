"""The dialog of Publish without a window: it plans, says what it will cost, and writes the folder of the command beside."""

import json
import time

import numpy as np
import pytest
from window_session import room, session

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.window.interaction.film.film_tool import Film
from pointglass.viewer.window.interaction.film.publish_plan import planned
from pointglass.viewer.window.interaction.tool import ToolContext
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.viewpoint import Viewpoint

pytestmark = pytest.mark.gl


def follow(film, context, condition):
    end = time.monotonic() + 120
    while not condition():
        assert time.monotonic() < end, film.publishing.problem
        film.follow(context)
        time.sleep(0.01)


@pytest.mark.slow
def test_what_the_dialog_plans_is_published_and_listed(tmp_path):
    made, _ = session()
    context, film = ToolContext(made, None, None), Film()  # type: ignore[arg-type]
    dialog = film.publishing
    film.add_bookmark(context)
    film.follow(context)
    assert dialog.plan is None and film.workers == (None, None)  # nothing is planned before it is asked for
    dialog.view, dialog.second, dialog.wanted = "filled", False, "viewpoints"
    dialog.ask(context)
    follow(film, context, lambda: dialog.plan is not None)
    first = dialog.plan
    assert first is not None and first.seconds > 0 and np.ptp(first.picture) > 100
    assert [place.name for place in first.places] == [view.name for view in context.document.viewpoints]
    dialog.wanted = "stations"  # another choice: planned anew, and refused in words
    follow(film, context, lambda: dialog.problem != "")
    assert "no scanner positions" in dialog.problem and dialog.plan is None
    dialog.wanted = "viewpoints"
    follow(film, context, lambda: dialog.plan is not None)

    (tmp_path / "mine.txt").touch()
    dialog.start(context, tmp_path)
    assert dialog.worker is None and made.notices.message is not None and "mine.txt" in str(made.notices.message.text)

    out = tmp_path / "site"
    dialog.start(context, out)
    assert film.workers[1] is not None and film.unfinished == "A publication is being written."
    follow(film, context, lambda: dialog.worker is None)
    assert made.notices.saved[-1] == out / "index.html" and (out / "index.html").is_file()
    text = (out / "scene.js").read_text("ascii")
    scene = json.loads(f"[{text[text.index('(') + 1:text.rindex(')')]}]")[1]
    assert len(scene["places"]) == 1 and scene["second"] is None and len(list((out / "places").iterdir())) == 3
    film.close()


@pytest.mark.slow
def test_a_publication_that_is_given_up_leaves_whole_places(tmp_path):
    made, _ = session()
    context, film = ToolContext(made, None, None), Film()  # type: ignore[arg-type]
    film.publishing.view, film.publishing.wanted = "filled", 12
    film.publishing.ask(context)
    follow(film, context, lambda: film.publishing.plan is not None)
    film.publishing.start(context, tmp_path / "site")
    film.close()
    assert not (tmp_path / "site" / "index.html").exists()
    left = [file.name for file in tmp_path.rglob("*") if file.is_file()]
    assert len(left) % 4 == 0 and all(name.endswith(".js") for name in left)


def test_a_plan_names_what_is_missing():
    view = Viewpoint("far", ((1.0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0, 1.0, 0), (0, 0, 0, 1.0)), 60.0)
    with pytest.raises(InputError, match="scanner positions"):
        planned(room(points=3000), Document(viewpoints=(view,)), None, "stations", 512)  # type: ignore[arg-type]
