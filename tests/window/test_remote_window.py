"""A scan at an address in a real window: shown before all of it is there, and opened again without the server."""

import json
import sys
import threading

import numpy as np
import pytest
from real_window import RealWindow, until, x_display
from x_server import ROOT

sys.path += [str(ROOT / "tests" / "unit"), str(ROOT / "tests" / "unit" / "readers")]  # makers of files, and the web server

from cloud_files import write_las
from copc_files import write_copc
from format_files import some, write_potree1
from range_server import served

pytestmark = [pytest.mark.window, pytest.mark.timeout(300)]


class Held(dict):
    """Files of which one is held back until ``gate`` is open."""

    def __init__(self, files: dict[str, bytes], held: str):
        super().__init__(files)
        self.held, self.gate = held, threading.Event()

    def __getitem__(self, name: str) -> bytes:
        assert name != self.held or self.gate.wait(200)
        return super().__getitem__(name)


def test_an_octree_at_an_address_is_shown_while_its_last_file_is_awaited_and_later_without_the_server(tmp_path):
    folder = write_potree1(tmp_path / "made" / "house", some(260_000))  # the first picture: three levels
    files = {f"{file.relative_to(folder.parent)}": file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    with x_display() as display:
        with served(files) as server:
            server.files = held = Held(files, max((name for name in files if name.endswith(".bin")), key=len))
            address = f"{server.address}/house"
            window = RealWindow(display, tmp_path, "view", address, "--view", "filled")
            try:
                window.wait_for_title("house")
                state = json.loads(next((tmp_path / "cache" / "remote").glob("*/folder.json")).read_text())
                assert not state["complete"] and not [*(tmp_path / "cache").glob("[!.]*/meta.json")], "a preview"
            finally:
                held.gate.set()
            until(lambda: [*(tmp_path / "cache").glob("[!.]*/meta.json")], "all of it")
            window.rest()
            window.keys("ctrl+q")
            assert window.ended() == 0
        window = RealWindow(display, tmp_path, "view", address, "--view", "filled")
        window.wait_for_title("house")
        window.rest()
        window.picture("offline")
        window.keys("ctrl+q")
        assert window.ended() == 0
    assert "the copy read earlier is used" in (tmp_path / "window.log").read_text()


def test_of_large_octrees_at_addresses_beside_a_file_only_what_is_in_view_is_fetched(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_REMOTE_WHOLE_MB", "0.1")
    random = np.random.default_rng(2)
    xyz = random.uniform(0, 1, (240_000, 3)) * (400, 400, 2)
    xyz[60_000:, :2] = 200 + xyz[60_000:, :2] / 100  # a place of some pixels that has most of the points
    rgb = random.integers(0, 65536, xyz.shape).astype(np.uint16)
    data = write_copc(tmp_path / "made.copc.laz", np.round(xyz, 3), rgb).read_bytes()
    other = write_copc(tmp_path / "other.copc.laz", np.round(xyz[40_000:] + (400, 0, 0), 3), rgb[40_000:]).read_bytes()
    here = write_las(tmp_path / "here.las", xyz[:9_000] + (0, 400, 0), rgb[:9_000])
    with x_display() as display, served({"field.copc.laz": data, "other.copc.laz": other}) as server:
        window = RealWindow(display, tmp_path, "view", f"{server.address}/field.copc.laz", f"{server.address}/other.copc.laz",
                            here, "--view", "raw")
        window.wait_for_title("field")
        until(lambda: [*(tmp_path / "cache").glob("[!.]*/meta.json")], "the grid of the file of this machine")
        window.rest()
        assert {path.split(".")[0] for path, first, _ in server.requests if first > 70_000} == {"field", "other"}
        states = [json.loads(file.read_text()) for file in (tmp_path / "cache" / "remote").glob("*/state.json")]
        assert len(states) == 2 and not any(state["complete"] for state in states)
        assert len([*(tmp_path / "cache").glob("[!.]*/meta.json")]) == 1, "all of them was not asked for"
        assert 0.02 * len(data) < server.sent < 0.7 * len(data + other)
        window.keys("ctrl+q")
        assert window.ended() == 0
