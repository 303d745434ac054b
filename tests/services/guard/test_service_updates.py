"""Map updates: whole maps and patches, those that are lost, and queues that overflow."""

from __future__ import annotations

import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import zenoh

from slopewise.models.errors import ParameterError
from slopewise.services.guard.core import Guard
from slopewise.services.guard.parameter_request import WAITING
from slopewise.services.guard.service_updates import LOST, MAX_WAITING, KnownMap, ServiceUpdates
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.map_message import apply_update
from slopewise.services.wire.parameter_messages import ParameterGroup, ParameterReply
from slopewise.services.wire.plan_messages import MapUpdate
from tests.services.guard.guard_fixtures import (
    MODEL,
    braking_group,
    guard,
    map_update,
    parameter_group,
)

SPACE = "test/updates"


def corner(known: KnownMap) -> float | None:
    """Height of the first cell; None without a map."""
    return None if known.map is None else float(known.map.elevation[0, 0])


def test_missing_patch_removes_the_map_until_the_next_whole_one() -> None:
    known = KnownMap(None)
    known.take(map_update(1))
    known.take(map_update(2, patch=True, height=1.0))
    assert corner(known) == 1.0
    known.take(map_update(5, patch=True))
    assert (corner(known), known.reason) == (None, LOST)
    assert known.counters["map updates lost"] == 2
    known.take(map_update(6, patch=True))
    assert corner(known) is None
    known.take(map_update(7))
    known.take(map_update(8, patch=True, height=2.0))
    assert (corner(known), known.reason) == (2.0, "")
    known.take(map_update(8, patch=True, height=3.0))  # a repeated one changes nothing
    assert corner(known) == 2.0
    known.take(map_update(4, patch=True))  # late, or of a source that counts from one again
    assert known.reason == LOST


@pytest.mark.parametrize(("sequence", "instance"), [(7, ""), (7, "b"), (1, "b")])
def test_first_patch_after_missing_ones_removes_the_map(sequence: int, instance: str) -> None:
    """The guard joined late, or the mapper was restarted."""
    known = KnownMap(apply_update(map_update(), None))
    if instance:
        known.take(map_update(3, instance="a"))
    known.take(map_update(sequence, patch=True, instance=instance))
    assert (known.map, known.reason) == (None, LOST)
    known.take(map_update(sequence + 1, instance=instance))
    known.take(map_update(sequence + 2, patch=True, instance=instance))
    assert known.map is not None


@pytest.mark.parametrize("sequence", [0, 1])
def test_patches_counted_from_the_beginning_change_the_first_map(sequence: int) -> None:
    known = KnownMap(apply_update(map_update(), None))
    known.take(map_update(sequence, patch=True, height=1.0))
    known.take(map_update(sequence + 1, patch=True, height=2.0))
    assert corner(known) == 2.0


def test_patches_are_those_of_the_service() -> None:
    """One row, and classes without their names; one that does not fit removes the map."""
    known = KnownMap(None)
    classes = {"terrain_class": np.ones((40, 40)), "class_names": ["", "mud"]}
    known.take(map_update(1, **classes))
    cells = {"elevation": np.ones((1, 3)), "terrain_class": np.ones((1, 3))}
    known.take(map_update(2, patch=True, **cells))
    assert corner(known) == 1.0
    with pytest.raises(ParameterError, match="origin"):
        known.take(map_update(3, patch=True, origin=(0.3, 0.0)))


@pytest.fixture
def session() -> Iterator[zenoh.Session]:
    with zenoh.open(zenoh_config(ZenohSettings(mode="peer", listen=()))) as opened:
        yield opened


def put(session: zenoh.Session, key: str, message: MapUpdate | ParameterGroup) -> None:
    encoding = codec.encoding_of(type(message), Format.MESSAGEPACK)
    session.put(f"{SPACE}/v1/{key}", codec.encode(message, Format.MESSAGEPACK), encoding=encoding)


def hand_over(updates: ServiceUpdates, it: Guard, reason: str) -> None:
    """Until the map is missing for a reason; "": until it is there."""
    until = time.monotonic() + 10.0
    while (missing := it.maps.missing(time.monotonic())) != reason:
        assert time.monotonic() < until, missing
        updates.take(it)
        time.sleep(0.01)


def test_a_reply_ends_no_wait_before_its_groups_are_in_use(
    session: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    updates, it = ServiceUpdates(session, SPACE, None, MODEL.vehicle), guard()
    it.learned.required = True
    fields = {"status": "ok", "reason": "", "service": "s", "version": 2, "durable": True}
    reply = codec.encode(ParameterReply(**fields, groups=[braking_group()]), Format.JSON)
    sample: Any = SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: reply))

    def learn() -> None:
        updates._read_parameters(f"{SPACE}/v1/params", sample)

    updates._new_groups.append(parameter_group("limits", speed=1.0))
    monkeypatch.setattr(it, "learn", learn)  # the reply is read in this moment
    updates.take(it)
    assert it.learned.waits == WAITING
    monkeypatch.undo()
    updates.take(it)
    assert (it.learned.waits, set(it.learned.groups)) == ("", {"limits", "braking"})
    updates.close()


def test_overflowing_queue_is_reported_and_parameters_are_not_crowded_out(
    session: zenoh.Session,
) -> None:
    it = guard(known=None)
    updates = ServiceUpdates(session, SPACE, None, MODEL.vehicle)
    put(session, "map", map_update(1))
    put(session, "params/braking", braking_group(b_b=0.2))
    for k in range(2, MAX_WAITING + 10):
        put(session, "map", map_update(k, patch=True))
    time.sleep(0.2)
    updates.open()  # only now does anything read
    hand_over(updates, it, LOST)
    assert it.counters["map updates lost"] == MAX_WAITING
    assert LOST in it.warnings(time.monotonic())
    assert "braking" in it.learned.groups
    put(session, "map", map_update(60))
    hand_over(updates, it, "")
    assert LOST not in it.warnings(time.monotonic())
    session.put(f"{SPACE}/v1/map", b"\x00 no map")
    hand_over(updates, it, "no map")
    put(session, "map", map_update(61, patch=True))
    time.sleep(0.2)
    hand_over(updates, it, "no map")  # a patch on an unreadable map does not make one
    updates.close()
