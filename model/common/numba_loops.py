"""numba's njit with its cache on disk.  Imported by model/common/jit.py when the first loop is called: it imports numba."""

import inspect
import sys
import threading
from pathlib import Path
from types import FunctionType
from typing import Any

from numba import njit
from numba.core import config as _numba_config
from numba.core import event, types
from numba.core.caching import FunctionCache

from .compiled_in import digest
from .loop_cache import NOTICE, kept_in

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


class _CompilingListener(event.Listener):
    """Tells NOTICE of this package's loops; numba reports those that it compiles, not those that it loads."""

    def on_start(self, event) -> None:
        if _is_ours(event.data["dispatcher"]):
            NOTICE.started()

    def on_end(self, event) -> None:
        if _is_ours(event.data["dispatcher"]):
            NOTICE.ended()


def _is_ours(dispatcher) -> bool:
    return dispatcher.py_func.__module__.partition(".")[0] == __name__.partition(".")[0]


class _Cache(FunctionCache):
    """numba's, which also looks at what is compiled into a loop from other modules."""

    def _index_key(self, sig, codegen) -> Any:
        return (*super()._index_key(sig, codegen), digest(self._py_func), _fields_in(sig))


def _fields_in(kinds) -> tuple:
    """Names of the fields of the named tuples among the types of arguments, at any depth: compiled code has their order, and
    numba compares only their class and types."""
    return tuple((getattr(kind, "fields", ()), _fields_in(kind)) for kind in kinds if isinstance(kind, types.BaseTuple))


def _cached(function, options: dict):
    loop: Any = njit(**options)(function)
    loop._cache = _Cache(function)  # as its enable_caching
    return loop


config: Any = _numba_config  # its settings are set from the environment, which a type checker does not see
event.register("numba:compile", _CompilingListener())
_CONFIG = threading.Lock()


def dispatcher_of(function: FunctionType, options: dict[str, Any]) -> Any:
    """numba's dispatcher of a function, which keeps machine code in a folder that can be written, if there is one."""
    if not config.CACHE_DIR:
        package = Path(inspect.getfile(function)).parent
        folder = kept_in(package)
        if folder is None:
            NOTICE.kept = False
            return njit(**options)(function)
        if package not in folder.parents:
            return _kept_in(folder, function, options)
    try:
        return _cached(function, options)
    except RuntimeError:  # NUMBA_CACHE_DIR cannot be written
        NOTICE.kept = False
        return njit(**options)(function)


def _kept_in(folder: Path, function, options: dict):
    """numba reads its setting where a loop is decorated; the loops of other code keep to their own folders."""
    with _CONFIG:
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:
            return _cached(function, options)
        finally:
            config.CACHE_DIR = before
