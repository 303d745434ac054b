"""Changes by operators: values within ranges, roll back to any version, and the history."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import msgspec
import pytest

from slopewise.services.parameters import replies
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.wire.observations import TerrainLabel
from slopewise.services.wire.parameter_messages import (
    ParameterQuestion,
    ParameterReply,
    RollBack,
    SetParameters,
)
from tests.services.parameters.parameter_fixtures import level_force, started, stopped


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
