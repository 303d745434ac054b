"""Tables of TOML files to frozen dataclasses and back; each mistake is named by its dotted key.

The dataclasses are the format: their fields are the keys, the types of fields the types of values,
a default makes a key optional. A whole number is accepted for a float, nothing else is converted.
"""

from __future__ import annotations

import dataclasses
import difflib
import json
import re
from collections.abc import Collection, Mapping
from types import MappingProxyType, NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from slopewise.models.quantity import describe_range
from slopewise.services.io.files import fault, faults_of, shown

T = TypeVar("T")

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_NO_METADATA: Mapping[str, Any] = MappingProxyType({})
_LISTED = {float: "numbers", str: "texts"}
_NOUNS = {float: "a number", int: "a whole number", bool: "true or false", str: "text"}

_MAX_INT = 2**63
"""TOML's integers have 64 bits; Python's reader accepts longer ones, which no float can hold."""


def dotted(where: str, key: str) -> str:
    """The path of a key inside a table; keys that need quotes get them."""
    name = key if _BARE_KEY.fullmatch(key) else json.dumps(key, ensure_ascii=False)
    return f"{where}.{name}" if where else name


def unknown(key: str, known: Collection[str]) -> str:
    """Error message of an unknown key."""
    close = difflib.get_close_matches(key, list(known), n=1)
    hint = f"did you mean {close[0]}?" if close else f"expected one of {', '.join(known)}"
    return f"unknown key, {hint}"


def encode_table(record: Any) -> dict[str, Any]:
    """Tables of plain values of a dataclass, without absent or empty ones."""
    table = {}
    for field in dataclasses.fields(record):
        item = getattr(record, field.name)
        optional = not (field.default is field.default_factory is dataclasses.MISSING)
        # An empty name has a meaning where the default is None.
        empty = isinstance(item, str | tuple | Mapping) and not item
        empty = empty and not (isinstance(item, str) and field.default is None)
        if not (item is None or (optional and empty)):
            table[field.name] = _encode(item)
    return table


def _encode(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return encode_table(value)
    if isinstance(value, Mapping):
        return {str(key): _encode(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_encode(item) for item in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, float):
        return float(value)  # numpy's float64 is one, too
    return value


def decode_table(kind: type[T], data: object, source: str, where: str = "") -> T:
    """A dataclass from a table, as a TOML or JSON reader gives it, at a dotted path of the file."""
    if not isinstance(data, Mapping):
        raise fault(source, where, f"expected a table, got {shown(data)}")
    fields = {field.name: field for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    hints = get_type_hints(kind)
    for key in data:
        if key in fields:
            continue
        if (missing := _missing_name(data, fields)) is None:
            raise fault(source, dotted(where, str(key)), unknown(str(key), fields))
        # The name decides which keys a table may have.
        raise fault(source, dotted(where, "name"), missing)
    values: dict[str, Any] = {}
    for name, field in fields.items():
        path = dotted(where, name)
        if name in data:
            values[name] = _decode(hints[name], data[name], source, path, field.metadata)
        elif field.default is field.default_factory is dataclasses.MISSING:
            expected = _describe(hints[name], field.metadata)
            raise fault(source, path, f"missing key, expected {expected}")
    with faults_of(source, f"{where}." if where else ""):
        return kind(**values)


def _missing_name(
    data: Mapping[Any, Any], fields: Mapping[str, dataclasses.Field[Any]]
) -> str | None:
    """Error message of a required name that is missing; None if it is not required or is given."""
    name = fields.get("name")
    if name is None or "name" in data or name.default is not dataclasses.MISSING:
        return None
    if any(difflib.get_close_matches(str(key), ["name"], n=1) for key in data):
        return None
    return "missing key, expected text"


def _decode(
    kind: Any, value: object, source: str, where: str, metadata: Mapping[str, Any] = _NO_METADATA
) -> Any:
    kind = _choice(kind, value)
    origin, arguments = get_origin(kind), get_args(kind)
    if dataclasses.is_dataclass(kind):
        return decode_table(cast(type[Any], kind), value, source, where)
    if origin in (dict, MappingProxyType) and isinstance(value, Mapping):
        return {
            str(key): _decode(arguments[1], item, source, dotted(where, str(key)))
            for key, item in value.items()
        }
    if origin is tuple and isinstance(value, list | tuple):
        return _decode_list(kind, value, source, where)
    if origin is Literal and value in arguments:
        return value
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            raise fault(source, where, "expected a finite number, got a huge one") from None
    if kind in (str, bool, NoneType) and isinstance(value, kind):
        return value
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        if abs(value) >= _MAX_INT:
            raise fault(source, where, f"expected {_describe(int, metadata)}, got a huge one")
        return value
    raise fault(source, where, f"expected {_describe(kind, metadata)}, got {shown(value)}")


def _decode_list(
    kind: Any, value: list[Any] | tuple[Any, ...], source: str, where: str
) -> tuple[Any, ...]:
    arguments = get_args(kind)
    variadic = arguments[-1] is Ellipsis
    # A list of tables or texts may be empty: a matrix, or a row of one, without numbers may not.
    empty = not value and arguments[0] is not str and not dataclasses.is_dataclass(arguments[0])
    if empty or (not variadic and len(value) != len(arguments)):
        raise fault(source, where, f"expected {_describe(kind)}, got {shown(value)}")
    kinds = [arguments[0]] * len(value) if variadic else arguments
    return tuple(
        _decode(item_kind, item, source, f"{where}[{index}]")
        for index, (item_kind, item) in enumerate(zip(kinds, value, strict=True))
    )


def _choice(kind: Any, value: object) -> Any:
    """The one member of a union that a file may hold: unions here are optional, or two mappings."""
    if get_origin(kind) not in (Union, UnionType):
        return kind
    if value is None and NoneType in get_args(kind):
        return NoneType
    return next(member for member in get_args(kind) if member is not NoneType)


def _describe(kind: Any, metadata: Mapping[str, Any] = _NO_METADATA) -> str:
    """Type and range of a key, as an error message gives them."""
    if "unit" in metadata:
        return describe_range(metadata)
    kind = _choice(kind, ...)
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Literal:
        return f"one of {', '.join(repr(choice) for choice in arguments)}"
    if origin is tuple:
        if arguments[-1] is not Ellipsis:
            return f"a list of {len(arguments)} numbers"
        inner = "rows of numbers" if get_origin(arguments[0]) is tuple else "tables"
        return f"a list of {_LISTED.get(arguments[0], inner)}"
    return _NOUNS.get(kind, "a table")
