"""What keys that came up within a frame fly, against the true moments of random presses: right on average, and bounded."""

import numpy as np
import pytest

from pointglass.viewer.window.flight.held_keys import TAP, HeldKeys


def flown(spans, action: str) -> float:
    return sum(seconds for held, seconds in spans if action in held)


def test_presses_of_random_length_are_flown_as_long_as_they_last_on_average(seed):
    rng, frame = np.random.default_rng(seed), 0.4
    asked = made = 0.0
    for _ in range(4000):
        begin, keys = rng.uniform(0, frame), HeldKeys()
        end = begin + rng.uniform(frame, 5 * frame)  # in a later frame
        asked += end - begin
        frames = np.arange(1, int(end / frame) + 2) * frame  # the events of a frame are taken at its end
        last = None
        for now in frames:
            if now == frames[0]:
                keys.add("forward")
            if now == frames[-1]:
                keys.discard("forward")
            made += flown(keys.spans(0.0 if last is None else frame, frame), "forward")
            last = now
        assert flown(keys.spans(frame, frame), "forward") == 0.0
    # the frame of the press is not flown, which is half a frame of each
    assert made == pytest.approx(asked - 4000 * frame / 2, rel=0.01)


def test_a_tap_within_a_frame_is_flown_once_and_no_longer_than_a_tap():
    for since in (0.01, 0.2, 5.0):
        keys = HeldKeys()
        keys.add("left")
        keys.discard("left")
        assert keys.asked == {"left"}
        assert flown(keys.spans(0.0, since), "left") == min(since / 3, TAP)
        assert not keys.asked and flown(keys.spans(0.1, 0.1), "left") == 0.0


def test_keys_that_are_forgotten_or_pressed_again_are_not_flown_for():
    keys = HeldKeys(("up", "back"))
    keys.spans(0.1, 0.1)
    keys.discard("back")
    keys.add("back")
    assert [(set(held), seconds) for held, seconds in keys.spans(0.1, 0.1)] == [({"up", "back"}, 0.1)]
    keys.discard("up")
    keys.clear()
    assert keys.asked == set() and [(set(held), s) for held, s in keys.spans(0.1, 0.1)] == [(set(), 0.1)]
