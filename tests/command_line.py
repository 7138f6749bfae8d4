"""The command line within the process of the tests: a start of another process takes 1.5 seconds of a processor.

The outermost test of a command starts a process; what else is said about its options and refusals need not.
"""

import contextlib
import io
import subprocess
import sys

from pointglass.viewer.cli import main


def run_here(*arguments: object) -> "subprocess.CompletedProcess[str]":
    """What ``pointglass ARGUMENTS`` does, in this process: exit code and text of both streams."""
    line, out, err = [str(argument) for argument in arguments], io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(line)
    return subprocess.CompletedProcess(line, code, out.getvalue(), err.getvalue())


def run_in_a_process(*arguments: object) -> "subprocess.CompletedProcess[str]":
    """The same, in a process of its own: what a person starts."""
    line = [sys.executable, "-m", "pointglass.viewer", *map(str, arguments)]
    return subprocess.run(line, capture_output=True, text=True, timeout=300)
