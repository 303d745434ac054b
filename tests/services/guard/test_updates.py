"""Maps that come faster than they are read, or not at all: lost patches are noticed."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
import zenoh

from slopewise.services.guard.core import Guard
from slopewise.services.guard.settings import GuardSettings
from slopewise.services.guard.updates import LOST, MAX_WAITING, KnownMap, Updates
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.messages import MapUpdate
from slopewise.services.wire.parameter_messages import ParameterGroup
from tests.services.guard.test_decide import MODEL, group

SPACE = "test/updates"


def update(
    sequence: int, *, patch: bool = False, height: float = 0.0, instance: str = ""
) -> MapUpdate:
    cells = np.full((2, 2) if patch else (40, 40), height)
    return MapUpdate(
        source="mapper",
        sequence=sequence,
        elevation=cells,
        resolution=0.25,
        origin=(0.0, 0.0),
        patch=patch,
        instance=instance,
    )


def test_a_missing_patch_removes_the_ground_until_the_next_whole_map() -> None:
    known = KnownMap(None)
    known.take(update(1))
    known.take(update(2, patch=True, height=1.0))
    assert known.ground is not None
    known.take(update(5, patch=True))
    assert (known.ground, known.reason) == (None, LOST)
    assert known.counters["map updates lost"] == 2
    known.take(update(6, patch=True))
    assert known.ground is None
    known.take(update(7))
    known.take(update(8, patch=True, height=2.0))
    assert known.ground is not None
    assert known.ground.elevation[0, 0] == 2.0
    assert not known.reason
    known.take(update(8, patch=True, height=3.0))  # a repeated one changes nothing
    assert known.ground.elevation[0, 0] == 2.0
    known.take(update(4, patch=True))  # late, or of a source that counts from one again
    assert known.reason == LOST


@pytest.mark.parametrize(("sequence", "instance"), [(7, ""), (7, "b"), (1, "b")])
def test_a_first_patch_before_which_others_may_be_missing_removes_the_ground(
    sequence: int, instance: str
) -> None:
    """The guard joined late, or the mapper was restarted."""
    at_start = KnownMap(None)
    at_start.take(update(1))
    known = KnownMap(at_start.ground)
    if instance:
        known.take(update(3, instance="a"))
    known.take(update(sequence, patch=True, instance=instance))
    assert (known.ground, known.reason) == (None, LOST)
    known.take(update(sequence + 1, instance=instance))
    known.take(update(sequence + 2, patch=True, instance=instance))
    assert known.ground is not None


@pytest.mark.parametrize("sequence", [0, 1])
def test_patches_counted_from_the_beginning_change_the_first_map(sequence: int) -> None:
    at_start = KnownMap(None)
    at_start.take(update(1))
    known = KnownMap(at_start.ground)
    known.take(update(sequence, patch=True, height=1.0))
    known.take(update(sequence + 1, patch=True, height=2.0))
    assert known.ground is not None
    assert known.ground.elevation[0, 0] == 2.0


@pytest.fixture
def session() -> Iterator[zenoh.Session]:
    with zenoh.open(zenoh_config(ZenohSettings(mode="peer", listen=()))) as opened:
        yield opened


def put(session: zenoh.Session, key: str, message: MapUpdate | ParameterGroup) -> None:
    encoding = codec.encoding_of(type(message), Format.MESSAGEPACK)
    session.put(f"{SPACE}/v1/{key}", codec.encode(message, Format.MESSAGEPACK), encoding=encoding)


def taken(updates: Updates, guard: Guard, reason: str | None) -> None:
    """Hand over until the map is as expected; None: it is there."""
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        updates.take(guard)
        missing = guard.maps.missing(time.monotonic())
        if missing == (reason or ""):
            return
        time.sleep(0.01)
    raise AssertionError(f"expected {reason!r}, got {missing!r}")


def test_a_queue_that_overflows_is_reported_and_parameters_are_not_crowded_out(
    session: zenoh.Session,
) -> None:
    guard = Guard(GuardSettings(model="atv"), MODEL, None)
    updates = Updates(session, SPACE, None)
    put(session, "map", update(1))
    put(session, "params/braking", group(b_b=0.2))
    for k in range(2, MAX_WAITING + 10):
        put(session, "map", update(k, patch=True))
    time.sleep(0.2)
    updates.open()  # only now does anything read
    taken(updates, guard, LOST)
    assert guard.counters["map updates lost"] == MAX_WAITING
    assert LOST in guard.flags(time.monotonic())
    assert "braking" in guard.learned.groups
    put(session, "map", update(60))
    taken(updates, guard, None)
    assert LOST not in guard.flags(time.monotonic())
    session.put(f"{SPACE}/v1/map", b"\x00 no map")
    taken(updates, guard, "no map")
    put(session, "map", update(61, patch=True))
    time.sleep(0.2)
    taken(updates, guard, "no map")  # a patch on what could not be read is no map either
    updates.close()
