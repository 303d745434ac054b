"""Facts about a message that are needed before its turn: sender, size and deadline."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.wire import codec

_MAX_BYTES = 200_000  # payload whose header is read [bytes]: takes some 0.1 ms in zenoh's thread
_MAX_NAME = 120  # length to which names are cut [1]; longer ones are rejected by the schema anyway


class RequestHeader(NamedTuple):
    """Header of a plan request."""

    client: str = ""  # "" where it cannot be read without decoding the whole
    candidates: int = 0  # number of candidates, 0 where it cannot be read
    size: int = 0  # payload [bytes]


class _PlanHeader(msgspec.Struct):
    client: str = ""
    paths: list[msgspec.Raw] = []


class _Sender(msgspec.Struct):
    source: str = ""


_UNREADABLE = (msgspec.MsgspecError, RecursionError, UnicodeDecodeError)
_JSON = msgspec.json.Decoder(_PlanHeader)
_MESSAGEPACK = msgspec.msgpack.Decoder(_PlanHeader)


def read_header(query: zenoh.Query) -> RequestHeader:
    """Header of a plan request; an unreadable one has no client."""
    payload = query.payload
    size = 0 if payload is None else len(payload)
    if payload is None or not 0 < size <= _MAX_BYTES:
        return RequestHeader(size=size)
    is_json = codec.format_of(str(query.encoding or "")) is codec.Format.JSON
    try:
        header = (_JSON if is_json else _MESSAGEPACK).decode(bytes(payload))
    except _UNREADABLE:
        return RequestHeader(size=size)
    return RequestHeader(header.client[:_MAX_NAME], len(header.paths), size)


def read_source(payload: zenoh.ZBytes | bytes, encoding: str) -> str:
    """Sender of a message, also of one that is not usable as a whole; "" if it cannot be read."""
    is_json = codec.format_of(encoding) is codec.Format.JSON
    decode = msgspec.json.decode if is_json else msgspec.msgpack.decode
    try:
        source = decode(bytes(payload), type=_Sender).source[:_MAX_NAME]
    except _UNREADABLE:
        return ""
    return source if source.isprintable() else ""


def read_deadline(query: zenoh.Query, key: str) -> float | None:
    """Deadline of a request [s]; None without. An InputError names ``key``."""
    text = query.parameters.get("deadline")
    if not text:
        return None
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0.0 < seconds < math.inf:
        expected = f"expected a finite number of seconds > 0, got {text[:80]!r}"
        raise InputError(key, "deadline", expected)
    return seconds
