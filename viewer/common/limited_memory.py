"""A command whose address space is limited (``ulimit -v``) runs in a child process, since some native code ends its process
where it is given no memory: Rust's and LLVM's allocators abort, OpenBLAS exits or tries for ever.  The parent then says so in
one line.

Nothing is changed where there is no such limit.  Imports nothing heavy: the parent must fit beside its child.
"""

import mmap
import os
import signal
import sys

from ...model.common.system import address_space_is_limited

_NOISE = (rb"memory allocation|bad_alloc|MemoryError|[Cc]annot allocate|out of memory|OpenBLAS|failed to map|Insufficient|"
          rb"load shared object|Traceback|terminate called")  # fmt: skip
"""What is said, on standard error, by code that ends for lack of memory."""
LINE = "pointglass: not enough memory for this; close other programs, allow this one more, or take a smaller scan\n"


def lacks_room(size: int) -> bool:
    """Whether the address space is limited and less than ``size`` bytes of it are left."""
    if not address_space_is_limited():
        return False
    try:
        mmap.mmap(-1, size).close()
    except (OSError, MemoryError):
        return True
    return False


def run_in_child_where_limited() -> None:
    """Returns at once where the address space is not limited; else in the child.  The parent ends with the child's exit code,
    or with 2 where the child was ended by lack of memory."""
    if not address_space_is_limited():
        return
    # OpenBLAS asks for the buffers of its threads again and again where there is no memory for them
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        os.dup2(writing, 2)
        os.close(writing)
        return
    import re

    from ...model.common.files.temporary import sweep_recorded

    os.close(writing)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to the child as well
    for stop in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(stop, lambda number, _frame: os.kill(child, number))
    said = b""
    while part := os.read(reading, 1 << 16):
        said = (said + part)[-(1 << 20) :]
    status = os.waitpid(child, 0)[1]
    code = os.waitstatus_to_exitcode(status)
    if code < 0 or (code not in (0, 130) and re.search(_NOISE, said)):
        sweep_recorded()
        said, code = LINE.encode(), 2
    sys.stderr.buffer.write(said)
    sys.stderr.flush()
    os._exit(code)
