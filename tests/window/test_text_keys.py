"""Keys in the texts of a real window, as fast as a person presses them: Ctrl and a letter within one frame, and Tab."""


import pytest
from real_window import until, x_display
from test_notes_window import notes_of, texts, written
from test_work_is_kept import all_points, opened, scan  # noqa: F401  (a fixture)
from x_keyboard import type_letters

pytestmark = [pytest.mark.window, pytest.mark.timeout(300)]


def test_chords_within_one_frame_select_copy_and_paste_and_tab_leads_to_the_next_text(scan):  # noqa: F811
    with x_display() as display:
        window = opened(display, scan)
        all_points(scan, window)
        window.keys("l")
        written(window, scan, "abc")
        window.xdo("key", "ctrl+a", "ctrl+c", "End", "ctrl+v", "ctrl+v")
        window.xdo("type", "--delay", "12", "xyz")
        until(lambda: texts(scan) == ["abcabcabcxyz"], f"the text; there is {texts(scan)}")
        type_letters(display, "Жя水א")
        until(lambda: texts(scan) == ["abcabcabcxyzЖя水א"], f"letters of other scripts; there is {texts(scan)}")
        window.xdo("key", "ctrl+a", "ctrl+c", "End", "ctrl+v")
        until(lambda: texts(scan) == ["abcabcabcxyzЖя水א" * 2], f"them pasted; there is {texts(scan)}")
        window.xdo("key", "Tab")
        window.rest()
        window.xdo("type", "--delay", "12", "https://a.b")
        window.xdo("key", "Return")
        until(lambda: [note.link for note in notes_of(scan)] == ["https://a.b"], f"the link; there is {notes_of(scan)}")
        window.keys("ctrl+s", "ctrl+q")
        assert window.ended() == 0
