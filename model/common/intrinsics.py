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


def _prefetch() -> Any:
    from llvmlite import ir
    from numba.core import cgutils, types
    from numba.extending import intrinsic

    @intrinsic
    def operation(typingctx, array, index):
        def generate(context, builder, signature, arguments):
            kind, word = signature.args[0], ir.IntType(32)
            made = context.make_array(kind)(context, builder, arguments[0])
            place = cgutils.get_item_pointer(context, builder, kind, made, [arguments[1]], wraparound=False)
            place = builder.bitcast(place, ir.IntType(8).as_pointer())
            hint = ir.FunctionType(ir.VoidType(), [place.type, word, word, word])
            called = cgutils.get_or_insert_function(builder.module, hint, f"llvm.prefetch.p0{_named(place.type)}")
            builder.call(called, [place, word(0), word(3), word(1)])  # to read, into every cache, data
            return context.get_dummy_value()

        return types.none(array, types.intp), generate

    return operation


def _named(pointer: Any) -> str:
    """Of a pointer's type in the name of LLVM's function: opaque pointers have none."""
    return "" if getattr(pointer, "is_opaque", False) else "i8"


prefetch = Operation(_prefetch)
"""(array, index): begins to load the cache line of an element, which is not checked; changes nothing."""
