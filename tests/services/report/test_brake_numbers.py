"""The numbers of a brake sheet, against closed forms, plans and the rule that knows no slope."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.laws import braking
from slopewise.models.parameters import Effect, Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.report.brake_numbers import BrakeNumbers
from slopewise.services.report.brake_rules import plain_distance, rule_distance, short_from
from slopewise.services.report.brake_table import distance_table, shown_grades, shown_speeds

GRADES = np.deg2rad([-14.0, -5.0, 0.0, 5.0, 14.0])


@pytest.fixture(scope="module")
def model() -> Model:
    return read_model(find_model("atv"))


@pytest.fixture(scope="module")
def numbers(model: Model) -> BrakeNumbers:
    return BrakeNumbers(model, Uncertainty())


def changed(model: Model, **of_braking: object) -> Model:
    return dataclasses.replace(model, braking=dataclasses.replace(model.braking, **of_braking))


@pytest.mark.parametrize("grade", GRADES)
def test_the_mean_is_the_closed_form(model: Model, numbers: BrakeNumbers, grade: float) -> None:
    b = model.braking
    force = braking.force_ratio(grade, 3.0, b.m_m, b.b_m, b.m_b, b.b_b)
    expected = braking.stopping_distance(3.0, braking.deceleration(force, grade), b.dead_time, 0.0)
    assert numbers.mean_distance(3.0, grade) == pytest.approx(expected, abs=1e-5)
    assert numbers.mean_force(3.0, grade) == pytest.approx(force)


def test_the_quantile_gives_up_force_and_time(model: Model, numbers: BrakeNumbers) -> None:
    """3.09 standard deviations of m_b v + b_b, with the covariance of the file."""
    late = changed(model, dead_time_std=0.02)
    cov = np.array(model.braking.covariance)[2:, 2:]
    phi = np.array([3.0, 1.0])
    margin = 3.0902 * np.sqrt(phi @ cov @ phi)
    least = numbers.mean_force(3.0, 0.0) - margin
    assert numbers.least_force(3.0, 0.0) == pytest.approx(least, abs=1e-5)
    found = BrakeNumbers(late, Uncertainty())
    assert found.dead_time == pytest.approx(0.3 + 3.0902 * 0.02, abs=1e-5)
    longer = found.allowed_distance(3.0, 0.0) - numbers.allowed_distance(3.0, 0.0)
    assert longer == pytest.approx(3.0 * 3.0902 * 0.02, abs=1e-4)


def test_on_level_ground_the_rule_is_the_model_and_on_descents_it_is_short(
    numbers: BrakeNumbers,
) -> None:
    table = distance_table(numbers, np.array([1.0, 2.5, 4.0]), GRADES)
    needed = table.allowed - numbers.offset
    np.testing.assert_allclose(needed[:, 2], table.rule, atol=1e-4)
    assert (needed[:, :2] > table.rule[:, None] + 1e-3).all()
    assert (needed[:, 3:] < table.rule[:, None]).all()
    np.testing.assert_array_less(table.plain, table.rule)
    assert short_from(numbers, 4.0) == pytest.approx(0.0, abs=1e-3)
    # With its acceleration it is right down to where the stop is as long.
    grade = short_from(numbers, 4.0, 1.0)
    assert grade is not None
    assert rule_distance(numbers, 4.0, 1.0) == pytest.approx(
        numbers.allowed_distance(4.0, grade) - numbers.offset, abs=5e-3
    )
    assert short_from(numbers, 4.0, 50.0) is None
    assert plain_distance(numbers, 4.0) == pytest.approx(8.0 / numbers.level_deceleration(4.0))


def test_slopes_end_where_the_force_does(model: Model, numbers: BrakeNumbers) -> None:
    level = BrakeNumbers(changed(model, m_m=0.0, b_m=0.0, m_b=0.0, covariance=None), Uncertainty())
    # A hundredth of the weight, net of the slope, is the least that is called a stop.
    for slope, force in (
        (level.holds(1.0), 0.4),
        (level.holds(-1.0), 0.4),
        (level.stops(-1.0), 0.39),
    ):
        assert slope.law == pytest.approx(np.arcsin(force), abs=2e-3)
        assert slope.claimed == pytest.approx(0.26)
    weak = BrakeNumbers(
        changed(model, m_m=0.0, b_m=0.0, m_b=0.0, b_b=0.1, covariance=None), Uncertainty()
    )
    assert weak.holds(1.0).claimed == pytest.approx(np.arcsin(0.1), abs=2e-3)
    assert weak.allowed_distance(2.0, -0.2) == np.inf
    icy = BrakeNumbers(changed(model, sliding_friction=0.15), Uncertainty())
    assert icy.holds(-1.0).claimed == pytest.approx(np.arctan(0.15), abs=2e-3)


def test_the_worst_state_heading_and_end_of_an_effect_count(model: Model) -> None:
    wind = Effect(name="headwind", parameters={"c": 0.004, "wind": 6.0, "direction": 0.0})
    blown = BrakeNumbers(dataclasses.replace(model, effect=(wind,)), Uncertainty())
    calm = BrakeNumbers(model, Uncertainty())
    assert blown.allowed_distance(4.0, -0.2) > calm.allowed_distance(4.0, -0.2)
    lag = Effect(name="brake_lag", parameters={"tau": 0.2}, covariance=((0.0004,),))
    slow = BrakeNumbers(dataclasses.replace(model, effect=(lag,)), Uncertainty())
    later = slow.allowed_distance(4.0, 0.0) - calm.allowed_distance(4.0, 0.0)
    tau = 0.2 + 3.0902 * 0.02  # a build-up delays by it, and slows meanwhile
    slowing = calm.level_deceleration(4.0)
    assert later == pytest.approx(4.0 * tau - 0.5 * slowing * tau**2, rel=0.01)


@pytest.mark.parametrize("grade", np.deg2rad([-12.0, 0.0, 12.0]))
def test_plans_allow_for_no_less(model: Model, grade: float) -> None:
    """The stop from the middle of an even slope, in a plan of that slope."""
    held = changed(model, drive_in_dead_time="held")
    x = np.arange(0.0, 60.0, 0.5)
    ground = ElevationMap(
        elevation=np.tile(np.tan(grade) * x, (40, 1)), resolution=0.5, origin=(0.0, 0.0)
    )
    path = CandidatePath("line", np.array([[3.0, 10.0], [56.0, 10.0]]))
    (plan,) = CandidatePlanner(held, uncertainty=Uncertainty()).plan(ground, [path])
    k = int(np.argmax(plan.speed))
    assert plan.speed[k] > 1.5
    told = BrakeNumbers(held, Uncertainty()).allowed_distance(float(plan.speed[k]), grade)
    assert told <= plan.stop_distance[k] + 1e-4
    assert told >= 0.97 * plan.stop_distance[k]


def test_tables_have_both_ends_and_round_numbers_between(model: Model) -> None:
    b = changed(model, speed_range=(1.01, 3.99), grade_range=(-0.243, 0.256)).braking
    np.testing.assert_allclose(shown_speeds(b), [1.01, 2.0, 3.0, 3.99])
    grades = np.rad2deg(shown_grades(b))
    assert grades[0] == pytest.approx(np.rad2deg(-0.243))
    assert grades[-1] == pytest.approx(np.rad2deg(0.256))
    assert set(np.round(grades[1:-1], 6)) == {-10.0, -5.0, 0.0, 5.0, 10.0}
