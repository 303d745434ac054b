"""What has to be known of a question before its turn: who asks, how much, and until when."""

from __future__ import annotations

import math

import msgspec
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.wire import codec

_LARGEST = 200_000
_LONGEST_NAME = 120


class _Asking(msgspec.Struct):
    """All of a question that counts before it is decoded."""

    client: str = ""


class _Sent(msgspec.Struct):
    """Sender of a message that cannot be used."""

    source: str = ""


_JSON = msgspec.json.Decoder(_Asking)
_MESSAGEPACK = msgspec.msgpack.Decoder(_Asking)


def asking(query: zenoh.Query) -> tuple[str, int]:
    """Name of the client, "" where it cannot be told at a glance, and the size [bytes]."""
    payload = query.payload
    size = 0 if payload is None else len(payload)
    if payload is None or not 0 < size <= _LARGEST:
        return "", size
    json = codec.format_of(str(query.encoding or "")) is codec.Format.JSON
    try:
        found = (_JSON if json else _MESSAGEPACK).decode(bytes(payload))
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return "", size
    return found.client[:_LONGEST_NAME], size


def source_of(payload: bytes, encoding: str) -> str:
    """Sender of a message that cannot be used as a whole, "" if it cannot be read."""
    json = codec.format_of(encoding) is codec.Format.JSON
    decode = msgspec.json.decode if json else msgspec.msgpack.decode
    try:
        source = decode(payload, type=_Sent).source[:_LONGEST_NAME]
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return ""
    return source if source.isprintable() else ""


def deadline(query: zenoh.Query, source: str) -> float | None:
    """The deadline that a question names [s]; None without.

    Raises:
        InputError: it is no number of seconds above 0. ``source``: the key, for the error.
    """
    text = query.parameters.get("deadline")
    if not text:
        return None
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0.0 < seconds < math.inf:
        words = f"expected a finite number of seconds > 0, got {text[:80]!r}"
        raise InputError(source, "deadline", words)
    return seconds
