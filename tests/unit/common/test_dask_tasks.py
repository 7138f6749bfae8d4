"""run_tasks with a Dask scheduler: what holds for processes of this machine holds for its workers."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
from test_run_tasks import Shared, is_running, suicidal, until, wrong
from untyped import any_typed

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.workers.local_tasks import MOST_DEATHS
from pointglass.viewer.common.workers.run_tasks import Workers, run_tasks

pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster():
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=any_typed(None), silence_logs=50) as started:
        yield started


@pytest.fixture(scope="module")
def there(cluster):
    """The scheduler.  Its workers find this folder's modules, as those of a person's machines find pointglass."""
    from distributed import Client

    with Client(cluster) as client:
        client.run(sys.path.insert, 0, str(Path(__file__).parent))
    return Workers(scheduler=cluster.scheduler_address)


def test_results_come_in_the_order_of_the_tasks_and_processes_are_kept(there, tmp_path, caplog):
    found = list(run_tasks(Shared(tmp_path), range(10), there, label="sharing", ahead=2))
    used = {pid for pid, _ in found}
    assert [number for _, number in found] == [*range(10)] and len(used) == 2
    until(lambda: {path.name for path in tmp_path.iterdir()} == {f"closed-{pid}" for pid in used})
    assert "the same in each process" in caplog.text


def test_a_killed_process_costs_time_and_not_the_result(there, tmp_path):
    assert list(run_tasks(partial(suicidal, tmp_path, MOST_DEATHS - 1), range(5), there, label="dying")) == [*range(5)]


def test_an_error_in_a_worker_is_the_error_of_the_command(there, tmp_path):
    with pytest.raises(InputError, match=r"house\.e57: has no points; scan it again"):
        list(run_tasks(partial(wrong, tmp_path), range(400), there, label="erring"))
    assert len([*tmp_path.iterdir()]) < 300, "the other tasks are not waited for"


_PARENT = """
import sys
from pointglass.viewer.common.workers.run_tasks import Workers, run_tasks
from test_run_tasks import slow
list(run_tasks(slow, [sys.argv[1]] * 4, Workers(scheduler=sys.argv[2]), label="slow"))
"""


def test_tasks_end_where_their_command_is_killed(there, tmp_path):
    process = subprocess.Popen([sys.executable, "-c", _PARENT, str(tmp_path), there.scheduler], cwd=Path(__file__).parent)
    until(lambda: len([*tmp_path.iterdir()]) == 2)
    process.kill()
    process.wait()
    pids = [int(path.name) for path in tmp_path.iterdir()]
    until(lambda: not any(is_running(pid) for pid in pids))


def once(folder: Path, number: int) -> int:
    """The first attempt at task 3 kills the Dask worker."""
    mark = folder / "killed"
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60)
    return number


def test_a_killed_dask_worker_costs_time_and_not_the_result(there, tmp_path, cluster):
    from distributed import Client

    assert list(run_tasks(partial(once, tmp_path), range(6), there, label="dying")) == [*range(6)]
    with Client(cluster) as client:  # what the next test needs
        client.run(sys.path.insert, 0, str(Path(__file__).parent))
