"""Single numbers as compilers, spreadsheets and people of several languages write them.

The compiled parser (text_kernels) reads plain decimal numbers; what it does not know comes here, token by token.
"""

import re

_NAN = re.compile(r"[-+]?(?:[qs]?nan(?:[qs]|ind|0x[0-9a-f]+|\([^)]*\))?|\d[.,]?\d*#[a-z]*\d*|\*+)", re.IGNORECASE)
"""nan, -nan(ind), 1.#QNAN, -1.#IND, 1.#INF, NaNQ of C libraries; stars, where a number does not fit its Fortran field."""
_MISSING = {"-", "--", "na", "n/a", "#n/a", "null", "none", "#num!", "#value!", "#div/0!", "\\n"}
"""What databases and spreadsheets write where there is no number."""
_EXPONENT = re.compile(r"(?<=[\d.,])[dq](?=[-+]?\d+$)", re.IGNORECASE)  # Fortran's 1.5D+02
_NO_LETTER = re.compile(r"([-+]?\d*[.,]\d+)([-+]\d{2,3})")  # Fortran's 1.5+102, where the letter has no room
_SIGNS = str.maketrans({"\u2212": "-", "\u2013": "-", "\uff0d": "-", "\ufe63": "-", "\uff0b": "+", "\uff0e": ".",
                        "\u2019": "'", "\u00a0": " ", "\u202f": " ", "\u2009": " "})  # fmt: skip
_GROUPS = {
    ".": re.compile(r"[-+]?\d{1,3}(?:,\d{3})+(?:\.\d*)?"),
    ",": re.compile(r"[-+]?\d{1,3}(?:\.\d{3})+(?:,\d*)?"),
}
"""Thousands in groups by the decimal mark: 1,234.5 and 1.234,5."""
_POINT_GROUPS = re.compile(r"[-+]?\d{1,3}(?:(?:\.\d{3})+,\d+|(?:\.\d{3}){2,})")  # which only points between thousands explain
_SPACED = re.compile(r"[-+]?\d{1,3}(?:[ ']\d{3})+(?:[.,]\d*)?")  # 1 234,5 and 1'234.5
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:e[-+]?\d+)?", re.IGNORECASE)


def number(text: str, decimal: str = ".") -> float | None:
    """A token as a number, without quotes around it; NaN in any spelling, and where it says that there is none; None where it
    is not a number.  decimal: the mark before the fraction, "." or ",".  Thousands may be grouped by the other mark, by blanks
    or by apostrophes.
    """
    text = text.strip(" \t\r\"'")
    if decimal == ".":
        try:
            return float(text) if "_" not in text else None
        except ValueError:
            pass
    text = text.translate(_SIGNS).strip()
    if _NAN.fullmatch(text) or text.lower() in _MISSING:
        return float("nan")
    if _GROUPS[decimal].fullmatch(text):
        text = text.replace("," if decimal == "." else ".", "")
    elif _SPACED.fullmatch(text):
        text = text.replace(" ", "").replace("'", "")
        decimal = "," if "," in text else "."
    if decimal == ",":
        text = text.replace(",", ".", 1)
    text = _EXPONENT.sub("e", _NO_LETTER.sub(r"\1e\2", text))
    try:
        return float(text) if "_" not in text else None
    except ValueError:
        return None


def token_text(token: bytes) -> str:
    """A token of a file as text: UTF-8, or Latin-1 where it is not that."""
    try:
        return token.decode()
    except UnicodeDecodeError:
        return token.decode("latin-1")


def decimal_mark(words: list[str], delimiter: str) -> str:
    """The decimal mark of a file: "," or ".".  words: the fields of some of its rows.  delimiter: between them.

    A comma inside a field is a decimal comma, except where other numbers have points, or where it can group thousands in a
    file whose fields are separated by commas.
    """
    words = [word.strip("\"' \t\r") for word in words]
    if any(_POINT_GROUPS.fullmatch(word) for word in words):
        return ","
    commas = [word for word in words if DECIMAL_COMMA.fullmatch(word)]
    if not commas:
        return "."
    if all(_GROUPS["."].fullmatch(word) for word in commas):  # 1,234 may be either
        points = any(re.fullmatch(r"[-+]?[\d,]*\.\d+", word) for word in words)
        return "." if points or delimiter == "," else ","
    return ","
