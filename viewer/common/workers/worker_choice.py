"""Who does the tasks of a command."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Workers:
    """``count`` processes of this machine, or the workers of the Dask scheduler at an address."""

    count: int = 1
    scheduler: str | None = None
