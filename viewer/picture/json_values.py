"""Values as JSON has them: frozen dataclasses of numbers, texts, tuples and each other, in projects, pictures and grids.

The keys of an object are the fields of its dataclass; clips carry their ``type``.  Numbers keep all 17 digits: reading gives
the same values.  A subclass of :class:`OwnJson` is written and read by its own methods.
"""

import dataclasses
import functools
import json
import types
import typing

from ..common.errors import InputError
from .clip import Box, Slab

UNLESS_DEFAULT = {"unless_default": True}
"""Metadata of a field that is left out where it has its default."""
NOT_STORED = {"not_stored": True}
"""Metadata of a field that is neither written nor read."""

_TYPES: dict[str, type] = {"Box": Box, "Slab": Slab}
"""Classes of which a field may hold either; their name is stored beside their fields."""


class OwnJson:
    """Base of a class whose JSON is not an object of its fields."""

    def to_json(self) -> typing.Any:
        """The value as JSON has it."""
        raise NotImplementedError

    @classmethod
    def from_json(cls, data: typing.Any, where: str) -> typing.Self:
        """The value of checked JSON.  Raises InputError naming ``where`` in the file and what was expected."""
        raise NotImplementedError


@dataclasses.dataclass(frozen=True)
class Within:
    """A limit of a number, in an Annotated type.  more_than: the number is larger.  less_than: it is smaller.  words: what is
    expected."""

    more_than: float
    less_than: float
    words: str


Count = typing.Annotated[int, Within(-1, 1 << 62, "a whole number of at least 0")]
Factor = typing.Annotated[float, Within(0.0, float("inf"), "a finite number above 0")]


def to_json(value):
    """A dataclass, tuple, number, text, dictionary or None as JSON has it."""
    if isinstance(value, OwnJson):
        return value.to_json()
    if dataclasses.is_dataclass(value):
        out = {"type": type(value).__name__} if type(value).__name__ in _TYPES else {}
        return out | {f.name: to_json(getattr(value, f.name)) for f in dataclasses.fields(value) if _is_written(f, value)}
    if isinstance(value, tuple):
        return [to_json(item) for item in value]
    if isinstance(value, dict):
        return {str(key): to_json(item) for key, item in value.items()}
    return value


def _is_written(field: dataclasses.Field, value) -> bool:
    if "unless_default" in field.metadata:
        return getattr(value, field.name) != field.default
    return "not_stored" not in field.metadata


_PLAIN = (str, int, bool)
"""Types that need no conversion: most values of a grid's header, of which a place has a thousand."""


@functools.cache
def _parts_of(kind) -> tuple[typing.Any, tuple[typing.Any, ...]]:
    return typing.get_origin(kind), typing.get_args(kind)


def from_json(kind, data, where: str, *, strict: bool = True) -> typing.Any:
    """A value of a type hint from JSON.  strict: refuse keys that are no field; otherwise they are ignored.

    Raises InputError naming ``where`` in the file and what was expected."""
    if type(data) is kind and kind in _PLAIN:
        return data
    origin, parts = _parts_of(kind)
    if origin is typing.Annotated:
        value = from_json(parts[0], data, where, strict=strict)
        for limit in parts[1:]:
            if not limit.more_than < value < limit.less_than:
                raise InputError(f"{where}: {_shown(data)}: expected {limit.words}")
        return value
    if origin in (typing.Union, types.UnionType):
        if data is None and type(None) in parts:
            return None
        options = [part for part in parts if part is not type(None)]
        if len(options) > 1:
            name = data.get("type") if isinstance(data, dict) else None
            chosen = _TYPES.get(name) if isinstance(name, str) else None
            if chosen not in options or not isinstance(data, dict):
                raise InputError(f"{where}.type {name!r}: expected one of {', '.join(part.__name__ for part in options)}")
            return from_json(chosen, {key: item for key, item in data.items() if key != "type"}, where,
                             strict=strict)
        return from_json(options[0], data, where, strict=strict)
    if origin is tuple:
        if not isinstance(data, list):
            raise InputError(f"{where}: {_shown(data)}: expected a list")
        if len(parts) == 2 and parts[1] is Ellipsis:
            return tuple(from_json(parts[0], item, f"{where}[{i}]", strict=strict) for i, item in enumerate(data))
        if len(data) != len(parts):
            raise InputError(f"{where}: {len(data)} values: expected {len(parts)}")
        return tuple(from_json(part, item, f"{where}[{i}]", strict=strict) for i, (part, item) in enumerate(zip(parts, data)))
    if origin is dict:
        return _dictionary(parts, data, where, strict)
    if isinstance(kind, type) and issubclass(kind, OwnJson):
        return kind.from_json(data, where)
    if dataclasses.is_dataclass(kind):
        return _record(kind, data, where, strict)
    if kind is float and isinstance(data, (int, float)) and not isinstance(data, bool):
        value = float(data) if abs(data) < 1e300 else float("inf")  # JSON allows integers of any length, and Infinity
        if value - value == 0.0:
            return value
    elif type(data) is kind:
        return data
    named = {float: "a finite number", int: "a whole number", str: "a text", bool: "true or false"}
    raise InputError(f"{where}: {_shown(data)}: expected {named.get(kind, kind)}")


def _dictionary(parts, data, where: str, strict: bool) -> dict:
    """A dictionary of whole numbers or texts -> values; JSON has its keys as texts.  parts: type of its keys and values."""
    if not isinstance(data, dict):
        raise InputError(f"{where}: {_shown(data)}: expected an object")
    found = {}
    for key, item in data.items():
        if parts[0] is not str and not (key.isascii() and key.isdigit() and len(key) < 19):
            raise InputError(f"{where}: {_shown(key)}: expected a whole number as its key")
        found[parts[0](key)] = from_json(parts[1], item, f"{where}.{key}", strict=strict)
    return found


@functools.cache
def _stored_fields(kind: type) -> "dict[str, tuple[typing.Any, bool]]":
    """name -> (type hint, whether it has a default) of the fields of a dataclass that are stored."""
    hints, missing = typing.get_type_hints(kind, include_extras=True), dataclasses.MISSING
    return {f.name: (hints[f.name], f.default is not missing or f.default_factory is not missing)
            for f in dataclasses.fields(kind) if "not_stored" not in f.metadata}  # type: ignore[arg-type]


def _record(kind, data, where: str, strict: bool):
    """An object of a dataclass; fields that are missing take their default, unknown ones are refused or ignored."""
    if not isinstance(data, dict):
        raise InputError(f"{where}: {_shown(data)}: expected an object")
    fields = _stored_fields(kind)
    for key in data:
        if strict and key not in fields:
            raise InputError(f"{where}.{key}: unknown; expected {', '.join(fields)}")
    for name, (_, has_default) in fields.items():
        if name not in data and not has_default:
            raise InputError(f"{where}.{name} is missing")
    values = {key: from_json(fields[key][0], item, f"{where}.{key}", strict=strict)
              for key, item in data.items() if key in fields}
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _shown(data) -> str:
    """A JSON value in a message, not longer than a person reads."""
    text = json.dumps(data)
    return text if len(text) <= 40 else f"{text[:37]}..."
