"""Keys in the texts of a real window, as fast as a person presses them: Ctrl and a letter within one frame, and Tab."""

import signal

import pytest
from real_window import until, x_display
from test_notes_window import notes_of, texts, written
from test_work_is_kept import all_points, opened, scan  # noqa: F401  (a fixture)
from x_keyboard import type_letters

LINK = 1150, 248
"""The field of a note's link, at a window of 1280 x 720."""
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


def within_one_frame(window, *events: tuple[object, ...]) -> None:
    """Gives X events to a window that stands still, as one does for a person while it makes a long frame."""
    window.process.send_signal(signal.SIGSTOP)
    for event in events:
        window.xdo(*event)
    window.process.send_signal(signal.SIGCONT)


def test_a_click_within_the_frame_of_the_keys_before_it_takes_none_of_them_from_their_text(scan):  # noqa: F811
    with x_display() as display:
        window = opened(display, scan)
        all_points(scan, window)
        window.keys("l")
        written(window, scan, "abc")
        window.rest()
        within_one_frame(window, ("key", "ctrl+a"), ("type", "--delay", "5", "2 drawings"), ("mousemove", *LINK),
                         ("click", "1"), ("key", "ctrl+a"), ("type", "--delay", "5", "https://a.b"))
        until(lambda: [(note.text, note.link) for note in notes_of(scan)] == [("2 drawings", "https://a.b")], "both texts")
        window.rest()
        within_one_frame(window, ("type", "--delay", "5", "/c2"), ("mousemove", "700", "470"), ("click", "1"))
        until(lambda: len(notes_of(scan)) == 2, "a second note")
        assert [note.link for note in notes_of(scan)] == ["https://a.b/c2", ""]
        window.keys("ctrl+s", "ctrl+q")
        assert window.ended() == 0
