"""Answers to requests on zenoh keys: decode, handle, encode, send; a query always gets a reply.

A component describes each kind of request with a :class:`Handler` and passes what arrived on its
key to :meth:`Endpoint.answer`, in the thread that owns its state. A request that cannot be decoded,
and one whose handler raises, is answered with ``failure(reason)``, a reply of the same type.
Observations that arrive as samples take the same steps without a reply.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import msgspec
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format

Request = TypeVar("Request", bound=msgspec.Struct)
Reply = TypeVar("Reply", bound=msgspec.Struct)

_log = logging.getLogger("slopewise")

STOP_TIMEOUT = 2.0
"""Longest wait for a thread to end [s]: a write to a slow disk, or the largest map, takes less."""


@dataclass(frozen=True, slots=True)
class Handler(Generic[Request, Reply]):
    """Schema, function and failure reply of one kind of request."""

    kind: type[Request]
    handle: Callable[[Request], Reply]  # returns the reply to a valid request
    failure: Callable[[str], Reply]  # returns the reply that carries a reason
    name: str  # malformed requests are counted as ``NAME_malformed``
    default: Request | None = None  # of a query without payload; None: a payload is required
    reply_format: Format = Format.MESSAGEPACK  # for senders whose encoding names none
    describe: Callable[[Request], str] | None = None  # identifies the request in a fault


@dataclass(frozen=True, slots=True)
class ReceivedQuery:
    """A query and its contents, read once when it arrived.

    Zenoh closes a query without Python's lock; a thread that reads it meanwhile gets a
    RuntimeError. So only the thread that replies may use ``query``.
    """

    query: zenoh.Query
    payload: zenoh.ZBytes | None
    encoding: str


class Endpoint:
    """Common steps of all components that answer requests; call it from one thread."""

    def __init__(self, counters: Counter[str], max_bytes: int) -> None:
        """Answer; ``counters`` count malformed requests and lost replies."""
        self._counters, self._max_bytes = counters, max_bytes

    def answer(
        self,
        item: zenoh.Query | zenoh.Sample,
        key: str,
        handler: Handler[Request, Reply],
        report_fault: Callable[[str], str],
    ) -> Reply:
        """Handle what arrived, send the reply on ``key`` if it is a query, and return it.

        ``report_fault``: reports the exception that a request raised; the reason for its sender.
        """
        written = codec.format_of(str(item.encoding or ""), handler.reply_format)
        what = f"a request on {key}"
        try:
            request = self.decode(handler.kind, item, key, handler.default)
            what = handler.describe(request) if handler.describe is not None else what
            reply = handler.handle(request)
            payload = codec.payload_of(reply, written)
        except InputError as error:
            self._counters[f"{handler.name}_malformed"] += 1
            reply = handler.failure(str(error))
            payload = codec.payload_of(reply, written)
        except Exception:  # noqa: BLE001 - reported and answered; the process has to live
            reply = handler.failure(report_fault(what))
            payload = codec.payload_of(reply, written)
        if isinstance(item, zenoh.Query):
            self.send(item, key, payload)
        return reply

    def decode(
        self,
        kind: type[Request],
        item: zenoh.Query | zenoh.Sample | ReceivedQuery,
        key: str,
        default: Request | None = None,
        **check: Callable[[Request], None],
    ) -> Request:
        """The request that arrived, see :func:`codec.decode`; an InputError names key and field."""
        payload = item.payload
        if default is not None and (payload is None or not len(payload)):
            return default
        encoding = str(item.encoding or "")
        return codec.decode(kind, payload or b"", encoding, key, self._max_bytes, **check)

    def send(self, query: zenoh.Query, key: str, payload: dict[str, Any]) -> bool:
        """Send a reply, see :func:`codec.payload_of`; False if that failed, which is counted."""
        try:
            query.reply(key, **payload)
        except zenoh.ZError as error:
            self._counters["replies_lost"] += 1
            _log.warning("a reply on %s could not be sent: %s", key, error)
            return False
        return True
