"""Facts about a message that are needed before its turn: sender, size and deadline."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.wire import codec

_MAX_NAME = 120  # length to which names are cut [1]; longer ones are rejected by the schema anyway


class MessageHeader(msgspec.Struct):
    """Part of a message that is read without decoding the rest."""

    client: str = ""  # of a plan request
    source: str = ""  # of a map or an observation
    paths: list[msgspec.Raw] = []  # of a plan request, not decoded


_DECODERS: dict[codec.Format, Any] = {
    codec.Format.JSON: msgspec.json.Decoder(MessageHeader),
    codec.Format.MESSAGEPACK: msgspec.msgpack.Decoder(MessageHeader),
}


def read_header(
    payload: zenoh.ZBytes | bytes, encoding: str, max_bytes: float = math.inf
) -> MessageHeader:
    """Header of a message, also of one that is not usable as a whole.

    Empty if it cannot be read, or is longer than ``max_bytes``; names can be shown.
    """
    if len(payload) > max_bytes:
        return MessageHeader()
    try:
        header: MessageHeader = _DECODERS[codec.format_of(encoding)].decode(bytes(payload))
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return MessageHeader()
    source = header.source[:_MAX_NAME]
    header.source = source if source.isprintable() else ""
    header.client = header.client[:_MAX_NAME]
    return header


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
