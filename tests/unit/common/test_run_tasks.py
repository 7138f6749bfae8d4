"""run_tasks: results in order whatever happens to the workers; errors, logs and kills as a person meets them."""

import logging
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.workers.local_tasks import MOST_DEATHS
from pointglass.viewer.common.workers.run_tasks import Workers, run_tasks


def square(number: int) -> int:
    return number * number


def processes(number: int) -> int:
    from pointglass.model.common.process.processors import usable_processors

    return usable_processors()


def suicidal(folder: Path, times: int, number: int) -> int:
    """Is killed at its first ``times`` attempts at task 2."""
    before = folder / f"{number}-{len([*folder.glob(f'{number}-*')])}"
    before.touch()
    if number == 2 and len([*folder.glob("2-*")]) <= times:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def wrong(folder: Path, number: int) -> int:
    if number == 3:
        raise InputError("has no points", file="house.e57", remedy="scan it again")
    time.sleep(0.05)
    (folder / str(number)).touch()
    return number


class Shared:
    """Opens a file once in each process, and closes it at the end."""

    def __init__(self, folder: Path):
        self.folder = folder

    @contextmanager
    def opened(self):
        logging.getLogger("pointglass.test").warning("the same in each process")
        mark = self.folder / f"opened-{os.getpid()}"
        mark.touch()
        yield lambda number: (os.getpid(), number)
        mark.rename(self.folder / f"closed-{os.getpid()}")


@pytest.mark.parametrize("workers", [None, Workers(1), Workers(3)])
def test_results_come_in_the_order_of_the_tasks(workers):
    assert list(run_tasks(square, range(12), workers, label="squares")) == [n * n for n in range(12)]
    assert list(run_tasks(square, range(12), workers, label="squares", ahead=1)) == [n * n for n in range(12)]
    assert list(run_tasks(square, [], workers, label="squares")) == []


def test_processors_are_divided_among_the_workers():
    from pointglass.model.common.process.processors import usable_processors

    count = usable_processors() + 1
    assert set(run_tasks(processes, range(2 * count), Workers(count), label="counting")) == {1}


def test_what_tasks_share_is_opened_once_in_each_process_and_closed(tmp_path, caplog):
    found = list(run_tasks(Shared(tmp_path), range(8), Workers(2), label="sharing"))
    used = {pid for pid, _ in found}
    assert [number for _, number in found] == [*range(8)] and os.getpid() not in used
    names = sorted(path.name for path in tmp_path.iterdir())
    assert set(names) >= {f"closed-{pid}" for pid in used} and not [name for name in names if name.startswith("opened")]
    assert "the same in each process" in caplog.text


def test_a_killed_worker_costs_time_and_not_the_result(tmp_path, caplog):
    assert list(run_tasks(partial(suicidal, tmp_path, MOST_DEATHS - 1), range(5), Workers(2), label="dying")) == [*range(5)]
    assert caplog.text.count("2: its worker ended (killed by SIGKILL); it is done again") == MOST_DEATHS - 1


def test_a_task_that_kills_every_worker_is_named(tmp_path):
    with pytest.raises(InputError, match=rf"^frame 2: its worker ended {MOST_DEATHS} times \(killed by SIGKILL\)"):
        list(run_tasks(partial(suicidal, tmp_path, 99), range(5), Workers(2), label="dying", name=lambda n: f"frame {n}"))


def test_an_error_in_a_worker_is_the_error_of_the_command(tmp_path):
    with pytest.raises(InputError, match=r"house\.e57: has no points; scan it again") as caught:
        list(run_tasks(partial(wrong, tmp_path), range(400), Workers(2), label="erring"))
    assert caught.value.file == "house.e57" and caught.value.exit_code == 2
    assert len([*tmp_path.iterdir()]) < 300, "the other tasks are not waited for"


_PARENT = """
import sys, time
from pointglass.viewer.common.workers.run_tasks import Workers, run_tasks
from test_run_tasks import slow
list(run_tasks(slow, [sys.argv[1]] * 4, Workers(2), label="slow"))
"""


def slow(folder: str) -> None:
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(60)


def test_workers_end_where_their_command_is_killed(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", _PARENT, str(tmp_path)], cwd=Path(__file__).parent)
    until(lambda: len([*tmp_path.iterdir()]) == 2)
    process.kill()
    process.wait()
    pids = [int(path.name) for path in tmp_path.iterdir()]
    until(lambda: not any(is_running(pid) for pid in pids))


def until(true, seconds: float = 30) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
