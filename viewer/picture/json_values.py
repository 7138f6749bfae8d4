"""Values as JSON has them: frozen dataclasses of numbers, texts, tuples and each other, in projects and pictures.

The keys of an object are the fields of its dataclass; clips carry their ``type``.  Numbers keep all 17 digits: reading gives
the same values.
"""

import dataclasses
import json
import types
import typing

from ..common.errors import InputError
from .clip import Box, Slab

_TYPES: dict[str, type] = {"Box": Box, "Slab": Slab}
"""Classes of which a field may hold either; their name is stored beside their fields."""


def to_json(value):
    """A dataclass, tuple, number, text or None as JSON has it."""
    if dataclasses.is_dataclass(value):
        out = {"type": type(value).__name__} if type(value).__name__ in _TYPES else {}
        return out | {f.name: to_json(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, tuple):
        return [to_json(item) for item in value]
    return value


def from_json(kind, data, where: str) -> typing.Any:
    """A value of a type hint from JSON.  Raises InputError naming ``where`` in the file and what was expected."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        if data is None and type(None) in parts:
            return None
        options = [part for part in parts if part is not type(None)]
        if len(options) > 1:
            name = data.get("type") if isinstance(data, dict) else None
            chosen = _TYPES.get(name) if isinstance(name, str) else None
            if chosen not in options or not isinstance(data, dict):
                raise InputError(f"{where}.type {name!r}: expected one of {', '.join(part.__name__ for part in options)}")
            return from_json(chosen, {key: item for key, item in data.items() if key != "type"}, where)
        return from_json(options[0], data, where)
    if origin is tuple:
        if not isinstance(data, list):
            raise InputError(f"{where}: {_shown(data)}: expected a list")
        if len(parts) == 2 and parts[1] is Ellipsis:
            return tuple(from_json(parts[0], item, f"{where}[{i}]") for i, item in enumerate(data))
        if len(data) != len(parts):
            raise InputError(f"{where}: {len(data)} values: expected {len(parts)}")
        return tuple(from_json(part, item, f"{where}[{i}]") for i, (part, item) in enumerate(zip(parts, data)))
    if dataclasses.is_dataclass(kind):
        return _record(kind, data, where)
    if kind is float and isinstance(data, (int, float)) and not isinstance(data, bool):
        value = float(data) if abs(data) < 1e300 else float("inf")  # JSON allows integers of any length, and Infinity
        if value - value == 0.0:
            return value
    elif type(data) is kind:
        return data
    named = {float: "a finite number", int: "a whole number", str: "a text", bool: "true or false"}
    raise InputError(f"{where}: {_shown(data)}: expected {named.get(kind, kind)}")


def _record(kind, data, where: str):
    """An object of a dataclass; fields that are missing take their default, unknown ones are refused."""
    if not isinstance(data, dict):
        raise InputError(f"{where}: {_shown(data)}: expected an object")
    hints, fields = typing.get_type_hints(kind), {f.name: f for f in dataclasses.fields(kind)}
    for key in data:
        if key not in fields:
            raise InputError(f"{where}.{key}: unknown; expected {', '.join(fields)}")
    for name, item in fields.items():
        if name not in data and item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING:
            raise InputError(f"{where}.{name} is missing")
    values = {key: from_json(hints[key], item, f"{where}.{key}") for key, item in data.items()}
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _shown(data) -> str:
    """A JSON value in a message, not longer than a person reads."""
    text = json.dumps(data)
    return text if len(text) <= 40 else f"{text[:37]}..."
