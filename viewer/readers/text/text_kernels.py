"""Compiled: parses rows of decimal numbers from bytes of text, correctly rounded, without a Python object per number.

Numbers of at most 19 digits with a power of ten from -22 to 22 are computed in double-double arithmetic (Dekker 1971): the
digits as a sum of two doubles, multiplied or divided by a power of ten, which is exact up to 10**22.  The relative error is
near 2**-104, so the result is rounded as by ``float`` (a test compares them).  Up to 2**53 one division suffices (Clinger
1990).  Other tokens (longer ones, larger exponents, nan) are left to Python: parse_rows returns their positions.
"""

import numpy as np

from ....model.common.jit import compiled

DIGITS = 19
"""Decimal digits that fit 64 bits."""
_POWERS = 10.0 ** np.arange(23)  # exact in a double
_EXACT = np.uint64(2**53)  # integers up to here are exact in a double
_SPLIT = 2.0**27 + 1  # splits a double's 53 bits in halves (Dekker)

DONE, FULL, OTHER_WIDTH, TOO_SLOW = range(4)
"""Why parse_rows ended: the text is read, the table is full, a line has another number of fields, no room in ``slow``."""

BLANK, LINE_END, DELIMITER = 1, 2, 3
"""Kinds of bytes, in order; 0: any other."""


def byte_kinds(delimiter: str) -> np.ndarray:
    """(256,) uint8: the kind of each byte.

    delimiter: between fields; blanks beside it are ignored, and an empty field is NaN.  "": fields are separated by blanks and
    tabs.
    """
    kinds = np.zeros(256, np.uint8)
    kinds[[32, 9, 13]] = BLANK
    kinds[10] = LINE_END
    if delimiter:
        kinds[ord(delimiter)] = DELIMITER
    return kinds


@compiled(nogil=True)
def _scaled(digits, power):
    """digits: uint64.  power: -22 to 22.  Returns ``digits * 10**power``, rounded once."""
    high = np.float64(digits)
    low = np.float64(np.int64(digits - np.uint64(high)))
    if power == 0:
        return high
    p = _POWERS[abs(power)]
    if digits <= _EXACT:
        return high / p if power < 0 else high * p
    a = high / p if power < 0 else high
    t = _SPLIT * a
    a1 = t - (t - a)
    a2 = a - a1
    t = _SPLIT * p
    p1 = t - (t - p)
    p2 = p - p1
    product = a * p
    error = ((a1 * p1 - product) + a1 * p2 + a2 * p1) + a2 * p2  # a * p is product + error, exactly
    if power < 0:
        return a + (((high - product) - error) + low) / p
    return product + (error + low * p)


@compiled(nogil=True)
def _token_end(text, i, kinds, delimited):
    """The position behind the field that begins at ``i``.  A field in double quotes may hold delimiters and blanks."""
    while text[i] == 34:
        j = i + 1
        while text[j] != 34 and text[j] != 10:
            j += 1
        if text[j] == 10:
            break
        i = j + 1
    if delimited:
        while kinds[text[i]] < LINE_END:
            i += 1
    else:
        while kinds[text[i]] == 0:
            i += 1
    return i


@compiled(nogil=True)
def parse_rows(text, start, stop, kinds, delimited, decimal, rest, target, table, slow):
    """Reads lines of ``text[start:stop]``, uint8, which ends with a newline.

    kinds: from :func:`byte_kinds`.  delimited: whether there is a delimiter.  decimal: the byte before a fraction.
    rest: the last field, which must not be wanted, ends with its line.
    target: (fields a line,) int64, the column of ``table`` that a field is written to, -1 for none.
    table: (rows, columns) float64, filled.  slow: (m, 4) int64, filled: row, column, begin and end of tokens left to Python.
    Blank lines and lines that begin with # or // are skipped.
    Returns rows read, position after the last of them, tokens in ``slow``, why it ended, lines passed, fields of the next line.
    """
    width, rows, slows, lines, i = len(target), 0, 0, 0, start
    while i < stop:
        line = i
        while kinds[text[i]] == BLANK:
            i += 1
        if text[i] == 10:
            i += 1
            lines += 1
            continue
        if text[i] == 35 or (text[i] == 47 and text[i + 1] == 47):
            while text[i] != 10:
                i += 1
            i += 1
            lines += 1
            continue
        if rows == len(table):
            return rows, line, slows, FULL, lines, 0
        if slows + width > len(slow):
            return rows, line, slows, TOO_SLOW, lines, 0
        field, kept = 0, slows
        while True:
            column = target[field] if field < width else -1
            if delimited and kinds[text[i]] >= LINE_END:  # nothing
                if column >= 0:
                    table[rows, column] = np.nan
            elif column < 0:
                if rest and field == width - 1:
                    while text[i] != 10:
                        i += 1
                else:
                    i = _token_end(text, i, kinds, delimited)
            else:
                begin = i
                negative = text[i] == 45
                if negative or text[i] == 43:
                    i += 1
                digits, count, power, seen = np.uint64(0), 0, 0, False
                while 48 <= text[i] <= 57:
                    digits = digits * np.uint64(10) + np.uint64(text[i] - 48)
                    count += 1 if digits != 0 else 0
                    seen = True
                    i += 1
                if text[i] == decimal:
                    i += 1
                    while 48 <= text[i] <= 57:
                        digits = digits * np.uint64(10) + np.uint64(text[i] - 48)
                        count += 1 if digits != 0 else 0
                        power -= 1
                        seen = True
                        i += 1
                if seen and text[i] > 57 and (text[i] | 32 == 101 or text[i] | 32 == 100):  # e, or Fortran's d
                    i += 1
                    minus = text[i] == 45
                    if minus or text[i] == 43:
                        i += 1
                    exponent, seen = 0, False
                    while 48 <= text[i] <= 57:
                        exponent = min(exponent * 10 + (text[i] - 48), 9999)
                        seen = True
                        i += 1
                    power += -exponent if minus else exponent
                ended = kinds[text[i]]
                if ended == BLANK and delimited:  # blanks inside a field: 1 234
                    j = i
                    while kinds[text[j]] == BLANK:
                        j += 1
                    ended = kinds[text[j]]
                if ended != 0 and seen and count <= DIGITS and (digits == 0 or -22 <= power <= 22):
                    value = 0.0 if digits == 0 else _scaled(digits, power)
                    table[rows, column] = -value if negative else value
                else:
                    i = _token_end(text, begin, kinds, delimited)
                    slow[slows, 0], slow[slows, 1], slow[slows, 2], slow[slows, 3] = rows, column, begin, i
                    slows += 1
            field += 1
            while kinds[text[i]] == BLANK:
                i += 1
            if kinds[text[i]] == DELIMITER:
                i += 1
                while kinds[text[i]] == BLANK:
                    i += 1
                if text[i] == 10 and field >= width:  # a delimiter that ends the line
                    break
            elif text[i] == 10:
                break
        if field != width:
            return rows, line, kept, OTHER_WIDTH, lines, field
        i += 1
        lines += 1
        rows += 1
    return rows, i, slows, DONE, lines, 0


@compiled(nogil=True)
def skip_rows(text, start, stop, most):
    """Skips up to ``most`` rows without parsing them.

    Returns rows skipped, position after the last, lines skipped including blank lines and comments.
    """
    rows, lines, i = 0, 0, start
    while i < stop and rows < most:
        while text[i] == 32 or text[i] == 9 or text[i] == 13:
            i += 1
        if not (text[i] == 10 or text[i] == 35 or (text[i] == 47 and text[i + 1] == 47)):
            rows += 1
        while text[i] != 10:
            i += 1
        i += 1
        lines += 1
    return rows, i, lines
