"""What lies under the pointer between two frames of a real imgui context (viewer.window.kit.under_pointer)."""

import numpy as np
import pytest

from pointglass.viewer.window.kit.under_pointer import over_interface


@pytest.fixture
def imgui():
    found = pytest.importorskip("imgui_bundle").imgui
    context = found.create_context()
    io = found.get_io()
    io.display_size, io.delta_time = found.ImVec2(1280, 800), 0.02
    io.backend_flags |= found.BackendFlags_.renderer_has_textures
    io.set_ini_filename("")
    yield found
    found.destroy_context(context)


def draw(imgui, cards) -> None:
    """A frame with these rectangles of the interface: left, top, width, height."""
    imgui.new_frame()
    for number, (left, top, width, height) in enumerate(cards):
        imgui.set_next_window_pos((left, top))
        imgui.set_next_window_size((width, height))
        imgui.begin(f"card {number}")
        imgui.end()
    imgui.render()


def test_what_the_last_frame_has_drawn_counts_and_nothing_else(imgui, seed):
    """Cards come, go and move; the pointer moves after each frame."""
    rng = np.random.default_rng(seed)
    assert not over_interface(imgui, (640.0, 400.0)), "before the first frame"
    over = 0
    for _ in range(100):
        cards = [(*rng.integers(0, (900, 500)), *rng.integers(100, 300, 2)) for _ in range(rng.integers(0, 4))]
        draw(imgui, [tuple(map(int, card)) for card in cards])
        for _ in range(rng.integers(1, 4)):
            x, y = rng.uniform(0, (1280, 800))
            # Off the edges, where imgui takes hold a few pixels outside to resize a window.
            inside = [min(x - left, left + width - x, y - top, top + height - y) for left, top, width, height in cards]
            if any(abs(gap) < 8 for gap in inside):
                continue
            expected = any(gap > 0 for gap in inside)
            assert over_interface(imgui, (x, y)) == expected
            over += expected
    assert over > 5
