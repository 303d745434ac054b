"""A map that is not renewed: plans get slower with its age, then the vehicle stops."""

from __future__ import annotations

import time
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.services.planning.map_store import MapSnapshot, MapStore
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.wire.plan_messages import Path as Candidate
from slopewise.services.wire.plan_messages import PlanReply, PlanRequest
from tests.services.parameter_client import Robot, ground, send_ground
from tests.services.planning.plan_requests import ATV, plan_service, snapshot_of
from tests.services.service_process import flat, running, until

FLAT = ElevationMap(elevation=np.zeros((41, 400)), resolution=0.5, origin=(-5.0, -10.0))
MAX_AGE = 30.0
"""Of the settings by default [s]."""


def service(**planning: float) -> PlanService:
    return plan_service(budget=30.0, **planning)


def of_age(seconds: float, *, fixed: bool = False) -> MapSnapshot:
    return MapSnapshot(FLAT, 1, time.monotonic() - seconds, fixed=fixed)


def ask(
    plans: PlanService, known: MapSnapshot, speed: float = 0.0, x: float = 0.0, client: str = ""
) -> PlanReply:
    along = np.linspace(0.0, 150.0, 300)
    path = Candidate(name="a", points=np.stack([along, 0.0 * along], axis=1))
    pose = (x, 0.0, 0.0) if client else None
    return plans.answer(PlanRequest(speed=speed, paths=[path], client=client, pose=pose), known, "")


def top(reply: PlanReply) -> float:
    assert reply.plans, reply.reason
    return float(max(plan.column("speed").max() for plan in reply.plans))


def test_a_map_ages_while_the_machine_sleeps(monkeypatch: pytest.MonkeyPatch) -> None:
    """CLOCK_MONOTONIC stands then."""
    known, read = of_age(1.0), time.clock_gettime
    monkeypatch.setattr(time, "clock_gettime", lambda clock: read(clock) + 3600.0)
    assert known.age() == pytest.approx(3601.0, abs=0.1)
    assert "twice max_map_age" in ask(service(), known).reason


@pytest.mark.parametrize("client", ["", "robot"])
def test_up_to_max_map_age_plans_are_as_they_were(client: str) -> None:
    plans = service()
    new = ask(plans, of_age(0.0), client=client)
    for age in (4.0, 29.5):
        old = ask(plans, of_age(age), client=client)
        assert (old.status, old.reason) == (new.status, new.reason)
        assert np.array_equal(old.plans[0].values, new.plans[0].values)
        assert not any("degraded" in flag for flag in old.flags)


def test_beyond_it_the_highest_speed_falls_evenly_and_is_flagged() -> None:
    plans, before = service(), np.inf
    for age in np.linspace(30.5, 59.0, 12):
        reply = ask(plans, of_age(age))
        cap = ATV.limits.speed * (2.0 - age / MAX_AGE)
        assert 0.8 * cap - 0.1 <= top(reply) <= cap + 1e-6
        assert top(reply) <= before + 1e-9
        before = top(reply)
        assert any(f.startswith("degraded: the map is older than max_map_age") for f in reply.flags)
        assert len(plans.degraded(of_age(age))) == 1


@pytest.mark.parametrize("client", ["", "robot"])
def test_at_twice_the_age_the_answer_is_a_stop_with_the_reason(client: str) -> None:
    plans = service()
    assert ask(plans, of_age(0.0), client=client).status == "ok"
    for age in (60.0, 894.0, 1e9):
        reply = ask(plans, of_age(age), 2.0, client=client)
        assert (reply.status, reply.chosen, reply.plans) == ("degraded", None, [])
        assert reply.command.stop
        assert "the map is older than 60 s, twice max_map_age" in reply.reason
        assert reply.flags[0].startswith("degraded: the map is older than 60 s")
    assert ask(plans, of_age(1.0), client=client).status == "ok"


def test_a_map_to_begin_with_does_not_age_until_a_first_update() -> None:
    plans, store = service(), MapStore(FLAT)
    assert top(ask(plans, of_age(1e6, fixed=True))) == top(ask(plans, of_age(0.0)))
    assert "map is old" in plans.warnings(of_age(1e6))
    assert "map is old" not in plans.warnings(of_age(1e6, fixed=True))
    assert snapshot_of(store).fixed
    patch = flat(patch=True, elevation=np.zeros((2, 2)), resolution=0.5, origin=(-5.0, -10.0))
    assert store.apply(patch, "map")
    assert not snapshot_of(store).fixed, "further ones are expected"


def test_a_robot_driving_on_an_ageing_map_stops_without_full_brakes() -> None:
    plans, period = service(max_map_age=2.0), 0.1
    x = speed = clock = 0.0
    speeds = []
    while clock < 4.0:
        reply = ask(plans, of_age(clock), speed, x, "robot")
        assert not reply.command.stop, (clock, reply.reason)
        assert reply.status in ("ok", "blocked", "degraded")
        after = reply.command.speed
        x, speed, clock = x + 0.5 * (speed + after) * period, after, clock + period
        speeds.append(speed)
    assert max(speeds) > 1.0
    assert speeds[-1] < 0.55  # one step of service braking from standing
    assert ask(plans, of_age(4.1), speed, x, "robot").command.stop  # type: ignore[union-attr]


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    folder = tmp_path_factory.mktemp("stale")
    with running(folder, planning="max_map_age = 2.5") as started, started.session() as session:
        yield Robot(started, session)


def test_a_map_that_stays_away_slows_then_stops_and_the_next_one_lets_go(robot: Robot) -> None:
    send_ground(robot)
    free = robot.top_speed(20.0)
    until(lambda: robot.plan()["map_age"] > 3.5)
    assert robot.top_speed(20.0) < 0.7 * free
    until(lambda: bool(robot.plan()["command"]["stop"]))
    assert "twice max_map_age" in robot.plan()["reason"]
    assert any("twice max_map_age" in reason for reason in robot.status()["degraded"])
    send_ground(robot)
    assert robot.top_speed(20.0) == pytest.approx(free)
    assert robot.status()["degraded"] == []


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"resolution": 5e-324}, "resolution"),
        ({"elevation": 7}, "elevation"),
        (None, "expected object, got int"),
    ],
)
def test_the_last_good_map_stays_in_use_after_a_malformed_one(
    robot: Robot, fields: dict[str, object] | None, reason: str
) -> None:

    encoding = "application/msgpack;slopewise.map_update.v1"
    update = ground()
    send_ground(robot, update)
    before = robot.plan()
    payload = b"none"
    if fields is not None:
        payload = msgspec.msgpack.encode(update | {"sequence": 2} | fields)
    sender = update["source"] if fields is not None else "a sender without a name"
    robot.session.put(robot.service.key("map"), payload, encoding=encoding)
    prefix = f"a map of {sender} could not be used: "

    def flag() -> str:
        return next((f for f in robot.plan()["flags"] if f.startswith(prefix)), "")

    until(lambda: flag() != "")
    assert reason in flag()
    after = robot.plan()
    assert (after["map_version"], after["map_hash"]) == (before["map_version"], before["map_hash"])
    assert after["map_age"] > before["map_age"], "its age counts on"
    assert (after["status"], after["plans"][0]["values"]) == ("ok", before["plans"][0]["values"])
    payload = msgspec.msgpack.encode(update | {"sequence": 3})
    robot.session.put(robot.service.key("map"), payload, encoding=encoding)
    until(lambda: robot.plan()["map_version"] > before["map_version"])
    if fields is not None:
        assert flag() == "", "the next whole map of that sender takes it back"
    assert not any("lost" in f for f in robot.plan()["flags"])
