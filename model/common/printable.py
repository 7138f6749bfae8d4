"""Text shown to a person, without what a terminal or an editor obeys: file names, names in files and metadata may hold it.

Control characters and escape sequences move the cursor, retitle the window or fill in a command line; characters that change
the direction of writing make a name look like another one.  They are shown escaped (``\\x1b``), and unpaired surrogates, of
file names that are not UTF-8, as well.

:func:`escaped_output` does it for all that a command prints, so that no message can forget it; PointglassError and the log do
it for their own texts.
"""

import contextlib
import sys
from collections.abc import Iterator
from typing import Any


def printable(text: object, *, lines: bool = False) -> str:
    """``str(text)`` on one line, with every character that does not print escaped.  lines: keep lines, tabs and
    spaces."""
    text = str(text)
    if text.isprintable():
        return text
    if not lines:
        text = " ".join(text.split())
    return "".join(c if c.isprintable() or (lines and c in "\n\t") else ascii(c)[1:-1] for c in text)


class EscapedStream:
    """A text stream that writes to another one, escaped.  A progress bar may go back to the beginning of its line."""

    def __init__(self, stream: Any):
        self._stream = stream

    def write(self, text: str) -> int:
        bar = text.startswith("\r")
        if text != "\x1b[A":  # tqdm: up to the bar above
            text = "\r" * bar + printable(text[bar:], lines=True)
        return self._stream.write(text)

    def writelines(self, lines) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextlib.contextmanager
def escaped_output() -> Iterator[None]:
    """Within the block standard output and standard error are escaped."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (stream if stream is None else EscapedStream(stream) for stream in before)  # type: ignore
    try:
        yield
    finally:
        for name, stream in zip(("stdout", "stderr"), before, strict=True):
            if getattr(sys, name) is not None:  # a closed pipe
                setattr(sys, name, stream)
