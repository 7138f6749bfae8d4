"""The network of a window on CUDA: pictures at once, and its captured graph as soon as that is ready."""

import threading
from typing import ClassVar

import pytest

from pointglass.viewer.render.network.background_capture import BackgroundRunner


class Engine:
    """Stands for model.network.engines.Runner.  gate: what a capture waits for.  threads: where captures ran."""

    gate = threading.Event()
    threads: ClassVar[list[str]] = []
    fails = False

    def __init__(self, network, height, width, engine=None):
        self.device, self.name, self.released = "cpu", engine or "graph", False
        if engine is None:
            Engine.threads.append(threading.current_thread().name)
            assert Engine.gate.wait(20)
            if Engine.fails:
                raise RuntimeError("CUDA error: operation not permitted when stream is capturing")

    def __call__(self, packed):
        assert not self.released
        return self.name, packed

    def release(self):
        self.released = True


@pytest.fixture
def engine():
    Engine.gate, Engine.threads, Engine.fails = threading.Event(), [], False
    yield Engine
    Engine.gate.set()


def test_pictures_do_not_wait_for_the_capture_and_use_it_once_it_is_there(engine):
    runner = BackgroundRunner(None, 4, 4, make=engine)  # type: ignore[arg-type]
    assert [runner(number) for number in range(3)] == [("eager", number) for number in range(3)]  # type: ignore[arg-type]
    engine.gate.set()
    runner.settle()
    assert runner(7) == ("graph", 7) and runner.name == "graph"  # type: ignore[arg-type]
    assert engine.threads and threading.current_thread().name not in engine.threads
    runner.release()


def test_a_capture_that_fails_leaves_the_network_running_and_says_so(engine, caplog):
    engine.fails = True
    engine.gate.set()
    runner = BackgroundRunner(None, 4, 4, make=engine)  # type: ignore[arg-type]
    runner.settle()
    assert runner(1) == ("eager", 1)  # type: ignore[arg-type]
    assert "capturing its graph failed" in caplog.text
    runner.release()


def test_a_capture_that_ends_after_the_release_is_released(engine):
    made = []

    def make(*arguments, **named):
        made.append(engine(*arguments, **named))
        return made[-1]

    runner = BackgroundRunner(None, 4, 4, make=make)  # type: ignore[arg-type]
    runner.release()
    engine.gate.set()
    runner._thread.join(20)
    assert len(made) == 2 and all(one.released for one in made)
