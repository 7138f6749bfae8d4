"""Reports of panics do not reach standard error; everything else does, in order, and a signal's line at once."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
CODE = """
import os, sys, threading
from pointglass.model.common.process.native_output import error_descriptor, without_panics

def write(text):
    os.write(2, text)

print("first", file=sys.stderr)
with without_panics():
    print("of Python", file=sys.stderr)
    with without_panics():
        write(b"of a library\\n")
        os.write(error_descriptor(), b"at once\\n")
    thread = threading.Thread(target=write, args=(b"of a thread\\n",))
    thread.start()
    thread.join()
    write(b"\\nthread '<unnamed>' (7) panicked at laz.rs:1:2:\\nindex out of bounds\\nnote: run with RUST_BACKTRACE=1\\n")
print("last", file=sys.stderr)
assert error_descriptor() == 2
"""


def test_only_panics_are_dropped():
    said = subprocess.run([sys.executable, "-c", CODE], cwd=ROOT, capture_output=True, text=True)
    assert said.returncode == 0
    assert said.stderr.splitlines() == ["first", "at once", "of Python", "of a library", "of a thread", "last"]


def test_nothing_fails_where_standard_error_is_closed():
    code = ("import os; os.close(2)\nfrom pointglass.model.common.process.native_output import without_panics\n"
            "with without_panics(): print(5)")
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True).stdout == "5\n"


def test_no_descriptor_is_left_open():
    from pointglass.model.common.process.native_output import without_panics

    before = sorted(os.listdir("/proc/self/fd"))
    for _ in range(3):
        with without_panics():
            pass
    assert sorted(os.listdir("/proc/self/fd")) == before
