"""Limits of what false stops can do to plans: little, late, and always flagged."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.parameters.learner import Learner
from slopewise.services.settings.learning_settings import Learning
from tests.services.parameters.parameter_fixtures import ATV, G, stop

STRONGER = "plans with stronger brakes than the model file"


def with_covariance(covariance: Any) -> Model:
    return dataclasses.replace(ATV, braking=dataclasses.replace(ATV.braking, covariance=covariance))


class FalseReports:
    """Stops of any force, reported to a learner."""

    def __init__(self, names: tuple[str, ...] = (), model: Model | None = None, **more: Any):
        self.learner = Learner(model or ATV, Learning(**more), lambda: names)
        self.clock = 0.0

    def stop(
        self,
        force: float,
        surface: str = "",
        *,
        after: float = 0.0,
        speed: float = 2.0,
        grade: float = 0.0,
        source: str = "liar",
        **more: Any,
    ) -> str:
        self.clock += after
        report = stop(
            force,
            surface,
            speed,
            grade=grade,
            source=source,
            time=self.clock,
            deceleration=G * (force + float(np.sin(grade))),
            **more,
        )
        return self.learner.observe(report, "obs/stop", self.clock)[1]

    def force(self, surface: str = "", speed: float = 2.0, grade: float = 0.0) -> float:
        braking = self.learner.active()[0].braking
        on = braking.on(surface) if surface else braking
        return (on.m_m * speed + on.b_m) * grade + on.m_b * speed + on.b_b


def test_a_burst_of_strong_stops_changes_no_plan() -> None:
    reports = FalseReports()
    before = reports.force()
    reasons = [reports.stop(0.95, after=0.01, speed=1.0 + 0.7 * (i % 4)) for i in range(120)]
    assert reports.force() == before
    assert reports.learner.counters["stops_too_many"] == 115
    assert "more stops than the vehicle can make" in reasons[-1]
    assert "more stops came than the vehicle can make" in reports.learner.flags()


def test_strong_stops_at_a_possible_rate_end_at_the_limit_and_are_flagged() -> None:
    reports = FalseReports()
    before = reports.force()
    for i in range(200):
        reports.stop(0.95, after=8.0, speed=1.0 + 0.7 * (i % 4))
    assert reports.force() == pytest.approx(1.25 * before, rel=1e-6)
    assert reports.learner.flags() == [f"{STRONGER}: base"]
    corners = itertools.product((1.0, 4.0), (-0.26, 0.26))
    file = FalseReports()
    for speed, grade in corners:
        assert reports.force("", speed, grade) <= 1.25 * file.force("", speed, grade) + 1e-9


def test_how_far_above_the_file_is_a_setting() -> None:
    reports = FalseReports(most_above_file=0.0)
    before = reports.force()
    for i in range(60):
        reports.stop(0.6, after=8.0, speed=1.0 + 0.7 * (i % 4))
    assert reports.force() == pytest.approx(before)
    assert reports.learner.flags() == []


def test_weak_stops_are_learned_from_at_any_rate() -> None:
    reports = FalseReports()
    for i in range(40):
        reports.stop(0.15 if i > 10 else 0.6, after=0.01)
    assert reports.force() < 0.2


def test_reports_that_confirm_the_plan_do_not_hide_weak_stops() -> None:
    reports = FalseReports()
    for i in range(20):
        reports.stop(0.43, after=8.0, speed=1.0 + 0.7 * (i % 4), source="robot")
    for _ in range(3):
        reports.stop(0.15, after=8.0, source="robot")
        reports.stop(reports.force(), after=8.0)
    assert reports.force() < 0.2


@pytest.mark.parametrize(
    ("numbers", "fits"),
    [
        ({"distance": 1.08, "dead_time": 0.3}, True),
        ({"distance": 1.25, "dead_time": 0.3}, True),
        ({"distance": 0.5, "dead_time": 0.3}, False),
        ({"distance": 3.0, "dead_time": 0.3}, False),
        ({"distance": 1.9}, True),
        ({"distance": 0.1}, False),
        ({"distance": 30.0}, False),
        ({"distance": 1e12, "dead_time": 0.3}, False),
        ({"dead_time": 0.3}, True),
    ],
)
def test_numbers_of_a_stop_have_to_agree(numbers: dict[str, float], fits: bool) -> None:
    reports = FalseReports()
    reason = reports.stop(0.43, **numbers)
    assert (reason == "accepted") is fits, reason
    assert reports.learner.counters["stops_contradictory"] == (not fits)
    flags = reports.learner.flags()
    assert flags == ([] if fits else ["stops of liar contradict themselves"])
    if not fits:
        assert "distance: expected" in reason


def test_slope_coefficients_recover_as_quickly_as_they_are_distorted() -> None:
    wide = tuple(map(tuple, np.diag(np.square([0.2, 0.7, 0.1, 1.0])).tolist()))
    noise = np.random.default_rng(0)

    def true_force(grade: float, speed: float) -> float:
        return (-0.03 * speed - 0.35) * grade + 0.015 * speed + 0.40 + noise.normal(0.0, 0.005)

    def honest() -> None:
        speed, grade = noise.uniform(1.0, 4.0), noise.uniform(-0.2, 0.2)
        reports.stop(true_force(grade, speed), after=8.0, speed=speed, grade=grade, source="robot")

    def slope() -> float:
        notes = reports.learner.state.group("braking").describe("braking").notes
        return float(notes["estimate b_m"]) + 2.0 * float(notes["estimate m_m"])

    for sign in (1.0, -1.0):
        reports = FalseReports(model=with_covariance(wide))
        for _ in range(30):
            honest()
        before, lies = slope(), 0
        for grade in (0.2, -0.2, 0.2, -0.2):
            for _ in range(5):
                force = true_force(grade, 2.0) + sign * np.sign(grade) * 0.15
                reports.stop(force, after=8.0, grade=grade)
                lies += 1
        distortion = slope() - before
        assert abs(distortion) > 0.5
        for _ in range(lies):
            honest()
        assert abs(slope() - before) < 0.5 * abs(distortion)


def test_a_new_surface_ignores_surfaces_with_few_stops() -> None:
    reports = FalseReports()
    file = reports.force()
    for name in ("a", "b", "c", "d"):
        reports.stop(0.4, name, after=8.0)
    reports.stop(0.4, "asphalt", after=8.0)
    assert reports.force("asphalt") >= 0.59 * file
    assert reports.force("asphalt") <= 0.6 * file + 0.011


def test_the_force_of_many_stops_limits_new_surfaces() -> None:
    reports = FalseReports()
    for i in range(12):
        reports.stop(0.2, "ice", after=8.0, speed=1.0 + 0.7 * (i % 4))
    reports.stop(0.4, "asphalt", after=8.0)
    assert reports.force("asphalt") <= 0.6 * 0.2 + 0.011


def test_invented_names_take_no_slots_of_real_ones() -> None:
    reports = FalseReports(names=("", "mud", "snow"))
    for n in range(40):
        reports.stop(0.4, f"invented{n}", after=8.0)
    learned = reports.learner.active()[0].braking.terrain
    assert len([name for name in learned if name.startswith("invented")]) == 32
    for name in ("mud", "snow"):
        assert reports.stop(0.4, name, after=8.0) == "accepted"
        assert name in reports.learner.active()[0].braking.terrain


def test_weak_terrain_is_not_evicted_for_invented_names() -> None:
    reports = FalseReports()
    for _ in range(3):
        reports.stop(0.1, "ice", after=8.0)
    for n in range(40):
        reports.stop(0.4, f"invented{n}", after=8.0)
    assert reports.force("ice") < 0.11
    weak = FalseReports()
    for n in range(32):
        for _ in range(2):
            weak.stop(0.05, f"weak{n}", after=8.0)
    with pytest.raises(ParameterError, match="no slot is free"):
        weak.stop(0.4, "one too many", after=8.0)
