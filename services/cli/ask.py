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
    """The reply at a key.

    Args:
        session: open session.
        key: key of the service.
        kind: type of the reply.
        request: message, None for a query without payload.
        timeout: longest wait [s].
        subject: beginning of the error if there is no reply.

    Raises:
        InputError: no reply in time.
    """
    if request is None:
        replies = session.get(key, timeout=timeout)
    else:
        replies = session.get(
            key,
            payload=codec.encode(request, Format.MESSAGEPACK),
            encoding=codec.encoding_of(type(request), Format.MESSAGEPACK),
            timeout=timeout,
        )
    for reply in replies:
        if reply.ok is not None:
            encoding = str(reply.ok.encoding)
            return codec.decode(kind, reply.ok.payload, encoding, key, _MAX_REPLY)
    raise InputError(subject, "", f"expected a reply at {key} within {timeout:g} s, got none")
