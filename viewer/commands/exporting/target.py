"""What a format is that export writes.  The table of them is TARGETS in targets.py."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """name: in help and messages.  least_bytes: of a point, to refuse a full disk before the work.

    write: writes a file from columns (targets.Columns).  same: formats of sources (Source.format) whose bytes are copied.
    copy: writes whole records of sources and returns their number, or None where these are no records of this format.
    las: whether it holds LAS records: further records of sources, and colours of 8 bits.
    poses: whether it holds where scanners stood.
    """

    name: str
    least_bytes: int
    write: Callable[..., None]
    same: tuple[str, ...] = ()
    copy: Callable[..., int | None] | None = None
    las: bool = False
    poses: bool = False
