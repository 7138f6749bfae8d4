"""``pointglass publish`` of a project that shows a comparison: its colours are the second view, with legend and figures."""

import base64
import io
from dataclasses import replace

import chromium
import numpy as np
import pytest
from dated_scans import dates_in_colour
from PIL import Image
from test_publish import publish, value_of

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.dates.date_comparison import DateComparison
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.viewpoint import Viewpoint


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """(folder, project, its document, options)."""
    tmp_path = tmp_path_factory.mktemp("dates")
    files = dates_in_colour(tmp_path, 5)
    before, after = ((file.name, len(file.read_text().splitlines())) for file in files)
    view = Viewpoint.of(from_fov(64, 64, 60.0, look_at((1.6, 2.0, 4.0), (1.6, 2.1, 0.0))), "above")
    document = Document(scans=tuple(ScanFile(str(file)) for file in files), viewpoints=(view,),
                        comparison=DateComparison(before, after, "c2c", limit=1.0))
    write_project(tmp_path / "p.pointglass", document)
    options = "--at", "viewpoints", "--view", "filled", "--size", 512, "--out", tmp_path / "site"
    done = publish(tmp_path / "p.pointglass", *options)
    assert done.returncode == 0, done.stderr
    return tmp_path / "site", tmp_path / "p.pointglass", document, options


def test_a_comparison_is_the_second_view_with_its_legend(published):
    site, project, document, options = published
    data = value_of(site / "scene.js")
    assert data["second"] == "change" and data["view"] == "filled"
    assert data["change"]["text"].startswith("after.xyz compared with before.xyz\nmedian ")
    with Image.open(io.BytesIO(base64.b64decode(data["change"]["picture"]))) as figure:
        assert figure.size[0] > 600 and np.ptp(np.asarray(figure.convert("L"))) > 200
    down = base64.b64decode(value_of(site / "places" / "000.second.js")["pictures"][5])
    shown = np.asarray(Image.open(io.BytesIO(down)).convert("RGB"), int)
    gaps = shown[330:400, 130:430].max(axis=2) < 60
    assert gaps.mean() < 0.01, "discs close the floor"
    red, floor = shown[..., 0] - shown[..., 2] > 20, shown.min(axis=2) > 150
    assert 0.003 < red.mean() < 0.1 and floor.mean() > 0.02  # the box that came, and what stayed
    write_project(project.with_name("none.pointglass"), replace(document, comparison=None))
    none = publish(project.with_name("none.pointglass"), *options, "--second", "change")
    assert none.returncode == 2 and "there is no comparison; give a project in which Compare shows one" in none.stderr


@pytest.mark.skipif(chromium.PROGRAM is None, reason="chromium is not installed")
def test_the_page_shows_the_legend_beside_the_handle(published, tmp_path):
    page = chromium.Page(tmp_path / "profile")
    try:
        page.open((published[0] / "index.html").as_uri())
        page.until("document.body && document.body.classList.contains('ready')")
        legend = "document.getElementById('change')"
        assert page.value(f"{legend}.hidden")
        page.key("v")
        page.until(f"window.pointglass.view.second === 0.5 && !{legend}.hidden")
        page.until("document.getElementById('change-picture').naturalWidth > 600")
        assert page.value("document.getElementById('left').textContent") == "change"
        assert page.value("document.getElementById('compare').title").endswith("after.xyz compared with before.xyz (V)")
        box = "document.getElementById('%s').getBoundingClientRect()"
        assert page.value(f"{box % 'change'}.left > {box % 'plan'}.right"), "the plan is not covered"
        for width, height in ((360, 640), (640, 360)):  # on a phone nothing covers anything either
            page.resize(width, height)
            page.until(f"innerWidth === {width} && window.pointglass.panorama.canvas.clientWidth === {width}")
            boxes = np.array(page.value("['header', '#change', '#handle b:last-child', '#tools'].map((name) => {"
                                        "const box = document.querySelector(name).getBoundingClientRect();"
                                        "return [box.left, box.right, box.top, box.bottom]; })"))
            assert boxes[:, 0].min() >= 0 and boxes[:, 1].max() <= width and boxes[:, 3].max() <= height, boxes
            for number, (left, right, top, bottom) in enumerate(boxes):
                for a, b, c, d in boxes[:number]:
                    assert right <= a or b <= left or bottom <= c or d <= top, f"{number} covers another one: {boxes}"
        page.key("v")
        page.until(f"{legend}.hidden")
        assert not page.complaints
    finally:
        page.close()
