"""Notes as a CSV table, one row each."""

import csv
import io
from collections.abc import Iterable

from ...common.text import printable, table_places
from .annotation import STATUSES, Annotation

COLUMNS = ("number", "title", "text", "status", "x", "y", "z", "unit", "link", "picture", "made")


def csv_text(notes: Iterable[Annotation], unit: str) -> str:
    """The notes as CSV (RFC 4180, ``.`` as decimal point).  unit: of the coordinates, as a person reads it."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(COLUMNS)
    for number, note in enumerate(notes):
        texts = (note.title(number), note.text, STATUSES[note.status].name)
        rest = (unit, note.link, note.picture, note.made)
        writer.writerow([number + 1, *map(_cell, texts), *table_places(note.position), *map(_cell, rest)])
    return out.getvalue()


def _cell(text: str) -> str:
    """A text without control characters but line ends, which a spreadsheet does not take for a formula (OWASP, CSV injection):
    a stranger's project may hold both."""
    text = "\n".join(map(printable, text.splitlines()))
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
