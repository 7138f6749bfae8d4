"""Atomic operations on array elements for compiled loops that run on several threads; numba has none for processors.

Sequentially consistent order is not needed: results are read after the threads have ended.  numba is imported when the first
loop that uses them is compiled or loaded.
"""

from functools import cached_property
from typing import Any


class _Operation:
    """An intrinsic (array, index, value) -> the element before, with LLVM's atomicrmw ``name``; the index is not checked."""

    def __init__(self, name: str) -> None:
        self._name = name

    @cached_property
    def _numba_type_(self) -> Any:
        """What numba asks for where a loop names the operation."""
        from numba.core.registry import cpu_target

        context: Any = cpu_target.typing_context
        intrinsic = _intrinsic(self._name)
        context.refresh()  # numba looks for new intrinsics when it begins to compile, which may be before
        return context.resolve_value_type(intrinsic)

    def __call__(self, array: Any, index: Any, value: Any) -> Any:
        raise NotImplementedError("an operation of compiled loops: Python does not call it")


def _intrinsic(name: str) -> Any:
    from llvmlite import ir
    from numba.core import cgutils, types
    from numba.extending import intrinsic

    @intrinsic
    def operation(typingctx, array, index, value):
        signature = array.dtype(array, types.intp, array.dtype)

        def generate(context, builder: ir.IRBuilder, signature, arguments):
            kind = signature.args[0]
            made = context.make_array(kind)(context, builder, arguments[0])
            element = cgutils.get_item_pointer(context, builder, kind, made, [arguments[1]], wraparound=False)
            return builder.atomic_rmw(name, element, arguments[2], "monotonic")

        return signature, generate

    return operation


atomic_add = _Operation("add")
"""(array of integers, index, value): adds to an element, modulo its size, and returns what it was."""
atomic_max = _Operation("umax")
"""(array of unsigned integers, index, value): raises an element to at least ``value`` and returns what it was."""
