"""What is compiled into a loop from elsewhere: constants and loops of other modules.

numba keeps machine code as long as the loop's own file is the same, and does not look further (its documentation, "Cache
invalidation"): after a constant of another module had changed, a checkout went on with the old value.
"""

import hashlib
from collections.abc import Iterator
from enum import Enum
from functools import cache
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_PACKAGE = __name__.partition(".")[0]
_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic, Enum)


@cache
def digest(function: FunctionType) -> str:
    """Changes with each value that ``function`` takes from its globals, and with the loops that it calls, at any depth.

    Globals are read when this is first called for it, so that loops defined further down count as well.
    """
    found = hashlib.sha256()
    _add(function, found, set())
    return found.hexdigest()


def _add(function: FunctionType, found: Any, visited: set[FunctionType]) -> None:
    visited.add(function)
    for name, value in sorted(_values(function), key=lambda item: item[0]):
        if isinstance(called := getattr(value, "py_func", None), FunctionType):  # a compiled loop
            if called not in visited:
                found.update(f"{called.__module__}.{called.__qualname__}".encode())
                for code in _codes(called.__code__):
                    found.update(code.co_code + repr([c for c in code.co_consts if _is_plain(c)]).encode())
                _add(called, found, visited)
        elif isinstance(value, np.ndarray):
            found.update(f"{name}{value.dtype}{value.shape}".encode() + value.tobytes())
        elif _is_plain(value):
            found.update(f"{name}={value!r};".encode())


def _values(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Names and values of the globals that a function uses, and of attributes of this package's modules among them."""
    names = {name for code in _codes(function.__code__) for name in code.co_names}
    for name in names & function.__globals__.keys():
        value = function.__globals__[name]
        if not isinstance(value, ModuleType):
            yield name, value
        elif value.__name__.partition(".")[0] == _PACKAGE:
            yield from ((f"{name}.{part}", getattr(value, part)) for part in names if hasattr(value, part))


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of a function and of the functions within it."""
    yield code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _codes(inner)


def _is_plain(value: Any) -> bool:
    return all(map(_is_plain, value)) if isinstance(value, tuple) else isinstance(value, _PLAIN)
