"""Atomic operations on array elements for compiled loops that run on several threads; numba has none for processors.

Sequentially consistent order is not needed: results are read after the threads have ended.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic


def _operation(name: str) -> Callable[..., Any]:
    """An intrinsic (array, index, value) -> the element before, with LLVM's atomicrmw ``name``; the index is not checked."""

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


atomic_add = _operation("add")
"""(array of integers, index, value): adds to an element, modulo its size, and returns what it was."""
atomic_max = _operation("umax")
"""(array of unsigned integers, index, value): raises an element to at least ``value`` and returns what it was."""
