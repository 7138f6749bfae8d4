"""Decodes the points of an E57 in a process of its own: e57_columns starts it and says why.

It is told a Request, and then one byte for each block that has been read, so that its slot is free.  It answers the number of
points of each block, 0 after each scan, or an error.  It ends when its input does.
"""

import mmap
import os
import pickle
import signal
import sys
from typing import IO

from ...common.errors import InputError
from ...common.workers.messages import receive_bytes, send
from .e57_columns import SLOTS, Request, column_blocks, slots_in
from .e57_nodes import open_e57


def main() -> None:
    """The program."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the terminal; the end of the input ends this process
    told, answers = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints is no answer
    data = receive_bytes(told)
    if data is None:
        return
    request = pickle.loads(data)
    try:
        _decode(request, told, answers)
    except (InputError, MemoryError) as error:
        send(answers, error)
    except BrokenPipeError:  # nobody wants more
        pass


def _decode(request: Request, told: IO[bytes], answers: IO[bytes]) -> None:
    if isinstance(request.memory, str):
        memory = mmap.mmap(-1, request.size, tagname=request.memory)  # type: ignore[call-arg]  # of Windows
    else:
        memory = mmap.mmap(request.memory, request.size)
    free, turn = SLOTS, 0
    with open_e57(request.path) as file:
        for scan in request.scans:
            slots = slots_in(memory, scan.names, request.size, request.block)
            for columns in column_blocks(file, scan, request.block):
                if free == 0 and not told.read(1):  # waits until a block has been read
                    return
                free = max(free - 1, 0)
                count = len(columns[scan.names[0]])
                for name, values in columns.items():
                    slots[turn][name][:count] = values
                send(answers, count)
                turn = (turn + 1) % SLOTS
            send(answers, 0)
