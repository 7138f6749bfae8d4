"""Rows of numbers from evenly spread places of a text file, without reading what lies between.

A block of bytes stands for the lines that begin in it.  Frame and units: the file's.  Memory: one block.
"""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ..sampling import interleaved
from .text_rows import BLANKS, LONGEST_LINE, TextRows, line_feeds
from .utf16 import open_text

_LINE_END_BYTES = 1 << 12  # read behind a block to complete its last line; rows of scans have up to about 200 bytes


@dataclass(frozen=True)
class TextRegion:
    """Rows of one kind without a break: bytes ``begin`` to ``end`` of the file, ``scan`` their scan's index.

    target: for each field of a line its column in the tables that are returned, -1 for none.
    """

    begin: int
    end: int
    target: list[int]
    scan: int = 0


def sample_rows(path: Path, regions: list[TextRegion], points: int, run: int, delimiter: str = BLANKS,
                decimal: str = ".", rest: bool = False) -> Iterator[tuple[int, np.ndarray]]:  # fmt: skip
    """Yields (scan, (n, columns) float64) of about ``points`` rows in runs of about ``run``, spread over the regions.

    delimiter, decimal, rest: as in Layout (viewer.readers.text.text_columns).
    Raises InputError naming the bytes where a block does not hold rows of numbers.
    """
    with open_text(path) as file:
        row_bytes = max((_row_bytes(file, region) for region in regions), default=1)
        block_bytes = run * row_bytes
        sizes = [region.end - region.begin for region in regions]
        for part, start in interleaved(sizes, points * row_bytes, block_bytes):
            region = regions[part]
            begin = region.begin + start
            text = _lines_of(file, region, begin, min(begin + block_bytes, region.end))
            if text:
                yield region.scan, _parsed(path, text, region, begin, delimiter, decimal, rest)


def _row_bytes(file, region: TextRegion) -> int:
    """Mean length of the rows at the beginning of a region."""
    file.seek(region.begin)
    text = line_feeds(file.read(min(LONGEST_LINE, region.end - region.begin)))
    return max(1, len(text) // max(1, text.count(b"\n")))


def _lines_of(file, region: TextRegion, begin: int, stop: int) -> bytes:
    """The lines that begin at a byte from ``begin`` on and before ``stop``, each with its end."""
    lead = 1 if begin > region.begin else 0  # the byte before tells whether a line begins here
    file.seek(begin - lead)
    text = line_feeds(file.read(min(stop + _LINE_END_BYTES, region.end) - begin + lead))
    first = text.find(b"\n") + 1 if lead else 0
    if (lead and not first) or first >= stop - begin + lead:
        return b""
    last = text.find(b"\n", stop - 1 - begin + lead)
    if last < 0 and stop + _LINE_END_BYTES >= region.end:
        return text[first:] + b"\n"
    return text[first : (last if last >= 0 else text.rfind(b"\n")) + 1]


def _parsed(path: Path, text: bytes, region: TextRegion, begin: int, delimiter: str, decimal: str, rest: bool) -> np.ndarray:
    try:
        table, other = TextRows(path, io.BytesIO(text)).rows(region.target, text.count(b"\n"), delimiter, decimal, rest)
    except InputError:  # its line number would count from the block
        table, other = np.zeros((0, 0)), -1
    if other is not None:
        raise InputError(f"the {len(text):,} bytes from byte {begin:,} on are not rows of {len(region.target)} numbers",
                         file=path, remedy="copy or export it again")  # fmt: skip
    return table
