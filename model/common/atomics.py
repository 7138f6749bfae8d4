"""Atomic operations on array elements for compiled loops that run on several threads; numba has none for processors.

Sequentially consistent order is not needed: results are read after the threads have ended.  numba is imported when the first
loop that uses them is compiled or loaded.
"""

from functools import partial
from typing import Any

from .intrinsics import Operation


def _intrinsic(name: str) -> Any:
    """(array, index, value) -> the element before, with LLVM's atomicrmw ``name``; the index is not checked."""
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


atomic_add = Operation(partial(_intrinsic, "add"))
"""(array of integers, index, value): adds to an element, modulo its size, and returns what it was."""
atomic_max = Operation(partial(_intrinsic, "umax"))
"""(array of unsigned integers, index, value): raises an element to at least ``value`` and returns what it was."""
