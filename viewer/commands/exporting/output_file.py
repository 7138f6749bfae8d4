"""A file that compiled libraries write to.  lazrs hides why a write failed; the reason is kept here."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class _Output(io.BufferedRandom):
    """failure: the first error of writing."""

    failure: OSError | None = None

    def write(self, data: Any, /) -> int:
        return self._kept(super().write, data)

    def flush(self) -> None:
        self._kept(super().flush)

    def seek(self, *place: int) -> int:
        return self._kept(super().seek, *place)

    def _kept(self, call: Any, *arguments: Any) -> Any:
        try:
            return call(*arguments)
        except OSError as error:
            self.failure = self.failure or error
            raise


@contextmanager
def output_file(path: Path) -> Iterator[io.BufferedRandom]:
    """A new file, for writing and reading.  Raises OSError where a write failed, whatever a library made of it."""
    file = _Output(io.FileIO(path, "w+"))
    try:
        with file:
            yield file
    except Exception:
        if file.failure is not None:
            raise file.failure from None
        raise
