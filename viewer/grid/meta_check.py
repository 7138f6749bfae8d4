"""Checks the description of the scan in a grid's meta.json (``Scene.meta``), whose values are used everywhere without checks.

A grid may come from a stranger: its checksum proves nothing about who wrote it.
"""

import math
from collections.abc import Callable
from typing import Any

Check = Callable[[Any], bool]


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool)


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 62


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300 and math.isfinite(value)


def _is_factor(value: Any) -> bool:
    return _is_number(value) and value > 0


def _maybe(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _list_of(check: Check, length: int | None = None) -> Check:
    return lambda value: isinstance(value, list) and length in (None, len(value)) and all(map(check, value))


def _with(**checks: Check) -> Check:
    """An object whose values under these names, where they are there, pass."""
    return lambda value: isinstance(value, dict) and all(check(value[name]) for name, check in checks.items() if name in value)


def _scan(value: Any) -> bool:
    return isinstance(value, dict) and {"name", "count", "position"} <= value.keys() and _SCAN(value)


def _file(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and _is_text(value[0]) and _is_count(value[1]) and _is_count(value[2])


def _turns(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_list_of(_is_count), value.values()))


def _exposures(value: Any) -> bool:
    gains = {"smallest_gain": _is_number, "largest_gain": _is_number}
    return _with(stations=_is_count, matched=_is_count, applied=_is_flag, **gains)(value)


def _passes(value: Any) -> bool:
    return isinstance(value, dict) and _is_flag(value.get("applied")) and _is_number(value.get("variance_left"))


_SCAN = _with(name=_is_text, count=_is_count, position=_maybe(_list_of(_is_number, 3)), inferred=_is_flag)
_CHECKS: dict[str, Check] = {
    "sources": _list_of(_is_text), "format": _maybe(_is_text), "units": _is_text, "metres_per_unit": _maybe(_is_factor),
    "crs": _maybe(_is_text), "match": _is_flag, "warnings": _list_of(_is_text), "scans": _list_of(_scan),
    "colour": _maybe(_with(source=_is_text, bits=_is_count, note=_is_text, uncoloured=_is_number)),
    "exposures": _maybe(_exposures), "passes": _maybe(_passes), "attributes": lambda value: isinstance(value, dict),
    "dropped": _with(nan=_is_count, invalid=_is_count, stray=_is_count),
    "records": _maybe(_with(first=_maybe(_list_of(_is_count)), scan_first=_maybe(_list_of(_is_count)),
                            scans=_list_of(_is_count), turns=_turns, files=_maybe(_list_of(_file)), columns=_maybe(_is_text))),
}  # fmt: skip


def check_meta(meta: dict[str, Any]) -> None:
    """Raises ValueError naming the first entry that is not of its kind.  Entries that are missing or unknown pass."""
    for name, check in _CHECKS.items():
        if name in meta and not check(meta[name]):
            raise ValueError(f"its {name!r} is not what such a description has")
