"""Compiled loops: numba's njit, kept on disk between runs where there is a folder for it."""

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator

from numba import njit

from model.common.signals import STOPS, handled

_BLAS = "scipy.linalg.cython_blas"


def _skip_blas_check() -> None:
    """Keeps numba from importing scipy.linalg when it loads its array functions: 0.1 s of a start, for np.dot, which no loop
    here calls.  scipy is a dependency, so other code's loops may call np.dot: numba imports it when it compiles them."""
    if _BLAS in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    sys.modules[_BLAS] = None  # type: ignore[assignment]  # an import of it fails, as if scipy were not there
    try:
        from numba.np import arraymath
    finally:
        del sys.modules[_BLAS]
    arraymath._HAVE_BLAS = True  # type: ignore[attr-defined]


_skip_blas_check()


def compiled(**options):
    """njit, kept on disk between runs where numba finds a folder it can write to: an installation may be read-only.

    Division is IEEE's: Python's, which raises an error, would keep a loop from vector instructions.
    """
    options = {"error_model": "numpy", **options}

    def decorate(function):
        try:
            return njit(cache=True, **options)(function)
        except RuntimeError:
            return njit(**options)(function)

    return decorate


@contextlib.contextmanager
def unbroken() -> Iterator[None]:
    """Ctrl-C during the block, or SIGTERM where that is one, is raised at its end.

    For calls of seconds into a compiled loop on the main thread: an interrupt that is raised while numba turns results
    into Python's gives a SystemError, or a crash where there are several.
    """
    usual = {stop: handler for stop in STOPS if callable(handler := signal.getsignal(stop))}
    if threading.current_thread() is not threading.main_thread() or not usual:
        yield
        return
    came: list[tuple] = []
    try:
        with handled(usual, lambda *call: came.append(call)):
            yield
    finally:
        for call in came:
            usual[call[0]](*call)
