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
        imgui.begin(f"card {number}", None, imgui.WindowFlags_.no_move)
        imgui.end()
    imgui.render()


def test_what_the_last_frame_has_drawn_counts_and_nothing_else(imgui, seed):
    """Cards come, go and move; the pointer moves after each frame."""
    rng = np.random.default_rng(seed)
    assert not over_interface(imgui, (640.0, 400.0)), "before the first frame"
    over = 0
    for _ in range(400):
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


@pytest.mark.parametrize("first", [(50.0, 50.0), (250.0, 250.0)])
def test_a_button_that_imgui_still_holds_says_nothing_of_the_next_click(imgui, first):
    """The frame after a click takes its press only; the release waits, and the pointer is elsewhere already."""
    io, card = imgui.get_io(), (200, 200, 100, 100)
    for _ in range(3):
        draw(imgui, [card])
    io.add_mouse_pos_event(*first)
    draw(imgui, [card])
    io.add_mouse_button_event(0, True)
    io.add_mouse_button_event(0, False)
    draw(imgui, [card])
    assert imgui.is_mouse_down(0)
    for _ in range(2):
        assert over_interface(imgui, (250.0, 250.0)) and not over_interface(imgui, (50.0, 50.0))
        assert io.mouse_down[0] or io.mouse_released[0], "as imgui had it"
        draw(imgui, [card])
