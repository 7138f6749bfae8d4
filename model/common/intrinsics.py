"""Operations of LLVM that compiled loops call by a name, where numba has no function for them.

numba is imported when the first loop that uses one is compiled or loaded.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any


class Operation:
    """make: returns numba's intrinsic; called once, when a loop that names this operation is compiled."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make

    @cached_property
    def _numba_type_(self) -> Any:
        """What numba asks for where a loop names the operation."""
        from numba.core.registry import cpu_target

        context: Any = cpu_target.typing_context
        intrinsic = self._make()
        context.refresh()  # numba looks for new intrinsics when it begins to compile, which may be before
        return context.resolve_value_type(intrinsic)

    def __call__(self, *arguments: Any) -> Any:
        raise NotImplementedError("an operation of compiled loops: Python does not call it")


def _multiply_add() -> Any:
    from numba.core import types
    from numba.extending import intrinsic

    @intrinsic
    def operation(typingctx, a, b, c):
        def generate(context, builder, signature, arguments):
            return builder.fma(*arguments)

        return types.float32(types.float32, types.float32, types.float32), generate

    return operation


multiply_add = Operation(_multiply_add)
"""(a, b, c), float32: a * b + c, rounded once, as software OpenGL computes the polynomials of its logarithms."""
