"""Progress of long work wakes the window's loop, a few times a second, and tells how long the rest takes."""

import threading
import time

from pointglass.viewer.common.progress import progress
from pointglass.viewer.common.text import left_text
from pointglass.viewer.window.kit import worker as module
from pointglass.viewer.window.kit.worker import Worker


def test_progress_wakes_the_loop_but_not_for_every_unit(monkeypatch):
    now, woken, at = [100.0], [], threading.Event()
    monkeypatch.setattr(module, "monotonic", lambda: now[0])

    def work():
        with progress(100, "Rendering") as meter:
            for _ in range(50):
                now[0] += 0.02
                meter.update(1)
        at.wait(60.0)

    made = Worker(work, "A film", lambda: woken.append(now[0]))
    end = time.monotonic() + 60
    while made.done < 50 and time.monotonic() < end:
        time.sleep(0.01)
    assert 3 <= len(woken) <= 5 and made.seconds_left is not None
    assert abs(made.seconds_left - 1.0) < 0.05
    at.set()
    assert made.join(60.0)


def test_the_time_left_is_not_known_before_anything_is_done():
    gate = threading.Event()
    made = Worker(lambda: gate.wait(60.0), "Nothing yet")
    assert made.seconds_left is None
    gate.set()
    assert made.join(60.0)


def test_times_left_are_rounded_as_estimates_are():
    shown = ["1 s", "8 s", "2 min", "60 min", "1 h 40 min"]
    assert [left_text(seconds) for seconds in (0.2, 8.4, 100.0, 3600.0, 6000.0)] == shown
