"""The network's own thread: the latest picture wins, older results are dropped, errors come back where they are taken."""

import threading

import numpy as np
import pytest

from pointglass.viewer.render.network.network_thread import NetworkThread


class Steps:
    """Runs that wait until they are let go."""

    def __init__(self):
        self.thread, self.woken, self.ran = NetworkThread(), threading.Event(), []

    def start(self, serial, gate=None):
        begun = threading.Event()

        def work():
            self.ran.append(serial)
            begun.set()
            if gate is not None:
                assert gate.wait(5)
            return np.full(3, serial)

        self.thread.start(serial, work, self.woken.set)
        return begun

    def wait(self):
        assert self.woken.wait(5)
        self.woken.clear()


@pytest.fixture
def steps():
    made = Steps()
    yield made
    made.thread.close()


def test_of_several_pictures_the_running_one_and_the_latest_are_run_and_only_the_latest_is_given(steps):
    gate = threading.Event()
    assert steps.start(1, gate).wait(5)
    assert steps.thread.take(1) is None and steps.thread.busy
    steps.start(2)
    steps.start(3)
    gate.set()
    steps.wait()
    while steps.thread.busy:
        steps.wait()
    done = steps.thread.take(3)
    assert steps.ran == [1, 3] and done is not None and (done.made == 3).all() and done.milliseconds >= 0
    assert steps.thread.take(3) is None, "given once"


def test_a_result_that_nobody_waits_for_any_more_is_dropped(steps):
    steps.start(1)
    steps.wait()
    assert steps.thread.take(2) is None and steps.thread.take(1) is None
    gate = threading.Event()
    assert steps.start(4, gate).wait(5)
    steps.start(5)
    steps.thread.drop()
    gate.set()
    steps.wait()
    assert steps.ran == [1, 4] and steps.thread.take(5) is None


def test_a_run_ends_at_the_next_layer_once_its_picture_is_not_needed(steps):
    """By another picture, or because nothing is to be shown; a run that is needed goes on to its end."""
    from pointglass.model.network.interruption import check

    for end in (steps.thread.drop, lambda: steps.start(9)):
        begun, gate, layers = threading.Event(), threading.Event(), []

        def work(begun=begun, gate=gate, layers=layers):
            for layer in range(3):
                check()
                layers.append(layer)
                begun.set()
                assert gate.wait(5)
            return np.zeros(3)

        steps.thread.start(1, work, steps.woken.set)
        assert begun.wait(5)
        end()
        gate.set()
        steps.wait()
        while steps.thread.busy:
            steps.wait()
        assert layers == [0] and steps.thread.take(1) is None
    steps.thread.drop()
    steps.thread.start(2, lambda: check() or np.ones(3), steps.woken.set)
    while steps.thread.busy:
        steps.wait()
    done = steps.thread.take(2)
    assert done is not None and done.error is None


def test_only_the_thread_that_asked_is_interrupted():
    """Another thread may run the same network meanwhile."""
    from pointglass.model.network.interruption import Interrupted, check, interruptible

    with interruptible(lambda: True):
        other = threading.Thread(target=check)
        failed = []
        threading.excepthook, before = lambda found: failed.append(found), threading.excepthook
        other.start()
        other.join()
        threading.excepthook = before
        with pytest.raises(Interrupted):
            check()
    check()
    assert not failed


def test_an_error_is_given_to_whoever_takes_the_result_and_the_thread_lives_on(steps):
    def fails():
        raise RuntimeError("out of memory")

    steps.thread.start(1, fails, steps.woken.set)
    steps.wait()
    done = steps.thread.take(1)
    assert done is not None and done.made is None and "out of memory" in str(done.error)
    steps.start(2)
    steps.wait()
    assert steps.thread.take(2) is not None


def test_the_same_network_can_be_run_on_another_thread_meanwhile_only_after_the_run(steps):
    gate = threading.Event()
    assert steps.start(1, gate).wait(5)
    assert not steps.thread.lock.acquire(timeout=0.05)
    gate.set()
    assert steps.thread.lock.acquire(timeout=5)
    steps.thread.lock.release()
