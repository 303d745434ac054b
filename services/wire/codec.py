"""Encoding of messages: human-readable JSON or MessagePack, from one set of schemas.

An array is nested lists in JSON (null where there is no number) and ``{"shape": …, "data": …}`` in
MessagePack, data being little-endian float64 in C order; either reader takes both. The encoding
that travels with a payload names format, schema and major version:
``application/msgpack;slopewise.plan_request.v1``.
"""

from __future__ import annotations

import math
import re
from enum import Enum
from functools import cache
from typing import Any, TypeVar

import msgspec
import numpy as np

from slopewise.models.errors import InputError

T = TypeVar("T", bound=msgspec.Struct)

VERSION = 1  # major version of all schemas; it is in the keys, too
_MAX_AXES = 2  # of an array [1]: heights and columns have two
_MAX_ITEMS = 2**32  # along an axis [1]
_WHERE = re.compile(r"^(?P<what>.*?)(?: - at `\$\.?(?P<where>.*)`)?$", re.DOTALL)
_MISSING = re.compile(r"^Object missing required field `(?P<name>.*)`$")
_UNKNOWN = re.compile(r"^Object contains unknown field `(?P<name>.*)`$", re.DOTALL)
_CAPITAL = re.compile(r"(?<!^)(?=[A-Z])")


class Format(Enum):
    """How a payload is written; the value is the first part of its encoding."""

    JSON = "application/json"
    MESSAGEPACK = "application/msgpack"


def schema_of(kind: type[msgspec.Struct]) -> str:
    """Name (of the class, or its ``SCHEMA``) and version, e.g. ``slopewise.plan_request.v1``."""
    name = getattr(kind, "SCHEMA", _CAPITAL.sub("_", kind.__name__).lower())
    return f"slopewise.{name}.v{VERSION}"


def encoding_of(kind: type[msgspec.Struct], written: Format) -> str:
    """Encoding that is sent with a payload."""
    return f"{written.value};{schema_of(kind)}"


def format_of(encoding: str, default: Format = Format.MESSAGEPACK) -> Format:
    """Format that the encoding of a sender names, ``default`` where it names none."""
    return next((f for f in Format if encoding.startswith(f.value)), default)


def encode(message: msgspec.Struct, written: Format) -> bytes:
    """The payload of a message; its encoding is that of :func:`encoding_of`."""
    if written is Format.JSON:
        return msgspec.json.encode(message, enc_hook=_as_lists)
    return msgspec.msgpack.encode(message, enc_hook=_as_block)


def payload_of(message: msgspec.Struct, written: Format) -> dict[str, Any]:
    """Payload and encoding of a message, as zenoh takes them by name."""
    return {"payload": encode(message, written), "encoding": encoding_of(type(message), written)}


def decode(kind: type[T], payload: Any, encoding: str, source: str, max_bytes: int) -> T:
    """A message from a received payload, which is not copied if it is longer than ``max_bytes``.

    In JSON the encoding may omit the schema. Errors name ``source``, the key, and the field. No NaN
    passes in a single number; in arrays it does, because there it means something.
    """
    size = len(payload)
    if size > max_bytes:
        raise InputError(source, "", f"expected at most {max_bytes} bytes, got {size}")
    written, _, schema = encoding.partition(";")
    known, expected = [choice.value for choice in Format], schema_of(kind)
    if written not in known:
        got = f"expected {' or '.join(known)}, got {encoding[:80]!r}"
        raise InputError(source, "encoding", got)
    if schema != expected and (schema or written != Format.JSON.value):
        raise InputError(source, "encoding", f"expected schema {expected}, got {schema[:80]!r}")
    try:
        message: T = _decoder(kind, Format(written)).decode(bytes(payload))
    except msgspec.ValidationError as error:
        raise _fault(source, str(error)) from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        got = f"expected {expected} as {written}, got: {_line(str(error))}"
        raise InputError(source, "", got) from None
    _check_numbers(message, source, "")
    return message


@cache
def _decoder(kind: type[msgspec.Struct], written: Format) -> Any:
    if written is Format.JSON:
        return msgspec.json.Decoder(kind, dec_hook=_hook)
    return msgspec.msgpack.Decoder(kind, dec_hook=_hook)


def _hook(kind: type, value: Any) -> Any:
    if kind is np.ndarray:
        return _from_block(value) if isinstance(value, dict) else _from_lists(value)
    raise NotImplementedError(f"no wire form of {kind}")


def _from_block(value: dict[Any, Any]) -> np.ndarray:
    shape, data = value.get("shape"), value.get("data")
    if set(value) != {"shape", "data"} or not isinstance(data, bytes):
        raise ValueError("Expected an array as shape and binary data")
    if not isinstance(shape, list) or not (
        1 <= len(shape) <= _MAX_AXES and all(type(n) is int and 0 <= n <= _MAX_ITEMS for n in shape)
    ):
        raise ValueError(f"Expected a shape of 1 or {_MAX_AXES} whole numbers")
    if math.prod(shape) * 8 != len(data):
        size = " x ".join(str(n) for n in shape)
        raise ValueError(f"Expected {size} float64, got {len(data)} bytes")
    # Read-only, without a copy: the payload is not shared.
    return np.frombuffer(data, "<f8").reshape(shape)


def _from_lists(value: Any) -> np.ndarray:
    nested = isinstance(value, list) and bool(value) and isinstance(value[0], list)
    kind: Any = list[list[float | None]] if nested else list[float | None]
    try:
        rows = msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        what, where = _what_and_where(str(error))
        raise ValueError(f"{what} at {where}" if where else what) from None
    if nested and len({len(row) for row in rows}) > 1:
        raise ValueError("Expected rows of one length")
    return np.array(rows, np.float64)


def _as_block(value: Any) -> dict[str, Any]:
    array = _array(value)
    return {"shape": array.shape, "data": array.tobytes()}


def _as_lists(value: Any) -> Any:
    # JSON cannot represent NaN; the encoder writes null.
    return _array(value).tolist()


def _array(value: Any) -> np.ndarray:
    if not isinstance(value, np.ndarray):
        raise NotImplementedError(f"no wire form of {type(value)}")
    return np.ascontiguousarray(value, "<f8")


def _check_numbers(value: Any, source: str, where: str) -> None:
    """Reject NaN and infinity, which MessagePack allows; lists are checked by their users."""
    if isinstance(value, float):
        if not math.isfinite(value):
            raise InputError(source, where, f"expected a finite number, got {value}")
    elif isinstance(value, msgspec.Struct):
        for name in value.__struct_fields__:
            _check_numbers(getattr(value, name), source, f"{where}.{name}" if where else name)
    elif isinstance(value, tuple):
        for i, item in enumerate(value):
            _check_numbers(item, source, f"{where}[{i}]")


def _what_and_where(text: str) -> tuple[str, str]:
    fault = _WHERE.match(text)
    assert fault is not None
    return fault["what"], fault["where"] or ""


def _fault(source: str, text: str) -> InputError:
    """An error of msgspec as one that names source and field."""
    what, where = _what_and_where(text)
    for pattern, expected in (
        (_MISSING, "expected this field, got none"),
        (_UNKNOWN, "unknown field"),
    ):
        if named := pattern.match(what):
            name = _line(named["name"])[:80]
            return InputError(source, f"{where}.{name}" if where else name, expected)
    return InputError(source, _line(where), _line(what[:1].lower() + what[1:].replace("`", "")))


def _line(text: str) -> str:
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
