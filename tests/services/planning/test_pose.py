"""The pose of a request against its candidates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.wire.plan_messages import Path, PlanReply, PlanRequest
from tests.services.planning.plan_requests import answer, flat_snapshot, plan_service

HALF = {"atv": 0.5, "husky": 0.3}  # [m] half the track width


def straight(name: str = "a", lateral: float = 0.0) -> Path:
    along = np.linspace(0.0, 20.0, 60)
    return Path(name=name, points=np.stack((along, np.full(60, lateral)), axis=1))


@pytest.fixture(scope="module", params=HALF)
def vehicle(request: pytest.FixtureRequest) -> tuple[PlanService, float]:
    return plan_service(read_model(find_model(request.param)), budget=30.0), HALF[request.param]


def answers(plans: PlanService, lateral: float, turned: float) -> Iterator[PlanReply]:
    """Of a named client that is new to the service, and of one without a name."""
    for client in (f"robot {lateral} {turned}", ""):
        pose = (2.0, lateral, turned)
        yield answer(plans, straight(), speed=0.5, client=client, pose=pose)


def test_within_the_limits_the_speeds_are_those_on_the_path(
    vehicle: tuple[PlanService, float],
) -> None:
    plans, half = vehicle[0], vehicle[1] - 1e-6
    on_it = [reply.plans[0].column("speed") for reply in answers(plans, 0.0, 0.0)]
    for lateral in (-half, -0.5 * half, half):
        for turned in (-0.2999, 0.0, 0.2999):
            for reply, speed in zip(answers(plans, lateral, turned), on_it, strict=True):
                assert reply.status == "ok"
                assert reply.plans[0].column("speed") == pytest.approx(speed, abs=1e-6)


def test_beyond_the_limits_the_answer_is_a_stop_with_the_reason(
    vehicle: tuple[PlanService, float],
) -> None:
    plans, half = vehicle
    grid = [(side * s * half, t) for side in (-1, 1) for s in (1.01, 1.5) for t in (0.0, 0.2)]
    grid += [(0.9 * half, 1.0), (0.0, 0.301), (-0.5 * half, -0.301), (0.0, np.pi)]
    for lateral, turned in grid:
        limit = "0.3 rad at most" if abs(turned) > 0.3 else f"{half:g} m at most"
        for reply in answers(plans, lateral, float(turned)):
            assert (reply.status, reply.chosen, reply.plans) == ("degraded", None, [])
            assert reply.command.stop
            assert limit in reply.reason
            assert [c.usable for c in reply.ranking] == [False]
            assert limit in reply.ranking[0].reason


def test_the_candidate_that_fits_is_planned_and_the_other_refused(
    vehicle: tuple[PlanService, float],
) -> None:
    plans, half = vehicle
    for client in ("two", ""):
        paths = straight("away", 1.1 * half), straight()
        reply = answer(plans, *paths, speed=0.5, client=client, pose=(0.0, 0.0, 0.0))
        assert (reply.status, reply.chosen) == ("ok", "a")
        assert {c.name: c.usable for c in reply.ranking} == {"away": False, "a": True}


def test_a_block_next_to_the_path_stops_a_vehicle_that_is_off_it() -> None:
    """The path passes it; from 0.4 m on its side the body does not. A late pose is slower."""
    plans = plan_service(read_model(find_model("atv")), budget=30.0)
    elevation = np.zeros((121, 301))
    elevation[69:72, 60:63] = 1.0  # x 3.0 … 3.2 m, y 0.9 … 1.1 m
    snapshot = flat_snapshot(elevation=elevation, resolution=0.1, origin=(-3.0, -6.0))
    for client in ("robot", ""):
        replies = {}
        for lateral, age in ((0.0, 0.0), (0.4, 0.0), (0.0, 0.5)):
            request = PlanRequest(
                speed=0.0,
                paths=[straight()],
                client=f"{client} {lateral} {age}" if client else "",
                pose=(0.0, lateral, 0.0),
                pose_age=age,
                clear=10.0,
            )
            replies[lateral, age] = plans.answer(request, snapshot, "plan")
        on_line, off_line, late = replies.values()
        assert "0.40 m left of it" not in on_line.reason
        assert (
            "on the way to the path from 0.40 m left of it, 0° off its heading" in off_line.reason
        )
        assert off_line.plans[0].progress < 2.5 < on_line.plans[0].progress
        assert late.plans[0].column("speed").max() < on_line.plans[0].column("speed").max() - 0.1
