"""Compiled loops: numba's njit with its cache on disk."""

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator

from numba import njit

from .signals import STOPS, handled

_BLAS = "scipy.linalg.cython_blas"
"""Module that numba imports to compile np.dot."""


def _skip_blas_check() -> None:
    """Prevents numba from importing scipy.linalg when it loads its array functions, which takes 0.1 s of the start.

    numba needs it for np.dot, which no loop here calls.  Loops of other code may: numba then imports it when it compiles them.
    """
    if _BLAS in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    sys.modules[_BLAS] = None  # type: ignore[assignment]  # makes its import fail
    try:
        from numba.np import arraymath
    finally:
        del sys.modules[_BLAS]
    arraymath._HAVE_BLAS = True  # type: ignore[attr-defined]


_skip_blas_check()


def compiled(**options):
    """njit, cached on disk where numba finds a writable folder; an installation may be read-only.

    Division follows IEEE: Python's, which raises an error, would prevent vectorisation.
    """
    options = {"error_model": "numpy", **options}

    def decorate(function):
        try:
            return njit(cache=True, **options)(function)
        except RuntimeError:  # no writable folder for the cache
            return njit(**options)(function)

    return decorate


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Delays Ctrl-C, or SIGTERM where it is handled, to the end of the block.

    For calls of seconds into a compiled loop on the main thread: an interrupt raised while numba converts results to Python
    objects causes a SystemError, and several of them a crash.
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
