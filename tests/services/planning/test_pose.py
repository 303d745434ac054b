"""The pose of a request against its candidates, through a service process."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import zenoh

from slopewise.services.client import PlanClient
from slopewise.services.wire.plan_messages import Path, PlanReply
from tests.services.parameter_client import Robot, send_ground
from tests.services.service_process import Running, running

HALF = {"atv": 0.5, "husky": 0.3}  # [m] half the track width
ALONG = np.linspace(0.0, 20.0, 60)


def straight(name: str = "a", lateral: float = 0.0) -> Path:
    return Path(name=name, points=np.stack((ALONG, np.full(60, lateral)), axis=1))


@pytest.fixture(scope="module", params=HALF)
def asked(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Running, zenoh.Session, float]]:
    folder = tmp_path_factory.mktemp("pose")
    with running(folder, model=request.param) as service, service.session() as session:
        send_ground(Robot(service, session))
        yield service, session, HALF[request.param]


def answers(
    asked: tuple[Running, zenoh.Session, float], lateral: float, turned: float
) -> Iterator[PlanReply]:
    """Of a named client that is new to the service, and of one without a name."""
    service, session, _ = asked
    for name in (f"robot {lateral} {turned}", ""):
        with PlanClient(session, namespace=service.namespace, name=name, timeout=5.0) as client:
            reply = client.plan(0.5, [straight()], pose=(2.0, lateral, turned)).reply
        assert reply is not None
        yield reply


def test_within_the_limits_the_speeds_are_those_on_the_path(
    asked: tuple[Running, zenoh.Session, float],
) -> None:
    half = asked[2] - 1e-6
    on_it = [reply.plans[0].column("speed") for reply in answers(asked, 0.0, 0.0)]
    for lateral in (-half, -0.5 * half, half):
        for turned in (-0.2999, 0.0, 0.2999):
            for reply, speed in zip(answers(asked, lateral, turned), on_it, strict=True):
                assert reply.status == "ok"
                assert reply.plans[0].column("speed") == pytest.approx(speed, abs=1e-6)


def test_beyond_the_limits_the_answer_is_a_stop_with_the_reason(
    asked: tuple[Running, zenoh.Session, float],
) -> None:
    half = asked[2]
    grid = [(side * s * half, t) for side in (-1, 1) for s in (1.01, 1.5) for t in (0.0, 0.2)]
    grid += [(0.9 * half, 1.0), (0.0, 0.301), (-0.5 * half, -0.301), (0.0, np.pi)]
    for lateral, turned in grid:
        limit = "0.3 rad at most" if abs(turned) > 0.3 else f"{half:g} m at most"
        for reply in answers(asked, lateral, float(turned)):
            assert (reply.status, reply.chosen, reply.plans) == ("degraded", None, [])
            assert reply.command is not None
            assert reply.command.stop
            assert limit in reply.reason
            assert [c.usable for c in reply.ranking] == [False]
            assert limit in reply.ranking[0].reason


def test_a_client_whose_pose_leaves_its_plan_is_stopped(
    asked: tuple[Running, zenoh.Session, float],
) -> None:
    service, session, _ = asked
    with PlanClient(session, namespace=service.namespace, name="drives", timeout=5.0) as client:
        driven = [client.plan(0.5, [straight()], pose=(2.0, 0.0, 0.0)).reply for _ in range(3)]
        assert [r.status for r in driven if r is not None] == ["ok"] * 3
        answer = client.plan(0.5, [straight()], pose=(2.0, 0.0, 0.5)).reply
        assert answer is not None
        assert answer.command is not None
        assert (answer.command.stop, answer.chosen, answer.kept) == (True, None, False)
        assert "off the heading" in answer.reason


def test_the_candidate_that_fits_is_planned_and_the_other_refused(
    asked: tuple[Running, zenoh.Session, float],
) -> None:
    service, session, half = asked
    fits, away = straight(), straight("away", 1.1 * half)
    for name in ("two", ""):
        with PlanClient(session, namespace=service.namespace, name=name, timeout=5.0) as client:
            reply = client.plan(0.5, [away, fits], pose=(0.0, 0.0, 0.0)).reply
        assert reply is not None
        assert (reply.status, reply.chosen) == ("ok", fits.name)
        assert {c.name: c.usable for c in reply.ranking} == {"away": False, fits.name: True}
