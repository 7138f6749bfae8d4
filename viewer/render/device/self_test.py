"""Runs shaders/self_test.comp, by which `pointglass doctor` and every new bridge check compute passes and buffers."""

from .compute_pass import Storage
from .shader import Programs


def run_self_test(programs: Programs, mode: int, source: Storage, target: Storage, count: int) -> None:
    """One of the shader's modes over ``count`` words of ``source``."""
    program = programs.compute("self_test.comp", MODE=mode, IN_BINDING=0, OUT_BINDING=1)
    source.bind_to_storage_buffer(0)
    target.bind_to_storage_buffer(1)
    program["count"] = count
    program.run(-(-count // 64))
    programs.context.memory_barrier()
