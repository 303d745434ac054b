"""Payloads of faulty senders and of attackers, derived from valid payloads."""

from __future__ import annotations

import copy
import json
import math
import struct
from random import Random
from typing import Any

import msgspec
import numpy as np

from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format

_ODD_NUMBERS = (
    0,
    -1,
    1,
    2**31,
    2**53,
    2**63 - 1,
    2**64 - 1,
    -(2**63),
    0.0,
    -0.0,
    1e-300,
    1e300,
    -1e300,
    math.nan,
    math.inf,
    -math.inf,
    0.1,
    7.5,
    -3.0,
    100.0,
)
_ODD_TEXTS = (
    "",
    "a",
    "x" * 10_000,
    "\0",
    "../../etc/passwd",
    "NaN",
    "-inf",
    "1e999",
    "ß€😀",
    "%s%n",
    "braking",
    "limits",
    "ice",
    "'; DROP TABLE changes; --",
    "*",
    "**",
    "a/b",
)
_ODD_ENCODINGS = (
    "",
    "application/json",
    "application/msgpack",
    "text/plain",
    "zenoh/bytes",
    "application/cbor",
    "application/json;slopewise.status.v1",
    "application/msgpack;slopewise.plan_request.v2",
    ";",
    "application/msgpack;" + "x" * 200,
)


class Malformed:
    """An endless supply of payloads, the same for the same seed."""

    def __init__(self, valid: list[msgspec.Struct], seed: int) -> None:
        """Begin with messages that are right."""
        self._random = Random(seed)
        self._kinds = [type(message) for message in valid]
        packed = [codec.encode(message, Format.MESSAGEPACK) for message in valid]
        self._packed = packed
        self._written = [codec.encode(message, Format.JSON) for message in valid]
        self._raw = [msgspec.msgpack.decode(payload) for payload in packed]

    def draw(self) -> tuple[bytes, str]:
        """A payload and its encoding."""
        random = self._random
        i = random.randrange(len(self._raw))
        written = random.choice(list(Format))
        encoding = codec.encoding_of(self._kinds[i], written)
        if random.random() < 0.08:
            encoding = random.choice(_ODD_ENCODINGS)
        make = random.choice((self._noise, self._flipped, self._cut, *[self._changed] * 5))
        return make(i, written), encoding

    def _noise(self, i: int, written: Format) -> bytes:
        return self._random.randbytes(self._random.choice((0, 1, 3, 30, 300)))

    def _right(self, i: int, written: Format) -> bytearray:
        return bytearray(self._written[i] if written is Format.JSON else self._packed[i])

    def _flipped(self, i: int, written: Format) -> bytes:
        payload = self._right(i, written)
        for _ in range(self._random.randint(1, 5)):
            payload[self._random.randrange(len(payload))] = self._random.randrange(256)
        return bytes(payload)

    def _cut(self, i: int, written: Format) -> bytes:
        payload = self._right(i, written)
        begin = self._random.randrange(len(payload))
        end = self._random.randrange(len(payload))
        return bytes(payload[:end]) + bytes(payload[begin:])

    def _changed(self, i: int, written: Format) -> bytes:
        """Another value somewhere, a field too many or too few."""
        raw = copy.deepcopy(self._raw[i])
        for _ in range(self._random.choice((1, 1, 1, 2, 4))):
            self._change(raw)
        if written is Format.MESSAGEPACK:
            return msgspec.msgpack.encode(raw)
        text = json.dumps(raw, default=lambda value: list(value) if isinstance(value, bytes) else 0)
        return text.encode("utf-8", "surrogatepass")

    def _change(self, raw: Any) -> None:
        random = self._random
        inside = raw
        while True:
            keys = list(inside) if isinstance(inside, dict) else list(range(len(inside)))
            if not keys:
                return
            key = random.choice(keys)
            deeper = inside[key]
            if isinstance(deeper, dict | list) and deeper and random.random() < 0.75:
                inside = deeper
                continue
            break
        what = random.random()
        if isinstance(inside, dict) and what < 0.12:
            del inside[key]
        elif isinstance(inside, dict) and what < 0.2:
            inside[random.choice(_ODD_TEXTS)[:200]] = self._value()
        elif isinstance(deeper, bytes) and what < 0.7 and len(deeper) >= 8:
            at = 8 * random.randrange(len(deeper) // 8)
            number = struct.pack("<d", float(random.choice(_ODD_NUMBERS)))
            inside[key] = deeper[:at] + number + deeper[at + 8 :]
        else:
            inside[key] = self._value()

    def _value(self) -> Any:
        random = self._random
        return random.choice(
            (
                lambda: random.choice(_ODD_NUMBERS),
                lambda: random.choice(_ODD_TEXTS),
                lambda: None,
                lambda: random.random() < 0.5,
                lambda: [],
                dict,
                lambda: [random.choice(_ODD_NUMBERS) for _ in range(random.randrange(5))],
                lambda: {
                    "shape": [random.choice((-1, 0, 1, 2**40)), 2],
                    "data": random.randbytes(16),
                },
                lambda: {
                    "shape": [3, 2],
                    "data": np.array(random.choices(_ODD_NUMBERS, k=6), float).tobytes(),
                },
                lambda: random.randbytes(random.randrange(20)),
                lambda: self._nested(),
            )
        )()

    def _nested(self) -> Any:
        value: Any = 1
        for _ in range(self._random.choice((3, 100, 600))):
            value = [value]
        return value
