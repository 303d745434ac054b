"""Encoding of messages: human-readable JSON or MessagePack, from one set of schemas.

An array is nested lists in JSON (null where there is no number) and ``{"shape": …, "data": …}`` in
MessagePack, data being little-endian float64 in C order; either reader takes both. The encoding
that travels with a payload names format, schema and major version:
``application/msgpack;slopewise.plan_request.v1``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from enum import Enum
from functools import cache, lru_cache, partial
from typing import Annotated, Any, TypeVar, get_args, get_origin

import msgspec
import numpy as np
from msgspec import Meta

from slopewise.models.errors import InputError
from slopewise.services.io.files import one_line

T = TypeVar("T", bound=msgspec.Struct)

VERSION = 1  # major version of all schemas; it is in the keys, too
_NULLS = (b"null", b"\xc0")  # in JSON and MessagePack
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


def decode(
    kind: type[T],
    payload: Any,
    encoding: str,
    source: str,
    max_bytes: int,
    check: Callable[[T], None] = lambda message: None,
) -> T:
    """A message from a received payload, which is not copied if it is longer than ``max_bytes``.

    In JSON the encoding may omit the schema. Errors name ``source``, the key, and the field. No NaN
    passes in a single number; in arrays it does, because there it means something. ``check`` is
    called before arrays are decoded, with a message that has bytes for them.
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
    arrays = _ArrayReader(written, max_bytes)
    try:
        undecoded = _decoder(_undecoded(kind), written).decode(bytes(payload))
        _check_numbers(undecoded, source, "")
        check(undecoded)
        return msgspec.convert(undecoded, kind, from_attributes=True, dec_hook=arrays.read)
    except msgspec.ValidationError as error:
        raise _fault(source, str(error)) from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        got = f"expected {expected} as {written}, got: {one_line(str(error))}"
        raise InputError(source, "", got) from None


class _Block(msgspec.Struct, forbid_unknown_fields=True):
    """Array as binary data; heights and columns have two axes."""

    shape: Annotated[list[Annotated[int, Meta(ge=0, le=2**32)]], Meta(min_length=1, max_length=2)]
    data: bytes


def _new_decoder(kind: Any, written: str) -> Any:
    return (msgspec.json if written == Format.JSON.value else msgspec.msgpack).Decoder(kind)


_decoder = cache(_new_decoder)


@lru_cache(maxsize=64)
def _array_decoder(columns: int, written: str) -> Any:
    row: Any = Annotated[list[float | None], Meta(max_length=columns)]
    return _new_decoder(_Block | list[row | float | None], written)


@cache
def _undecoded(kind: Any) -> Any:
    """The type with each array left as bytes: as objects, a million empty lists take seconds."""
    if kind in (np.ndarray, np.ndarray | None):
        return msgspec.Raw
    if get_origin(kind) is list:
        return list[_undecoded(*get_args(kind))]  # type: ignore[misc]
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct)):
        return kind
    fields: list[Any] = [
        (f.name, inner) if f.required else (f.name, inner, None if f.default is None else [])
        for f in msgspec.structs.fields(kind)
        if (inner := _undecoded(f.type)) != f.type
    ]
    optional = [name for name, inner, *default in fields if inner is msgspec.Raw and default]

    def read_nulls(message: msgspec.Struct) -> None:
        for name in optional:
            value = getattr(message, name)
            if value is not None and bytes(value) in _NULLS:
                msgspec.structs.force_setattr(message, name, None)

    methods = {"__post_init__": read_nulls} if optional else {}
    undecoded = partial(msgspec.defstruct, kind.__name__, fields, bases=(kind,), namespace=methods)
    return undecoded(gc=False) if fields else kind


class _ArrayReader:
    """Reads the arrays of one message; as lists they have no more numbers than as binary data."""

    def __init__(self, written: str, max_bytes: int) -> None:
        self._written, self._max, self._left = written, max_bytes, max_bytes

    def read(self, _: type, raw: msgspec.Raw) -> np.ndarray:
        data = bytes(raw)
        if self._written == Format.JSON.value:
            rows, count, columns = data.count(b"["), data.count(b",") + 1, 2**32
        else:
            rows, start = _list_head(data, 0)
            columns, _end = _list_head(data, start)
            count = rows * max(columns, 1)
        self._left -= max(8 * count, 16 * rows)
        if self._left < 0:
            raise ValueError(f"Expected lists of at most {self._max // 8} numbers in all")
        try:
            value = _array_decoder(columns, self._written).decode(data)
        except msgspec.ValidationError as error:
            what, where = _what_and_where(str(error))
            raise ValueError(f"{what} at {where}" if where else what) from None
        if isinstance(value, _Block):
            if math.prod(value.shape) * 8 != len(value.data):
                size = " x ".join(str(n) for n in value.shape)
                raise ValueError(f"Expected {size} float64, got {len(value.data)} bytes")
            return np.frombuffer(value.data, "<f8").reshape(value.shape)  # read-only
        if len({len(row) if isinstance(row, list) else -1 for row in value}) > 1:
            raise ValueError("Expected rows of one length")
        return np.array(value, np.float64)


def _list_head(data: bytes, at: int) -> tuple[int, int]:
    """Items of a list in MessagePack and where the first stands; 0 items of anything else."""
    first = data[at] if at < len(data) else 0
    if 0x90 <= first <= 0x9F:
        return first - 0x90, at + 1
    end = at + {0xDC: 3, 0xDD: 5}.get(first, 1)
    return int.from_bytes(data[at + 1 : end], "big"), end


def _as_block(value: Any) -> Any:
    array = _array(value)
    return {"shape": array.shape, "data": array.tobytes()} if array.ndim else array.item()


def _as_lists(value: Any) -> Any:
    # JSON cannot represent NaN; the encoder writes null.
    return _array(value).tolist()


def _array(value: Any) -> np.ndarray:
    """Numbers as float64; numpy's integers and booleans as those of Python, without axes."""
    if isinstance(value, np.integer | np.bool_):
        return np.array(value.item(), object)
    if not isinstance(value, np.ndarray | np.floating):
        raise NotImplementedError(f"no wire form of {type(value)}")
    return np.asarray(value, "<f8", order="C")


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
            name = one_line(named["name"])[:80]
            return InputError(source, f"{where}.{name}" if where else name, expected)
    expected = what[:1].lower() + what[1:].replace("`", "")
    return InputError(source, one_line(where), one_line(expected))
