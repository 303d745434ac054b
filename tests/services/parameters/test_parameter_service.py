"""Versions, store and restart of the parameters of one vehicle, without a wire.

Changes by operators: values within ranges, roll back to any version, and the history.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sqlite3
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from slopewise.models.errors import ParameterError
from slopewise.services.parameters import replies
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.parameters.store import Store, StoreError
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire.observations import TerrainLabel
from slopewise.services.wire.parameter_messages import (
    ParameterQuestion,
    ParameterReply,
    RollBack,
    SetParameters,
)
from tests.services.parameters.parameter_fixtures import ATV, level_force, started, stopped


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return tmp_path / "p.sqlite"


@contextlib.contextmanager
def raw(store: Path) -> Iterator[sqlite3.Connection]:
    """The store's tables past its own code."""
    with contextlib.closing(sqlite3.connect(store)) as connection, connection:
        yield connection


def forge(tables: sqlite3.Connection, version: int, state: bytes) -> None:
    """Another state with a checksum that fits."""
    query = "UPDATE change SET state = ?, crc = ? WHERE version = ?"
    tables.execute(query, (state, zlib.crc32(state), version))


def test_acknowledged_stops_are_restored(store: Path) -> None:
    first = started(store)
    for n in range(1, 5):
        assert stopped(first, n, 0.12).durable
    version, force = first.active.version, level_force(first)
    first.close()
    again = started(store)
    assert again.active.version == version
    assert level_force(again) == pytest.approx(force, rel=1e-3)
    assert level_force(again) <= force + 1e-9, "older by now"
    assert stopped(again, 4, 0.12).status == "ignored"
    assert stopped(again, 5, 0.12).version == version + 1
    again.close()


def test_without_a_store_receipts_are_not_durable() -> None:
    service = started("")
    receipt = stopped(service, 1, 0.42)
    assert receipt.status == "taken"
    assert not receipt.durable
    assert service.flags() == []
    with pytest.raises(StoreError):
        service.roll_back(1, "", "me")


def test_warnings_change_without_a_new_revision_of_the_model() -> None:
    """Otherwise a sender that raises and clears them would keep planners busy."""
    published: list[ActiveParameters] = []
    service = ParameterService(ServiceConfig(model="atv"), ATV, apply=published.append)
    stopped(service, 1, 0.42)
    service.tick()
    before = service.active
    for n in range(2, 30):
        assert stopped(service, n, 0.9, distance=30.0).status == "refused"
        service.tick()
    service.alive("nobody", is_alive=True)
    after = service.active
    assert after.flags == ("stops of robot contradict themselves",)
    assert after.identity == before.identity
    assert after.model is before.model
    assert published[-1] is after


@pytest.mark.parametrize("how", ["insane", "not JSON", "another vehicle"])
def test_a_store_that_cannot_be_used_is_flagged_and_learning_continues(
    store: Path, how: str
) -> None:
    first = started(store)
    for n in range(1, 4):
        stopped(first, n, 0.12)
    older = level_force(first)
    stopped(first, 4, 0.11)
    first.close()
    model = ATV
    if how == "another vehicle":
        vehicle = dataclasses.replace(model.vehicle, mass=600.0)
        model = dataclasses.replace(model, vehicle=vehicle)
    else:
        with raw(store) as tables:
            query = "SELECT version, state FROM change ORDER BY version DESC LIMIT 1"
            version, state = tables.execute(query).fetchone()
            forged = json.loads(state)
            forged["learned"]["published"] = [0.0, 0.0, 0.0, 9.0]
            forge(tables, version, json.dumps(forged).encode() if how == "insane" else b"{")
    again = started(store, model)
    warnings = {"insane": "older ones are: braking", "another vehicle": "of another vehicle"}
    if how in warnings:
        assert any(warnings[how] in flag for flag in again.flags())
    if how == "another vehicle":
        assert again.active.model == model
    else:
        assert level_force(again) == pytest.approx(older, abs=1e-3)
    receipt = stopped(again, 9, 0.42)
    assert receipt.durable
    if how == "another vehicle":
        assert receipt.version == 6, "versions continue"
        with pytest.raises(ParameterError, match="version"):
            again.roll_back(3, "", "me")
    again.close()


def test_a_roll_back_that_cannot_be_used_changes_nothing(store: Path) -> None:
    service = started(store)
    for n in range(1, 4):
        stopped(service, n, 0.12)
    before = service.active.model
    service.close()
    with raw(store) as tables:
        data = json.dumps({"learned": {"estimate": []}, "prior": "", "dead_times": []})
        forge(tables, 2, data.encode())
    again = started(store)
    with pytest.raises(ParameterError, match="can be used"):
        again.roll_back(2, "", "me")
    assert again.active.model.braking.b_b == pytest.approx(before.braking.b_b, rel=1e-3)
    again.close()


def test_a_store_that_fails_is_written_later(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    service = started(store)
    published: list[ActiveParameters] = []
    service._apply = published.append
    write = Store.write

    def fail(*_: Any) -> None:
        # Slower parameters are published before the disk is written.
        assert published[-1].version == service.history.version
        raise StoreError("the disk is gone")

    monkeypatch.setattr(Store, "write", fail)
    receipts = [stopped(service, n, 0.12) for n in range(1, 4)]
    assert [r.durable for r in receipts] == [False] * 3
    assert "parameters are not kept: the disk is gone" in published[-1].flags
    assert level_force(service) == pytest.approx(0.12, abs=0.01)
    monkeypatch.setattr(Store, "write", write)
    service.history._tried = 0.0
    service.tick()
    assert service.history.durable
    assert published[-1].flags == ()
    service.close()
    again = started(store)
    assert again.active.version == receipts[-1].version
    assert stopped(again, 3, 0.12).status == "ignored"
    again.close()


def test_uncertainty_grows_with_age(store: Path) -> None:
    service = started(store)
    for n in range(1, 4):
        stopped(service, n, 0.3)
    service.close()
    with raw(store) as tables:
        tables.execute("UPDATE change SET uptime = uptime - 7200, at = at - 7200")
    again = started(store)
    assert again.active.uncertainty.age == pytest.approx(7200.0, abs=5.0)
    assert again.active.message().age == pytest.approx(7200.0, abs=5.0)
    assert level_force(again) <= 0.31
    again.close()
    with raw(store) as tables:
        tables.execute("UPDATE change SET boot = 'another', at = at + 1e9")
    lost = started(store)
    assert lost.active.uncertainty.age == 14_400.0, "a clock that was set back shows no age"
    lost.close()


def test_each_surface_has_the_scatter_of_its_age() -> None:
    service = started("")
    for n in range(1, 4):
        stopped(service, n, 0.3, surface="sand")
    for n in range(4, 7):
        stopped(service, n, 0.3)
    learner = service.learner
    assert learner.active()[1] < 1.0
    braking = learner.state.group("braking")
    braking.forces._updated["sand"] -= 3600.0  # type: ignore[attr-defined]
    model, common, oldest = learner.active()
    assert common < 1.0
    assert oldest == pytest.approx(3600.0, abs=5.0)
    fresh, old = model.braking.force_std, model.braking.on("sand").force_std
    assert old == pytest.approx((fresh**2 + 0.01**2) ** 0.5, rel=1e-2)


def set_values(service: ParameterService, group: str, **values: float) -> ParameterReply:
    return replies.change(service, SetParameters(group=group, values=values, who="ann"))


def roll_back(service: ParameterService, version: int, group: str = "") -> ParameterReply:
    return replies.change(service, RollBack(version=version, group=group))


def group_of(service: ParameterService, name: str) -> dict[str, Any]:
    return dict(msgspec.to_builtins(replies.group_message(service, name))) | {"age": 0.0}


def test_values_are_planned_with(tmp_path: Path) -> None:
    service = started("")
    assert set_values(service, "limits", speed=1.5).status == "ok"
    assert service.active.model.limits.speed == 1.5
    assert set_values(service, "braking", b_b=0.2).status == "ok"
    assert level_force(service) == pytest.approx(0.23)
    assert set_values(service, "braking", b_b=0.6).status == "ok"
    assert level_force(service) == pytest.approx(0.43), "only stops raise it above the model file"
    assert set_values(service, "terrain", slip_track=1.4).status == "ok"
    assert group_of(service, "terrain")["values"]["slip_track"] == pytest.approx(1.4)


@pytest.mark.parametrize(
    ("group", "values", "text"),
    [
        ("limits", {"speed": 5.0}, "at most the 4"),
        ("limits", {"min_load": 0.01}, "at least the 0.1"),
        ("limits", {"speed": float("nan")}, "a finite number"),
        ("limits", {"colour": 1.0}, "one of speed"),
        ("braking", {"b_b": 5.0}, "F_b/W"),
        ("braking", {"b_b": -0.1}, "F_b/W"),
        ("braking", {"dead_time": 0.1}, "model file"),
        ("brakes", {"b_b": 0.3}, "one of braking"),
        ("braking.a/b", {"b_b": 0.3}, "one of braking"),
    ],
)
def test_mistakes_are_named_and_change_nothing(
    group: str, values: dict[str, float], text: str
) -> None:
    service = started("")
    before = [group_of(service, name) for name in service.learner.state.names()]
    reply = set_values(service, group, **values)
    assert (reply.status, reply.version) == ("refused", 1)
    assert text in reply.reason
    assert [group_of(service, name) for name in service.learner.state.names()] == before


def test_every_number_that_can_be_set_has_a_range() -> None:
    service = started("")
    for group in ("terrain", "limits", "braking"):
        for name in group_of(service, group)["values"]:
            small = (-1.0, 5e-324, 0.0, -0.0) if group != "braking" else ()
            for value in (-1e308, 1e308, *small):
                reply = set_values(service, group, **{name: value})
                assert reply.status == "refused", (name, value)
                assert reply.reason.startswith(f"{name}: expected"), reply.reason
                assert " … " in reply.reason
                assert reply.reason.endswith(f"got {value:g}"), reply.reason
    assert service.history.version == 1


def test_any_version_can_be_gone_back_to(tmp_path: Path) -> None:
    service, stored = started(tmp_path / "p.sqlite"), {}
    for n, force in enumerate((0.42, 0.41, 0.2, 0.2, 0.19), start=1):
        version = stopped(service, n, force).version
        stored[version] = group_of(service, "braking")["values"]
    for version in (*stored, *reversed(stored)):
        assert roll_back(service, version, "braking").status == "ok"
        group = group_of(service, "braking")
        assert group["values"] == pytest.approx(stored[version], rel=1e-6)
        assert group["cause"] == f"rolled back to version {version}"
    set_values(service, "limits", speed=2.0)
    roll_back(service, min(stored), "braking")
    assert group_of(service, "limits")["values"]["speed"] == 2.0
    unknown = roll_back(service, 10**6)
    assert (unknown.status, "version" in unknown.reason) == ("refused", True)
    service.close()


def test_history_says_what_caused_what(tmp_path: Path) -> None:
    service = started(tmp_path / "p.sqlite")
    stopped(service, 1, 0.41)
    set_values(service, "braking", b_b=0.3)
    question = ParameterQuestion(group="braking", history=3)
    after, before = replies.read(service, question).history
    assert [h.cause.partition(":")[0] for h in (after, before)] == ["set b_b = 0.3", "stop 1"]
    assert [h.who for h in (after, before)] == ["ann", "robot"]
    assert after.version == before.version + 1
    assert after.values["b_b"] == 0.3
    assert abs(after.at - time.time()) < 60.0
    service.close()


def test_a_label_lowers_the_base_until_it_expires() -> None:
    service = started("", label_for=0.05)
    before, now = level_force(service), time.monotonic()
    for n, surface in enumerate(("grass", "mud"), start=1):
        label = TerrainLabel(source="camera", sequence=n, time=now, surface=surface)
        assert service.observe("terrain", label, "obs/terrain", now).status == "taken"
    assert level_force(service) < 0.65 * before, "no stop on mud: the base falls immediately"
    assert group_of(service, "braking")["cause"] == "terrain 2: ground is mud"
    time.sleep(0.06)
    service.tick()
    assert group_of(service, "braking")["cause"] == "the ground's label expired"
    assert service.learner.ground.surface(time.monotonic()) == ""
    vague = TerrainLabel(source="camera", sequence=3, time=now, surface="ice", probability=0.5)
    service.observe("terrain", vague, "obs/terrain", time.monotonic())
    assert service.learner.ground.surface(time.monotonic()) == "", "too vague to rely on"
