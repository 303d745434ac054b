"""What false stops can do to plans: little, late, and never unseen."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.learner import Learner
from slopewise.services.settings.learning_settings import Learning
from slopewise.services.wire.observations import StopObservation

G = 9.80665
SEQUENCE = itertools.count(1)
STRONGER = "plans with stronger brakes than the model file"


def atv(covariance: Any = None) -> Model:
    model = read_model(find_model("atv"))
    if covariance is None:
        return model
    braking = dataclasses.replace(model.braking, covariance=covariance)
    return dataclasses.replace(model, braking=braking)


class Plot:
    """Stops at a pace of one's own, told to a learner."""

    def __init__(self, names: tuple[str, ...] = (), model: Model | None = None, **more: Any):
        self.learner = Learner(model or atv(), Learning(**more), lambda: bool(names), lambda: names)
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
        one = StopObservation(
            source=source,
            sequence=next(SEQUENCE),
            time=self.clock,
            speed=speed,
            grade=grade,
            deceleration=G * (force + float(np.sin(grade))),
            deceleration_std=0.02,
            surface=surface,
            **more,
        )
        return self.learner.observe(one, "obs/stop", self.clock)[1]

    def force(self, surface: str = "", speed: float = 2.0, grade: float = 0.0) -> float:
        braking = self.learner.active()[0].braking
        on = braking.on(surface) if surface else braking
        return (on.m_m * speed + on.b_m) * grade + on.m_b * speed + on.b_b


def test_a_hundred_strong_stops_in_a_moment_change_no_plan() -> None:
    plot = Plot()
    before = plot.force()
    reasons = [plot.stop(0.95, after=0.01, speed=1.0 + 0.7 * (i % 4)) for i in range(120)]
    assert plot.force() == before
    assert plot.learner.counters["stops_too_many"] == 115
    assert "more stops than the vehicle can make" in reasons[-1]
    assert "more stops came than the vehicle can make" in plot.learner.flags()


def test_strong_stops_at_a_pace_that_can_be_end_at_the_limit_above_the_file_and_are_flagged() -> (
    None
):
    plot = Plot()
    before = plot.force()
    for i in range(200):
        plot.stop(0.95, after=8.0, speed=1.0 + 0.7 * (i % 4))
    assert plot.force() == pytest.approx(1.25 * before, rel=1e-6)
    assert plot.learner.flags() == [f"{STRONGER}: base"]
    corners = itertools.product((1.0, 4.0), (-0.26, 0.26))
    file = Plot()
    for speed, grade in corners:
        assert plot.force("", speed, grade) <= 1.25 * file.force("", speed, grade) + 1e-9


def test_how_far_above_the_file_is_a_setting() -> None:
    plot = Plot(most_above_file=0.0)
    before = plot.force()
    for i in range(60):
        plot.stop(0.6, after=8.0, speed=1.0 + 0.7 * (i % 4))
    assert plot.force() == pytest.approx(before)
    assert plot.learner.flags() == []


def test_weak_stops_are_heard_at_any_pace() -> None:
    plot = Plot()
    for i in range(40):
        plot.stop(0.15 if i > 10 else 0.6, after=0.01)
    assert plot.force() < 0.2


def test_whoever_confirms_the_plan_after_each_weak_stop_silences_nobody() -> None:
    plot = Plot()
    for i in range(20):
        plot.stop(0.43, after=8.0, speed=1.0 + 0.7 * (i % 4), source="robot")
    for _ in range(3):
        plot.stop(0.15, after=8.0, source="robot")
        plot.stop(plot.force(), after=8.0)
    assert plot.force() < 0.2


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
    plot = Plot()
    reason = plot.stop(0.43, **numbers)
    assert (reason == "accepted") is fits, reason
    assert plot.learner.counters["stops_contradictory"] == (not fits)
    flags = plot.learner.flags()
    assert flags == ([] if fits else ["stops of liar contradict themselves"])
    if not fits:
        assert "distance: expected" in reason


def test_slope_coefficients_mend_as_quickly_as_they_bend() -> None:
    wide = tuple(map(tuple, np.diag(np.square([0.2, 0.7, 0.1, 1.0])).tolist()))
    noise = np.random.default_rng(0)

    def told(grade: float, speed: float) -> float:
        return (-0.03 * speed - 0.35) * grade + 0.015 * speed + 0.40 + noise.normal(0.0, 0.005)

    def honest() -> None:
        speed, grade = noise.uniform(1.0, 4.0), noise.uniform(-0.2, 0.2)
        plot.stop(told(grade, speed), after=8.0, speed=speed, grade=grade, source="robot")

    def slope() -> float:
        notes = plot.learner.state.group("braking").describe("braking").notes
        return float(notes["estimate b_m"]) + 2.0 * float(notes["estimate m_m"])

    for sign in (1.0, -1.0):
        plot = Plot(model=atv(wide))
        for _ in range(30):
            honest()
        before, lies = slope(), 0
        for grade in (0.2, -0.2, 0.2, -0.2):
            for _ in range(5):
                force = told(grade, 2.0) + sign * np.sign(grade) * 0.15
                plot.stop(force, after=8.0, grade=grade)
                lies += 1
        bent = slope() - before
        assert abs(bent) > 0.5
        for _ in range(lies):
            honest()
        assert abs(slope() - before) < 0.5 * abs(bent)


# ---------------------------------------------------------------------- surfaces


def test_a_new_surface_does_not_begin_with_a_guess_of_a_guess() -> None:
    plot = Plot()
    file = plot.force()
    for name in ("a", "b", "c", "d"):
        plot.stop(0.4, name, after=8.0)
    plot.stop(0.4, "asphalt", after=8.0)
    assert plot.force("asphalt") >= 0.59 * file
    assert plot.force("asphalt") <= 0.6 * file + 0.011


def test_what_many_stops_have_shown_counts_for_new_ground() -> None:
    plot = Plot()
    for i in range(12):
        plot.stop(0.2, "ice", after=8.0, speed=1.0 + 0.7 * (i % 4))
    plot.stop(0.4, "asphalt", after=8.0)
    assert plot.force("asphalt") <= 0.6 * 0.2 + 0.011


def test_invented_names_use_up_no_places_of_real_ones() -> None:
    plot = Plot(names=("", "mud", "snow"))
    for n in range(100):
        plot.stop(0.4, f"invented{n}", after=8.0)
    learned = plot.learner.active()[0].braking.terrain
    assert len([name for name in learned if name.startswith("invented")]) == 32
    for name in ("mud", "snow"):
        assert plot.stop(0.4, name, after=8.0) == "accepted"
        assert name in plot.learner.active()[0].braking.terrain


def test_ground_that_is_known_to_be_weak_is_not_forgotten_for_invented_names() -> None:
    plot = Plot()
    for _ in range(3):
        plot.stop(0.1, "ice", after=8.0)
    for n in range(100):
        plot.stop(0.4, f"invented{n}", after=8.0)
    assert plot.force("ice") < 0.11
    weak = Plot()
    for n in range(32):
        for _ in range(2):
            weak.stop(0.05, f"weak{n}", after=8.0)
    with pytest.raises(ParameterError, match="no slot is free"):
        weak.stop(0.4, "one too many", after=8.0)
