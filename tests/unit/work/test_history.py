"""Undo and redo against a plain list of all states."""

import numpy as np

from pointglass.viewer.work import history
from pointglass.viewer.work.history import History


def test_undo_and_redo_visit_the_states_in_order(seed):
    random = np.random.default_rng(seed)
    stack = History(0)
    states, labels, at = [0], [""], 0
    for step in range(1, 2000):
        action = random.random()
        if action < 0.5:
            stack.do(f"step {step}", step)
            states, labels = [*states[: at + 1], step], [*labels[: at + 1], f"step {step}"]
            at += 1
        elif action < 0.8:
            assert stack.undo() == (labels[at] if at else None)
            at = max(at - 1, 0)
        else:
            assert stack.redo() == (labels[at + 1] if at + 1 < len(states) else None)
            at = min(at + 1, len(states) - 1)
        assert stack.current == states[at]
        assert stack.undo_label == (labels[at] if at else None)
        assert stack.redo_label == (labels[at + 1] if at + 1 < len(states) else None)


def test_a_gesture_is_one_step():
    stack = History(0)
    for value in range(1, 6):
        stack.do("drag", value, gesture="drag 1")
    stack.do("drag", 6, gesture="drag 2")
    stack.end_gesture()
    stack.do("drag", 7, gesture="drag 2")
    assert [stack.undo() and stack.current for _ in range(3)] == [6, 5, 0]


def test_a_gesture_that_ends_where_it_began_leaves_no_step():
    """A name typed letter by letter, and taken back."""
    stack = History("wall")
    for name in ("wal", "wa", "wal", "wall"):
        stack.do("rename", name, gesture="rename 0")
    assert stack.current == "wall" and stack.undo_label is None
    stack.do("rename", "floor", gesture="rename 0")
    assert stack.undo() == "rename" and stack.current == "wall"


def test_nothing_changed_is_no_step():
    stack = History((1, 2))
    stack.do("same", (1, 2))
    assert stack.undo_label is None


def test_the_oldest_steps_are_dropped(monkeypatch):
    monkeypatch.setattr(history, "MOST_STEPS", 5)
    stack = History(0)
    for value in range(1, 20):
        stack.do("step", value)
    undone = 0
    while stack.undo() is not None:
        undone += 1
    assert (undone, stack.current) == (5, 14)


def test_where_the_camera_stands_is_no_step():
    stack = History((0, "here"))
    stack.do("step", (1, "here"))
    stack.replace((1, "there"))
    assert stack.current == (1, "there")
    stack.undo()
    assert stack.current == (0, "here")


def test_a_revision_reaches_every_state_and_is_no_step():
    stack = History((0,))
    for value in ((0, 1), (0, 1, 2), (0, 1, 2, 1)):
        stack.do("add", value)
    stack.undo()
    stack.revise(lambda state: tuple(10 if item == 1 else item for item in state))
    assert stack.current == (0, 10, 2)
    assert stack.redo() == "add" and stack.current == (0, 10, 2, 10)
    assert [stack.undo() and stack.current for _ in range(3)] == [(0, 10, 2), (0, 10), (0,)] and stack.undo() is None
