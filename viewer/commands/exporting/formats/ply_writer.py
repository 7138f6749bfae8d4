"""Columns to binary PLY.

The rows ``x y z red green blue intensity scan classification`` are a contract with other programs.  A column's type is another
only where the fixed one would lose something of its values; colours stay 8 bits, as nearly all readers of PLY expect.
"""

from pathlib import Path

import numpy as np

from ..columns import CUT_COLOURS, Column, Piece, Stream, Survey
from ..crs_records import Reference
from ..losses import Losses

_FIXED = ("intensity", "classification")
_NAMES = {"f8": "double", "f4": "float", "u1": "uchar", "i1": "char", "u2": "ushort", "i2": "short", "u4": "uint", "i4": "int"}
_PLAIN = {"return_number": 1, "number_of_returns": 1}
"""Values that say nothing where all records have them; 0 in other columns."""
_LAST = 255
"""Largest scan number of a uchar."""
_LONGEST = 4096
"""Bytes of a comment, below the 8192 that readers take of a line."""


def write_ply(path: Path, stream: Stream, found: Survey, reference: Reference, losses: Losses, *, crs: str | None,
              units: str | None, all_columns: bool = False) -> None:  # fmt: skip
    """Binary little-endian PLY.  all_columns: also the further columns, and 16-bit colours as they are."""
    wide, most = all_columns and not found.exact8, max(found.counts, default=0)
    # a file that was exported before tells its scans apart by this column alone
    own = most == 0 and "scan" in found.columns and found.columns["scan"].fits(0, _LAST) and not found.columns["scan"].gaps
    if most > _LAST and not all_columns:
        losses.add(f"of {most + 1} scans those from number {_LAST} on share that number (--all-columns tells them apart)")
    intensity = found.columns.get("intensity")
    shares = intensity is not None and not all_columns and intensity.shares
    if shares:
        losses.add("intensities from 0 to 1 are written as whole numbers, times 65535 (--all-columns keeps them)")
    further = _further(found, own) if all_columns else {}
    if not all_columns:
        _name_losses(found, own, losses)
    if found.exact8 and found.shifted:
        losses.add(CUT_COLOURS)
    if not found.coloured:
        losses.add("there are no colours in the file: red, green and blue are 0")
    colour = "<u2" if wide else "u1"
    kinds = [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("red", colour), ("green", colour), ("blue", colour),
             ("intensity", "<u2" if shares else _kind(intensity, "<u2", 65535)),
             ("scan", "<i4" if all_columns and most > _LAST else "u1"),
             ("classification", _kind(found.columns.get("classification"), "u1", 255))]  # fmt: skip
    kinds += [(name, kind) for name, (_, kind) in further.items()]
    about = [f"crs {crs or 'unknown'}, unit {units or 'unknown'}"]
    if shares:
        about.append("intensity is stored times 65535")
    if reference.wkt:
        about.append(f"wkt {' '.join(reference.wkt.split())}")
    comments = "".join(f"comment {_plain(text)}\n" for text in ("pointglass", *about) if len(text) < _LONGEST)
    fields = "".join(f"property {_NAMES[np.dtype(kind).str[1:]]} {name}\n" for name, kind in kinds)
    with path.open("wb") as file:
        head = f"ply\nformat binary_little_endian 1.0\n{comments}element vertex {found.count}\n{fields}end_header\n"
        file.write(head.encode("ascii"))
        for piece in stream.pieces("writing"):
            rows = np.zeros(len(piece.xyz), np.dtype(kinds))
            for axis, name in enumerate("xyz"):
                rows[name] = piece.xyz[:, axis]
            colours = found.colours16(piece) if wide else found.colours8(piece)
            for axis, name in enumerate(("red", "green", "blue")):
                rows[name] = colours[:, axis]
            scans = piece.columns["scan"] if own else piece.scan
            rows["scan"] = scans if all_columns else np.minimum(scans, _LAST)
            for name in _FIXED:
                if name in piece.columns:
                    values = piece.columns[name]
                    rows[name] = np.rint(np.nan_to_num(values) * 65535.0) if shares and name == "intensity" else values
            for name, (column, _) in further.items():
                rows[name] = _values(piece, column, rows[name])
            rows.tofile(file)


def _kind(column: Column | None, fixed: str, most: int) -> str:
    """The fixed type, or the one that holds the values."""
    if column is None or column.fits(0, most):
        return fixed
    if column.dtype.kind == "f":
        return "<f8" if column.dtype.itemsize > 4 else "<f4"
    return "<i2" if column.fits(-(2**15), 2**15 - 1) else "<i4" if column.fits(-(2**31), 2**31 - 1) else "<f8"


def _further(found: Survey, own: bool) -> dict[str, tuple[tuple[str, int | None], str]]:
    """Property -> ((column, element of its rows), type)."""
    made: dict[str, tuple[tuple[str, int | None], str]] = {}
    taken = {"x", "y", "z", "red", "green", "blue", "scan", *_FIXED}
    for name, column in found.columns.items():
        if name in _FIXED or (own and name == "scan"):
            continue
        kind = column.dtype.str[1:] if column.dtype.str[1:] in _NAMES else "f8" if column.dtype.kind == "f" else "i4"
        if column.dtype.kind in "iu" and column.dtype.itemsize > 4 and not column.fits(-(2**31), 2**31 - 1):
            kind = "f8"
        for element in range(column.width):
            plain = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in name) or "column"
            wanted = plain if column.width == 1 else f"{plain}_{element}"
            unique, number = wanted, 1
            while unique.lower() in taken:
                number += 1
                unique = f"{wanted}_{number}"
            taken.add(unique.lower())
            made[unique] = ((name, None if column.width == 1 else element), f"<{kind}" if kind[1:] != "1" else kind)
    return made


def _values(piece: Piece, column: tuple[str, int | None], otherwise: np.ndarray) -> np.ndarray:
    name, element = column
    if name not in piece.columns:
        return otherwise
    values = piece.columns[name]
    return values if element is None else values[:, element]


def _name_losses(found: Survey, own: bool, losses: Losses) -> None:
    left_out = [
        name
        for name, column in found.columns.items()
        if name not in (*_FIXED, *(("scan",) if own else ()))
        and column.low <= column.high
        and (column.low, column.high) != (_PLAIN.get(name, 0),) * 2
    ]
    if left_out:
        shown = ", ".join(left_out[:12]) + (f" and {len(left_out) - 12} more" if len(left_out) > 12 else "")
        losses.add(f"the PLY has no {shown} (--all-columns writes them)")
    if not found.exact8:
        losses.add("16-bit colours are cut to 8 bits (--all-columns keeps them)")


def _plain(text: str) -> str:
    return text.encode("ascii", "replace").decode().replace("\n", " ")
