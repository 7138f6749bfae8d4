"""``Scan.show`` in a notebook: a kernel answers the page's messages with pictures; JupyterLab in Chromium shows them, and so
does any page that keeps to anywidget's protocol."""

import base64
import importlib.util
import io
import json
import subprocess
import sys
import time
from pathlib import Path
from urllib.request import urlopen

import chromium
import numpy as np
import pytest
from PIL import Image

import pointglass
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.interface.notebook.guided_view import LARGEST, GuidedView

ROOT = Path(__file__).resolve().parents[2]


def missing(*modules):
    return [name for name in modules if importlib.util.find_spec(name) is None]


def room():
    """A scan of a box with a wall of another colour on each side, and where to stand in it."""
    rng = np.random.default_rng(3)
    xyz, rgb = [], []
    for axis in range(3):
        for side in range(2):
            face = rng.random((15_000, 3)) * [6, 5, 3]
            face[:, axis] = side * [6, 5, 3][axis]
            xyz.append(face)
            rgb.append(np.tile(np.array([60 + 60 * axis, 80 + 120 * side, 220 - 60 * axis], np.uint8), (len(face), 1)))
    return np.concatenate(xyz), np.concatenate(rgb)


@pytest.fixture(scope="module")
def scan(context):
    with pointglass.from_points(*room()) as made:
        yield made
    context.__enter__()  # for the fixtures of the next module


def look(scan, **more):
    return pointglass.look_at((3, 2.5, 1.5), (6, 2.5, 1.5), size=(64, 48), **more)


def test_the_picture_at_rest_is_render_s_and_the_one_in_motion_smaller(scan):
    guided = GuidedView(scan._scene, scan.render, view="filled", start=look(scan), up=(0, 0, 1))
    guided.follow({"size": [320, 240]})
    data, size = guided.picture(moving=False)
    assert size == (320, 240)
    shown = np.asarray(Image.open(io.BytesIO(data))).astype(int)
    assert np.abs(shown - np.asarray(scan.render(guided.camera(), view="filled"))[..., :3]).mean() < 1.5
    assert np.allclose(guided.camera().position, (3, 2.5, 1.5)) and np.allclose(guided.camera().forward, (1, 0, 0))
    assert guided.picture(moving=True)[1] == (160, 120)


def test_drag_wheel_and_keys_move_the_camera_and_home_brings_it_back(scan):
    guided = GuidedView(scan._scene, scan.render, view="filled", start=look(scan), up=(0, 0, 1))
    guided.follow({"look": [100, 0]})  # the scene follows the mouse to the right: the camera turns left
    assert guided.camera().forward[1] > 0.1 and np.allclose(guided.camera().position, (3, 2.5, 1.5))
    guided.follow({"home": True})
    held = {"seconds": 0.2}
    for event, way in (({"wheel": 1}, (1, 0, 0)), ({"keys": "s"} | held, (-1, 0, 0)), ({"keys": "a"} | held, (0, 1, 0)),
                       ({"keys": "e"} | held, (0, 0, 1)), ({"pan": [30, 0]}, (0, 1, 0)), ({"pan": [0, 30]}, (0, 0, 1))):
        guided.follow({"home": True} | event)
        moved = guided.camera().position - (3, 2.5, 1.5)
        assert np.allclose(moved / np.linalg.norm(moved), way), event
    far = [(guided.follow({"home": True, "keys": "w", "seconds": 0.1, **held}), guided.camera().position[0] - 3)[1]
           for held in ({}, {"fast": True}, {"slow": True})]
    assert np.allclose(far, far[0] * np.array([1, 4, 0.25]))
    guided.follow({"home": True, "keys": "w", "seconds": 1e6})
    assert guided.camera().position[0] - 3 < 6 * far[0]  # a pause of the kernel is no leap


@pytest.mark.parametrize("event", [
    {"size": [10**7, -5]}, {"size": "big"}, {"look": [float("nan"), 1]}, {"look": [[1], 2]}, {"wheel": 1e300},
    {"keys": 7, "seconds": "x"}, {"pan": None}, {"faster": [1, 2, 3]}, {"home": "yes"},
])
def test_nonsense_of_a_page_moves_nothing_and_asks_for_no_huge_picture(scan, event):
    guided = GuidedView(scan._scene, scan.render, view="filled", start=look(scan), up=(0, 0, 1))
    before = guided.camera().camera_to_world.copy()
    guided.follow(event)
    assert np.array_equal(guided.camera().camera_to_world, before) and max(guided.size) <= LARGEST and min(guided.size) >= 16


def test_wrong_arguments_are_named(scan, monkeypatch):
    for arguments, said in (({"camera": 5}, "pointglass.Camera"), ({"view": "nice"}, "view"), ({"height": 3}, "height"),
                            ({"up": (0, 0, 0)}, "up")):
        with pytest.raises(InputError, match=said):
            scan.show(**arguments)
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "pointglass.viewer.interface.notebook.scan_widget", raising=False)
    with pytest.raises(InputError, match=r"pip install 'pointglass\[notebook\]'"):
        scan.show()


@pytest.mark.skipif(bool(missing("anywidget", "ipykernel")), reason="anywidget or ipykernel is not installed")
def test_a_kernel_answers_messages_with_pictures():
    from jupyter_client.manager import start_new_kernel

    manager, client = start_new_kernel(kernel_name="python3", cwd=str(ROOT))
    try:
        def until(wanted):
            while not wanted(message := client.get_iopub_msg(timeout=120)):
                assert message["msg_type"] != "error", message["content"]["traceback"]
            return message

        client.execute("import pointglass\nscan = pointglass.open(pointglass.demo_scan())\nscan.show(view='filled')")
        opened = until(lambda m: m["msg_type"] == "comm_open" and "_esm" in m["content"]["data"]["state"])
        comm, pictures = opened["content"]["comm_id"], []
        for event in ({"number": 1, "moving": False}, {"number": 2, "moving": True, "look": [200, 0]},
                      {"number": 3, "moving": False}):
            event |= {"size": [320, 240]}
            content = {"comm_id": comm, "data": {"method": "custom", "content": event}}
            client.shell_channel.send(client.session.msg("comm_msg", content))
            found = until(lambda m: m["msg_type"] == "comm_msg" and m["content"]["data"].get("method") == "custom")
            told = found["content"]["data"]["content"]
            assert told["number"] == event["number"] and told["moving"] == event["moving"]
            pictures.append(np.asarray(Image.open(io.BytesIO(found["buffers"][0])).convert("RGB")))
            assert list(pictures[-1].shape[1::-1]) == told["size"] == ([160, 120] if event["moving"] else [320, 240])
        assert np.ptp(pictures[0]) > 50 and np.abs(pictures[0].astype(int) - pictures[2]).mean() > 5
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


HOST = """(async (source, height) => {
  const address = URL.createObjectURL(new Blob([source], { type: 'text/javascript' }));
  const heard = [], traits = { height, title: 'Room' };
  const { default: widget } = await import(address);
  window.sent = [];
  window.listeners = () => heard.length;
  window.receive = (content, data) => {
    const bytes = Uint8Array.from('..' + atob(data), (letter) => letter.charCodeAt(0));
    for (const [name, hear] of heard) if (name === 'msg:custom') hear(content, [new DataView(bytes.buffer, 2)]);
  };
  const model = {
    get: (name) => traits[name], set: () => undefined, save_changes: () => undefined,
    send: (content) => void window.sent.push(content), on: (...one) => void heard.push(one),
    off: (...one) => void heard.splice(heard.findIndex((each) => each.every((part, k) => part === one[k])), 1),
  };
  window.leave = await widget.render({ model, el: document.body.appendChild(document.createElement('div')) });
})(%s, 240)"""
"""What anywidget's protocol gives to a widget: a model of traits and messages, and an element."""


@pytest.mark.skipif(bool(missing("anywidget")) or chromium.PROGRAM is None, reason="anywidget or Chromium is not installed")
def test_any_page_that_keeps_to_anywidget_s_protocol_shows_the_scan_and_lets_one_move(tmp_path, scan):
    shown, told = scan.show(camera=look(scan), view="filled", height=240), []
    shown.send = lambda content, buffers=(): told.append((content, buffers))
    page = chromium.Page(tmp_path / "profile", 400, 300)

    def until(expression):
        end = time.monotonic() + 60
        while time.monotonic() < end:
            for event in page.value("window.sent.splice(0)"):
                shown._handle_custom_msg(event, [])
            while told:
                content, buffers = told.pop(0)
                data = base64.b64encode(buffers[0]).decode()
                page.value(f"window.receive({json.dumps(content)}, '{data}')")
            if page.value(expression):
                return
            time.sleep(0.01)
        raise AssertionError(expression)

    try:
        page.open("about:blank")
        page.value(HOST % json.dumps(shown._esm if isinstance(shown._esm, str) else Path(str(shown._esm)).read_text("utf-8")))
        image = "document.querySelector('img')"
        still = f"{image}.dataset.moving === 'false' && {image}.naturalHeight === 240"
        until(still)
        before, number = shown.camera, int(page.value(f"{image}.dataset.number"))
        for act, moved in ((lambda: page.drag(100, 120, 220, 120), "forward"), (lambda: page.wheel(100, 120, -200), "position"),
                           (lambda: page.key("w"), "position")):
            act()
            until(f"Number({image}.dataset.number) > {number} && {still}")
            assert np.abs(getattr(shown.camera, moved) - getattr(before, moved)).max() > 1e-3
            before, number = shown.camera, int(page.value(f"{image}.dataset.number"))
        page.value("(window.leave(), 0)")
        assert page.value("window.listeners()") == 0 and page.complaints == []
    finally:
        page.close()


WIDGET = "document.querySelector('.jp-OutputArea img[data-number]')"


@pytest.mark.skipif(bool(missing("anywidget", "ipykernel", "jupyterlab")) or chromium.PROGRAM is None,
                    reason="JupyterLab, anywidget or Chromium is not installed")
def test_jupyterlab_shows_the_scan_and_a_drag_turns_it(tmp_path):
    source = (f"import sys; sys.path.insert(0, {str(ROOT)!r})\nimport pointglass\n"
              "scan = pointglass.open(pointglass.demo_scan())\nshown = scan.show(view='filled', height=300)\nshown")
    cell = {"cell_type": "code", "source": source, "metadata": {}, "outputs": [], "execution_count": None, "id": "a"}
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    (tmp_path / "a.ipynb").write_text(json.dumps({"cells": [cell], "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}))
    log = (tmp_path / "log").open("wb")
    command = [sys.executable, "-m", "jupyter", "lab", "--no-browser", "--allow-root", "--ip=127.0.0.1", "--port=0",
               "--IdentityProvider.token=t", "--LabApp.expose_app_in_browser=True", f"--ServerApp.root_dir={tmp_path}"]
    lab = subprocess.Popen(command, stdout=log, stderr=log, cwd=tmp_path)
    page = None
    try:
        address = lab_address(tmp_path / "log", lab)
        page = chromium.Page(tmp_path / "profile")
        page.open(f"{address}/lab/tree/a.ipynb?token=t")
        page.until("window.jupyterapp && document.querySelector('.jp-Notebook .jp-Cell') !== null", 120)
        page.until("document.querySelector('.jp-Notebook-ExecutionIndicator[data-status=idle]') !== null", 120)
        run_cell(page)
        page.until(f"{WIDGET} && {WIDGET}.dataset.moving === 'false' && {WIDGET}.complete", 120)
        first = page.value(f"{WIDGET}.src")
        box = f"(() => {{ const box = {WIDGET}.getBoundingClientRect(); return [box.x, box.y, box.width, box.height]; }})()"
        x, y, width, height = page.value(box)
        assert height == 300 and width > 300 and page.value(f"{WIDGET}.naturalHeight") == 300
        page.drag(x + width / 2, y + height / 2, x + width / 2 + 150, y + height / 2)
        page.until(f"{WIDGET}.dataset.moving === 'true'", 60)
        page.until(f"{WIDGET}.dataset.moving === 'false'", 60)
        assert page.value(f"{WIDGET}.src") != first
        number = int(page.value(f"{WIDGET}.dataset.number"))
        for act in (lambda: page.wheel(x + width / 2, y + height / 2, -100), lambda: page.key("w")):
            act()
            page.until(f"Number({WIDGET}.dataset.number) > {number} && {WIDGET}.dataset.moving === 'false'", 60)
            number = int(page.value(f"{WIDGET}.dataset.number"))
        assert page.value("document.querySelectorAll('.jp-Notebook .jp-Cell').length") == 1  # no key reached the notebook
    finally:
        if page is not None:
            page.close()
        lab.terminate()
        lab.wait()
        log.close()


def run_cell(page):
    """Clicks into the cell, since commands are those of what has the focus, and runs it; again where the page was not ready."""
    for _ in range(8):
        x, y = page.value("(({ x, y }) => [x, y])(document.querySelector('.jp-Cell .cm-content').getBoundingClientRect())")
        page.click(x + 20, y + 10)
        time.sleep(1)
        page.value("void window.jupyterapp.commands.execute('notebook:run-all-cells')")
        time.sleep(3)
        if "[ ]" not in page.value("document.querySelector('.jp-InputPrompt').innerText"):
            return
    raise AssertionError("the cell does not run")


def lab_address(log, process):
    end = time.monotonic() + 120
    while time.monotonic() < end and process.poll() is None:
        for word in log.read_text("utf-8", "replace").split():
            if word.startswith("http://127.0.0.1:") and "/lab" in word:
                return word.split("/lab")[0]
        time.sleep(0.2)
    raise AssertionError(log.read_text("utf-8", "replace")[-2000:])


def test_a_published_folder_is_served_to_this_computer_in_a_frame(tmp_path):
    pytest.importorskip("IPython")
    with pytest.raises(InputError, match=r"no index.html in it; make it with pointglass publish"):
        pointglass.show_published(tmp_path)
    (tmp_path / "index.html").write_text("<p>here</p>")
    (tmp_path / "more").mkdir()
    frame = pointglass.show_published(tmp_path, height=222)
    assert frame.src.startswith("http://127.0.0.1:") and 'height="222"' in frame._repr_html_()
    assert urlopen(frame.src, timeout=20).read() == b"<p>here</p>"
    assert pointglass.show_published(tmp_path).src == frame.src
    for other in ("more/", "%2e%2e/%2e%2e/etc/passwd"):
        with pytest.raises(OSError, match="404"):
            urlopen(frame.src.replace("index.html", other), timeout=20)
