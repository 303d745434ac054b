"""The promise of the current session in the service: followed, kept, dropped with its prior."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest

from slopewise.models.parameters import Effect, Model
from slopewise.models.stop_distance import StopDistance
from slopewise.services.discovery.model_comparison import compare_stops
from slopewise.services.guard.guard_model import guard_model
from slopewise.services.guard.service_parameters import ServiceParameters
from slopewise.services.io.model_file import model_to_dict
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.parameter_messages import STOP_FACTOR, ParameterGroup
from tests.services.parameters.parameter_fixtures import ATV, G, started, stop

QUANTILES = (0.5, 0.9, 0.99, 0.999, 0.9999)
SPEED, FORCE = 2.5, 0.43


def promising(model: Model, *, session: float = 0.08, within: float = 0.05) -> Model:
    """The same with a table like that of a calibration."""
    spread = math.hypot(session, within)
    factors = [math.exp(NormalDist().inv_cdf(q) * spread) for q in QUANTILES]
    table = StopDistance(
        quantiles=QUANTILES,
        speeds=model.braking.speed_range,
        grades=(0.0,),
        levels=(1.0,),
        stop_factor=tuple((f, f) for f in factors),
        session_std=session,
    )
    braking = dataclasses.replace(model.braking, distance=table)
    return dataclasses.replace(model, braking=braking)


FILE = promising(ATV)


def drive(service: ParameterService, stops: int, weaker: float = 1.0) -> None:
    """Stops as the model file has them, or weaker ones."""
    on = FILE.braking
    for k in range(stops):
        speed = 1.5 + k % 3
        force = weaker * on.level_force(speed)
        distance = speed * on.dead_time + speed**2 / (2.0 * G * force)
        report = stop(force, speed=speed, distance=distance, dead_time=on.dead_time)
        service.observe("stop", report, "obs/stop", float(report.sequence))


def factor(service: ParameterService) -> float:
    distance = service.active.model.braking.distance
    assert distance is not None
    return distance.worst(0.99)


def test_a_session_that_confirms_narrows_and_one_that_does_not_widens(tmp_path: Path) -> None:
    service = started(tmp_path / "a.sqlite", FILE, stops_at_once=1000)
    file = factor(service)
    drive(service, 30)
    assert factor(service) < 0.95 * file
    tight = factor(service)
    drive(service, 1, weaker=0.8)
    assert factor(service) > 1.03 * tight


def test_it_outlives_the_service(tmp_path: Path) -> None:
    service = started(tmp_path / "a.sqlite", FILE, stops_at_once=1000)
    drive(service, 30)
    before = factor(service)
    service.close()
    again = started(tmp_path / "a.sqlite", FILE, stops_at_once=1000)
    assert before <= factor(again) < before * 1.01  # older by a moment
    again.roll_back(1, "braking", "ann")
    assert factor(again) == pytest.approx(FILE.braking.distance.worst(0.99))  # type: ignore[union-attr]


def test_an_adopted_finding_changes_the_planned_distance_by_what_it_stated(tmp_path: Path) -> None:
    service = started(tmp_path / "a.sqlite", FILE, stops_at_once=1000)
    drive(service, 30)
    lag = Effect(name="brake_lag", parameters={"tau": 0.3}, covariance=((0.01**2,),))
    finding = dataclasses.replace(promising(ATV, session=0.04, within=0.03), effect=(lag,))
    stated = compare_stops(finding, FILE)
    offer = ModelProposal(
        id="lag",
        at=0.0,
        cause="test",
        verdict="missing_effect",
        summary="",
        findings={"effects": []},
        data="0",
        stops=30,
        beside_file=stated,
        beside_use=stated,
        valid=True,
        changes=True,
        notes=[],
        model=model_to_dict(finding),
    )
    service.learner.state = service.learner.state.propose(offer)
    service.adopt(offer.id, "ann", faster=True)
    done = compare_stops(service.active.model, FILE)
    assert done.least == pytest.approx(stated.least, abs=0.05)
    assert done.most == pytest.approx(stated.most, abs=0.15)


@pytest.mark.parametrize("grade", [-0.2, 0.0, 0.2])
def test_the_guard_stops_by_the_promise_of_the_session(grade: float) -> None:
    on, wide = FILE.braking, 1.3
    names = ("m_m", "b_m", "m_b", "b_b", "dead_time")
    values = {name: getattr(on, name) for name in names} | {STOP_FACTOR: wide}
    group = ParameterGroup(
        group="braking",
        version=2,
        valid=True,
        age=0.0,
        fingerprint="",
        cause="",
        who="",
        values=values,
    )
    guard = ServiceParameters(guard_model(FILE), trusted=True)
    guard.take(group)
    (table,) = guard.tables()
    force = (on.m_m * SPEED + on.b_m) * grade + on.level_force(SPEED)
    pull = G * (force + np.sin(grade))
    slope = (table.m_m[0] * SPEED + table.b_m[0]) * grade
    slower = G * (slope + table.m_b[0] * SPEED + table.b_b[0] + np.sin(grade))
    planned = wide * (SPEED * on.dead_time + SPEED**2 / (2.0 * pull))
    guarded = SPEED * table.dead_time[0] + SPEED**2 / (2.0 * slower)
    assert planned * (1.0 - 1e-9) <= guarded < 1.02 * planned
