"""A request to a running service, and its typed reply."""

from __future__ import annotations

from typing import TypeVar

import msgspec
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format

T = TypeVar("T", bound=msgspec.Struct)

_MAX_REPLY = 256_000_000
"""Largest reply that is decoded [bytes]; the history of parameters is far below it."""


def ask(
    session: zenoh.Session,
    key: str,
    kind: type[T],
    request: msgspec.Struct | None,
    timeout: float,
    subject: str,
) -> T:
    """The reply at a key within a time [s]; without a request the query has no payload.

    The InputError of a missing reply begins with the subject.
    """
    message = {} if request is None else codec.payload_of(request, Format.MESSAGEPACK)
    for reply in session.get(key, timeout=timeout, **message):
        if reply.ok is not None:
            encoding = str(reply.ok.encoding)
            return codec.decode(kind, reply.ok.payload, encoding, key, _MAX_REPLY)
    raise InputError(subject, "", f"expected a reply at {key} within {timeout:g} s, got none")
