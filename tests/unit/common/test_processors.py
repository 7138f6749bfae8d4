"""Loops distributed over the processors: each calling thread has threads of its own."""

import threading

import pytest

from pointglass.model.common.process import processors


@pytest.fixture(autouse=True)
def two_threads(monkeypatch):
    monkeypatch.setattr(processors, "_threads", [2])


@pytest.mark.parametrize("loop", [lambda rows: processors.in_rows(2, 1, lambda begin, end: rows(begin)),
                                  lambda rows: processors.everywhere(lambda: rows(0)),
                                  lambda rows: processors.each(rows, [0, 1])])  # fmt: skip
def test_a_loop_does_not_wait_behind_those_of_another_thread(loop):
    """A picture of the window beside a long job: in a common pool it waited until the job's rows were done."""
    begun, go_on = threading.Semaphore(0), threading.Event()

    def long(row):
        begun.release()
        assert go_on.wait(60)

    job = threading.Thread(target=loop, args=(long,))
    job.start()
    try:
        for _ in range(2):  # both threads of the job's pool are taken
            assert begun.acquire(timeout=60)
        rows = []
        picture = threading.Thread(target=loop, args=(rows.append,))
        picture.start()
        picture.join(30)
        assert len(rows) == 2 and job.is_alive()
    finally:
        go_on.set()
        job.join(60)


def test_the_threads_of_a_loop_end_with_the_thread_that_called_it():
    helpers = []

    def call():
        processors.in_rows(2, 1, lambda begin, end: helpers.append(threading.current_thread()))

    caller = threading.Thread(target=call)
    caller.start()
    caller.join(60)
    for helper in helpers:
        helper.join(60)
    assert len(helpers) == 2 and not any(helper.is_alive() for helper in helpers)
