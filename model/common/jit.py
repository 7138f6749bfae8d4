"""Compiled loops.  numba, which takes 0.4 s to import, is imported when the first one is called, not where it is defined."""

import functools
import threading
from types import FunctionType
from typing import Any

_FIRST_CALL = threading.RLock()


class Loop:
    """A function that numba compiles, or loads from its cache, when it is first called.

    py_func: the function itself, run by Python.  dispatcher: numba's, created when it is first asked for.
    Another loop calls this one by its name, as it would call numba's: numba asks for ``_numba_type_``.
    """

    def __init__(self, function: FunctionType, options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self._made: Any = None

    @property
    def dispatcher(self) -> Any:
        if self._made is None:
            with _FIRST_CALL:  # loops of one scene are called by several threads
                if self._made is None:
                    from .numba_loops import dispatcher_of

                    self._made = dispatcher_of(self.py_func, self._options)
        return self._made

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return (self._made or self.dispatcher)(*arguments, **named)


def compiled(**options: Any) -> Any:
    """njit, cached on disk in a folder that can be written (model/common/loop_cache.py); NUMBA_CACHE_DIR goes before it.

    Division follows IEEE: Python's, which raises an error, would prevent vectorisation.
    """
    return lambda function: Loop(function, {"error_model": "numpy", **options})
