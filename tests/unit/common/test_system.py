"""What differs between systems: the product without what Windows and macOS lack, taken away here (no other one has run it)."""

import ast
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cloud_files import write_ply

from pointglass.model.common import system
from pointglass.model.common.files.atomic_write import write_atomic
from pointglass.model.common.process.native_output import without_panics
from pointglass.viewer.common.limited_memory import lacks_room, run_in_child_where_limited
from pointglass.viewer.window.session.autosave import lock

ROOT = Path(__file__).resolve().parents[3]
POSIX_ONLY = {
    "os": {"O_NOFOLLOW", "O_NONBLOCK", "O_TMPFILE", "WNOHANG", "fork", "forkpty", "getgid", "geteuid", "getegid", "getuid",
           "getpriority", "killpg", "memfd_create", "nice", "posix_fadvise", "posix_fallocate", "posix_madvise", "pread",
           "preadv", "register_at_fork", "sched_getaffinity", "setpriority", "statvfs", "sync", "uname"},
    "signal": {"SIGBREAK", "SIGHUP", "SIGKILL", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGPIPE", "setitimer", "alarm"},
}
"""Module -> names that it has on some systems only."""
ALLOWED = {
    "model/common/system.py": "the module that knows",
    "model/common/process/processors.py": "asks whether sched_getaffinity exists",
    "viewer/common/limited_memory.py": "only where system.address_space_is_limited",
}
WITHOUT = """
import os, signal, sys
for name in ("fcntl", "resource", "pwd", "grp", "termios", "syslog", "posix_ipc"):
    sys.modules[name] = None
for name in {names}:
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGHUP", "SIGKILL", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGPIPE"):
    delattr(signal, name)
"""
"""What a start on Windows would miss.  Python's own library needs some of it, and is imported before."""


def without(code: str, *arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    """A fresh Python that runs ``code`` without what Windows lacks."""
    names = sorted(POSIX_ONLY["os"] - {"uname", "WNOHANG", "register_at_fork", "statvfs"})  # Python itself asks
    begin = ("import os; del os.O_TMPFILE, os.O_NOFOLLOW, os.O_NONBLOCK\n"
             "import subprocess, tempfile, platform, random, logging, shutil, threading, multiprocessing, "
             "concurrent.futures.thread, concurrent.futures.process, numpy, numba\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "POINTGLASS_CACHE": str(cwd / "cache"),
                   "POINTGLASS_STATE": str(cwd / "state")}
    return subprocess.run([sys.executable, "-c", begin + WITHOUT.format(names=names) + code, *map(str, arguments)], cwd=cwd,
                          capture_output=True, text=True, timeout=300, env=environment)


@pytest.fixture
def windows(monkeypatch):
    """The functions of the module as they are on Windows, as far as that can be shown here."""
    monkeypatch.setattr(system, "WINDOWS", True)
    monkeypatch.setattr(system, "fcntl", None)
    return monkeypatch


@pytest.mark.parametrize("command", [["--help"], ["info", "scan.ply", "--json"], ["convert", "scan.ply", "--out", "grid"],
                                     ["export", "scan.ply", "--out", "out.laz"], ["info", "missing.ply"]])
def test_commands_work_without_what_windows_lacks(tmp_path, command):
    rng = np.random.default_rng(1)
    write_ply(tmp_path / "scan.ply", rng.uniform(0, 2, (2000, 3)), rng.integers(0, 256, (2000, 3), dtype=np.uint8))
    run = "from pointglass.viewer import __main__ as m; sys.argv[:] = ['pointglass', *sys.argv[1:]]; m.main()"
    done = without(run, *command, cwd=tmp_path)
    if "missing.ply" in command:
        assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and "missing.ply" in done.stderr
        return
    assert done.returncode == 0, done.stderr
    assert {"--help": "convert", "info": '"count": 2000', "convert": "", "export": ""}[command[0]] in done.stdout
    if command[0] in ("convert", "export"):
        assert (tmp_path / command[-1]).exists()
    assert not list(tmp_path.glob(".*")), "temporary files are gone"


def test_python_works_without_what_windows_lacks(tmp_path):
    done = without("import pointglass\nscan = pointglass.from_points([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1.0, 0, 0]] * 3)\n"
                   "print(scan.count, scan.points.rgb.tolist()[0], scan.export('three.ply'))", cwd=tmp_path)
    assert (done.returncode, done.stdout.strip()) == (0, "3 [255, 0, 0] 3"), done.stderr


def test_only_one_module_uses_what_some_systems_lack():
    found = {}
    for file in [*ROOT.glob("viewer/**/*.py"), *ROOT.glob("model/**/*.py")]:
        name = file.relative_to(ROOT).as_posix()
        tree = ast.parse(file.read_text("utf-8"))
        uses = {f"{node.value.id}.{node.attr}" for node in ast.walk(tree)
                if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
                and node.attr in POSIX_ONLY.get(node.value.id, ())}
        uses |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names
                 if alias.name in ("fcntl", "resource", "pwd", "grp", "termios", "msvcrt", "winreg")}
        uses |= {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)
                 and node.value.startswith(("/proc/", "/dev/shm", "/sys/")) and "\n" not in node.value}
        if uses:
            found[name] = sorted(uses)
    shown = {name: uses for name, uses in found.items() if name not in ALLOWED}
    assert shown == {"viewer/bench/bench_input.py": ["/proc/driver/nvidia/version"]}, "put it into model/common/system.py"
    assert set(ALLOWED) <= set(found), "these exceptions are no longer needed"


def test_stops_are_those_that_the_system_has():
    assert system.STOPS == (signal.SIGINT, signal.SIGTERM) and signal.SIGHUP in system.ALL_STOPS
    code = "signal.SIGBREAK = signal.SIGUSR1\nimport pointglass.model.common.system as s; print(len(s.STOPS), len(s.ALL_STOPS))"
    early = WITHOUT.replace("for name in (\"SIGHUP\"", "signal.SIGBREAK = 21\nfor name in (\"SIGHUP\"").format(names=[])
    done = subprocess.run([sys.executable, "-c", early + code.partition("\n")[2]], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.split() == ["3", "3"], done.stderr


def test_windows_is_asked_again_to_rename_for_a_while(tmp_path, windows):
    target = tmp_path / "a.txt"
    target.write_text("old")
    rename, refusals = Path.replace, [PermissionError(13, "in use")] * 2

    def sometimes(path, to):
        if refusals:
            raise refusals.pop()
        return rename(path, to)

    windows.setattr(Path, "replace", sometimes)
    write_atomic(target, lambda beside: beside.write_text("new"))
    assert target.read_text() == "new" and not refusals

    windows.setattr(system, "_REPLACE_S", 0.2)
    windows.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(PermissionError(13, "mapped")))
    with pytest.raises(PermissionError, match="mapped"):
        write_atomic(target, lambda beside: beside.write_text("newer"))
    assert target.read_text() == "new" and [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_elsewhere_a_rename_that_is_refused_is_not_tried_again(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(Path, "replace", lambda *call: calls.append(call) or (_ for _ in ()).throw(PermissionError(13, "no")))
    with pytest.raises(PermissionError):
        system.replace(tmp_path / "a", tmp_path / "b")
    assert len(calls) == 1


@pytest.mark.parametrize("kind", ["flock", "msvcrt", "none"])
def test_locks_by_what_the_system_has(tmp_path, monkeypatch, kind):
    held: set[tuple[int, int]] = set()

    def locking(file, _mode, _count):
        key = os.fstat(file).st_dev, os.fstat(file).st_ino
        if key in held:
            raise PermissionError(13, "Permission denied")
        held.add(key)

    if kind != "flock":
        monkeypatch.setattr(system, "fcntl", None)
        fake = SimpleNamespace(locking=locking, LK_NBLCK=2) if kind == "msvcrt" else None
        monkeypatch.setitem(sys.modules, "msvcrt", fake)
        assert system.locked(tmp_path) is None
    path = tmp_path / "a.lock"
    first = lock(path)
    assert first is not None
    second = lock(path)
    assert (second is None) == (kind != "none")
    if second is not None:
        os.close(second)
    system.remove_lock_file(path, first)
    assert not path.exists()


def test_a_lock_file_is_closed_before_it_is_removed_on_windows(tmp_path, windows):
    file = system.lock_file(tmp_path / "a.lock")
    unlink = Path.unlink

    def refused_while_open(path, missing_ok=False):
        with pytest.raises(OSError):
            os.fstat(file)
        unlink(path, missing_ok)

    windows.setattr(Path, "unlink", refused_while_open)
    system.remove_lock_file(tmp_path / "a.lock", file)
    assert not (tmp_path / "a.lock").exists()


def test_permission_bits_count_where_they_mean_something(tmp_path, monkeypatch):
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    assert system.only_own(tmp_path.stat()) and not system.only_own((tmp_path / "open").stat())
    monkeypatch.setattr(system, "WINDOWS", True)
    assert system.only_own((tmp_path / "open").stat())
    monkeypatch.delattr(os, "getuid")
    assert system.user_number() == 0


@pytest.mark.parametrize("positioned", [True, False])
def test_threads_read_at_their_own_places(tmp_path, monkeypatch, positioned):
    if not positioned:
        monkeypatch.delattr(os, "preadv")
    data = np.random.default_rng(3).integers(0, 256, 1 << 16, dtype=np.uint8).tobytes()
    (tmp_path / "data").write_bytes(data)
    turn, wrong = threading.Lock(), []
    with open(tmp_path / "data", "rb", buffering=0) as file:

        def read(seed: int) -> None:
            rng = np.random.default_rng(seed)
            for place in rng.integers(0, len(data) - 64, 200):
                into = bytearray(64)
                got = system.read_at(file, memoryview(into), int(place), turn)
                if bytes(into[:got]) != data[place : place + got] or got == 0:
                    wrong.append(place)

        threads = [threading.Thread(target=read, args=(seed,)) for seed in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert wrong == [] and system.read_at(file, memoryview(bytearray(8)), len(data), turn) == 0


def test_space_is_allocated_by_either_call(tmp_path, monkeypatch):
    for name in ("blocks", "length"):
        with open(tmp_path / name, "w+b") as file:
            system.allocate(file.fileno(), 5000)
        assert (tmp_path / name).stat().st_size == 5000
        monkeypatch.delattr(os, "posix_fallocate", raising=False)


def test_children_are_ended_also_without_waiting_for_them(monkeypatch):
    deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", deaf], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        child.stdout.readline()
        assert child.pid in system.child_processes()
        system.end_processes([child.pid], 0.2)
        assert child.wait(10) in (-signal.SIGKILL, 0)  # 0: the module has waited for it
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as child:
        with monkeypatch.context() as patch:
            patch.delattr(os, "WNOHANG")
            patch.delattr(signal, "SIGKILL")
            system.end_processes([child.pid], 60.0)
        assert child.wait(10) == -signal.SIGTERM


def test_without_proc_nothing_is_known_and_nothing_fails(monkeypatch, tmp_path):
    assert (system.available_memory() or 0) <= (system.total_memory() or 0) and system.resident_memory() > 1 << 20
    with open(tmp_path / "a", "w+b") as file:
        assert os.path.samefile(system.path_of_descriptor(file.fileno()) or "", tmp_path / "a")
        monkeypatch.setattr(system, "_PROC", tmp_path / "none")
        assert system.path_of_descriptor(file.fileno()) is None
    assert system.available_memory() is None and system.total_memory() is None and system.child_processes() == set()
    assert system.resident_memory() > 1 << 20, "the peak, where /proc is missing"
    monkeypatch.setitem(sys.modules, "resource", None)
    assert system.resident_memory() == 0 and not system.address_space_is_limited() and not lacks_room(1 << 62)
    assert isinstance(system.processor_name(), str)
    run_in_child_where_limited()  # returns: there is no limit that could be asked for


def test_a_pipe_is_widened_where_it_can_be(monkeypatch):
    reading, writing = os.pipe()
    system.widen_pipe(writing, 1 << 18)
    os.set_blocking(writing, False)
    assert os.write(writing, bytes(1 << 18)) == 1 << 18
    monkeypatch.setattr(system, "fcntl", None)
    system.widen_pipe(writing, 1 << 18)
    os.close(reading)
    os.close(writing)


def test_reports_of_native_code_are_seen_where_there_is_no_file_in_memory(monkeypatch, capfd):
    monkeypatch.delattr(os, "memfd_create")
    with without_panics():
        os.write(2, b"thread 'main' panicked at x\n")
    assert "panicked" in capfd.readouterr().err


def test_priority_is_lowered_for_one_thread_on_linux_only(monkeypatch):
    calls = []
    now = [9]
    monkeypatch.setattr(os, "setpriority", lambda *call: calls.append(call))
    monkeypatch.setattr(os, "getpriority", lambda *_: now[0])
    system.lower_thread_priority(7)
    assert not calls, "a process that was started with nice 9 may not go back"
    now[0] = 0
    system.lower_thread_priority(7)
    assert calls == [(os.PRIO_PROCESS, threading.get_native_id(), 7)]
    monkeypatch.setattr(sys, "platform", "darwin")
    system.lower_thread_priority(7)
    assert len(calls) == 1
