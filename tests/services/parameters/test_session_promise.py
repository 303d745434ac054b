"""The promise of the current session in the service: followed, kept, dropped with its prior."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.stop_distance import StopDistance
from slopewise.services.discovery.model_comparison import compare_stops
from slopewise.services.guard.guard_model import guard_model
from slopewise.services.guard.service_parameters import ServiceParameters
from slopewise.services.io.model_file import model_to_dict
from slopewise.services.parameters.parameter_service import ParameterService
from slopewise.services.wire.parameter_messages import STOP_FACTOR
from tests.services.guard.guard_fixtures import braking_group
from tests.services.parameters.parameter_fixtures import ATV, LAG, G, proposal, started, stop

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


def drive(
    service: ParameterService,
    stops: int,
    weaker: float = 1.0,
    surface: str = "",
    dead_time: float = FILE.braking.dead_time,
) -> None:
    """Stops as the model file has them, or weaker ones, on a surface, with a dead time [s]."""
    for k in range(stops):
        speed = 1.5 + k % 3
        force = weaker * FILE.braking.level_force(speed)
        distance = speed * dead_time + speed**2 / (2.0 * G * force)
        report = stop(force, surface, speed=speed, distance=distance, dead_time=dead_time)
        service.observe("stop", report, "obs/stop", float(report.sequence))


def factor(service: ParameterService) -> float:
    distance = service.active.model.braking.distance
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


def allowed(service: ParameterService, surface: str = "", speed: float = 3.0) -> float:
    """Distance at the quantile 0.99 by the braking in use, at the worst factor [m]."""
    on = service.active.model.braking
    on = on.on(surface) if surface else on
    assert on.distance is not None
    pull = G * (on.level_force(speed) - 2.3 * on.force_std)
    return on.distance.worst(0.99) * (speed * on.dead_time + speed**2 / (2.0 * pull))


def on_map(service: ParameterService, *surfaces: str) -> ParameterService:
    state = dataclasses.replace(service.learner.state, map_surfaces=lambda: surfaces)
    service.learner.state = state
    return service


def test_sooner_brakes_on_one_surface_shorten_no_stop_on_another(tmp_path: Path) -> None:
    service = on_map(started(tmp_path / "a.sqlite", FILE, stops_at_once=1000), "x", "y")
    drive(service, 40, surface="x", dead_time=0.9)
    before = allowed(service, "x")
    drive(service, 4, surface="y", dead_time=0.3)
    assert allowed(service, "x") >= before * (1.0 - 1e-9)


def test_stops_that_are_rejected_or_too_many_shorten_nothing(tmp_path: Path) -> None:
    service = started(tmp_path / "a.sqlite", FILE, stops_at_once=5)
    drive(service, 5)
    before = factor(service)
    on = FILE.braking
    for _ in range(3):  # far too strong
        report = stop(2.2 * on.level_force(2.0), speed=2.0, dead_time=on.dead_time)
        service.observe("stop", report, "obs/stop", 5.0)
    assert factor(service) >= before
    for _ in range(40):  # all at one moment, a little too weak to be too many
        report = stop(0.999 * on.level_force(2.0), speed=2.0, dead_time=on.dead_time)
        service.observe("stop", report, "obs/stop", 5.0)
    assert factor(service) >= before


def test_a_session_that_scatters_more_than_the_table_is_allowed_more(tmp_path: Path) -> None:
    service = started(tmp_path / "a.sqlite", FILE, stops_at_once=1000)
    drive(service, 30)
    tight = factor(service)
    for k in range(30):
        drive(service, 1, weaker=1.0 + 0.12 * (-1) ** k)
    assert factor(service) > 1.05 * tight


def test_values_of_an_operator_keep_a_longer_promise(tmp_path: Path) -> None:
    service = started(tmp_path / "a.sqlite", FILE, stops_at_once=1000)
    drive(service, 10)
    drive(service, 4, weaker=0.85)
    before = factor(service)
    b_b = service.active.model.braking.b_b
    service.set_values("braking", {"b_b": 0.99 * b_b}, "ann")
    assert factor(service) >= before
    with pytest.raises(ParameterError, match="stop_factor"):
        service.set_values("braking", {STOP_FACTOR: 1.0}, "ann")


def test_the_dead_time_of_a_stop_counts_once(tmp_path: Path) -> None:
    service = started(tmp_path / "a.sqlite", FILE, stops_at_once=1000)
    drive(service, 1, surface="x", dead_time=0.9)
    assert list(service.learner.state.braking.forces.dead_times) == [0.9]


def test_weaker_ground_that_is_reached_lends_the_base_its_promise(tmp_path: Path) -> None:
    service = on_map(started(tmp_path / "a.sqlite", FILE, stops_at_once=1000), "x")
    drive(service, 10)
    drive(service, 3, surface="x")
    for _ in range(8):  # longer than by their force
        on = FILE.braking
        force = on.level_force(2.0)
        distance = 1.2 * (2.0 * on.dead_time + 2.0**2 / (2.0 * G * force))
        report = stop(force, "x", speed=2.0, distance=distance, dead_time=on.dead_time)
        service.observe("stop", report, "obs/stop", float(report.sequence))
    forces = service.learner.state.braking.forces
    on_x = forces.planning_braking({}).on("x").distance
    assert on_x is not None
    forces.lower_base("x", "")
    base = forces.planning_braking({}).distance
    assert base.worst(0.99) >= on_x.worst(0.99) > 1.1 * factor(service)


def test_an_adopted_finding_changes_the_planned_distance_by_what_it_stated(tmp_path: Path) -> None:
    service = started(tmp_path / "a.sqlite", FILE, stops_at_once=1000)
    drive(service, 30)
    finding = dataclasses.replace(promising(ATV, session=0.04, within=0.03), effect=(LAG,))
    stated = compare_stops(finding, FILE)
    offer = proposal(beside_file=stated, beside_use=stated, model=model_to_dict(finding))
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
    file = guard_model(FILE)
    guard = ServiceParameters(file, trusted=True)
    guard.take(braking_group(**values))
    (table,) = guard.in_use().tables
    force = (on.m_m * SPEED + on.b_m) * grade + on.level_force(SPEED)
    pull = G * (force + np.sin(grade))
    slope = (table.m_m[0] * SPEED + table.b_m[0]) * grade
    slower = G * (slope + table.m_b[0] * SPEED + table.b_b[0] + np.sin(grade))
    planned = wide * (SPEED * on.dead_time + SPEED**2 / (2.0 * pull))
    guarded = SPEED * table.dead_time[0] + SPEED**2 / (2.0 * slower)
    assert planned * (1.0 - 1e-9) <= guarded < 1.02 * planned
    # Loads are those of brakes that are as much stronger than their mean.
    strongest = slope + table.m_b[0] * SPEED + table.b_b[0] + table.extra[0]
    assert strongest >= force
    (at_rest,) = file.tables
    assert at_rest.b_b[0] + at_rest.extra[0] > on.b_b
