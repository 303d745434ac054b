"""Numbers of a brake sheet: closed forms, the reserve of plans, and the rule without slope.

The brake sheet as a page: models of all kinds are drawn, and its text states the numbers.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.arrays import Bools
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.laws import braking
from slopewise.models.parameters import Effect, Model
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.bounds.speed_bounds import HOLDING
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.report.brake_numbers import BrakeNumbers, round_values
from slopewise.services.report.brake_sheet import (
    brake_rows,
    sheet_json,
    slope_rows,
    unsafe_rule_warning,
    write_sheet,
)

GRADES = np.deg2rad([-14.0, -5.0, 0.0, 5.0, 14.0])
LAG = Effect(name="brake_lag", parameters={"tau": 0.2}, covariance=((0.0004,),))
LOCKUP = Effect(name="wheel_lockup", parameters={"mu": 0.42}, covariance=((0.0004,),))


@pytest.fixture(scope="module")
def model() -> Model:
    return read_model(find_model("atv"))


@pytest.fixture(scope="module")
def numbers(model: Model) -> BrakeNumbers:
    return BrakeNumbers(model, Uncertainty())


def changed(model: Model, **of_braking: object) -> Model:
    return dataclasses.replace(model, braking=dataclasses.replace(model.braking, **of_braking))


@pytest.mark.parametrize("grade", GRADES)
@pytest.mark.parametrize("speed", [0.5, 3.0])
@pytest.mark.parametrize("friction", [None, 0.35])
def test_mean_is_the_closed_form_and_the_simulation(
    model: Model, grade: float, speed: float, friction: float | None
) -> None:
    bare = changed(model, sliding_friction=friction)
    b, track = bare.braking, GroundTrack.of_grade(grade)
    numbers = BrakeNumbers(bare, Uncertainty())
    force = braking.force_ratio(grade, max(speed, b.speed_range[0]), b.m_m, b.b_m, b.m_b, b.b_b)
    force = min(force, math.inf if friction is None else friction * math.cos(grade))
    expected = braking.stopping_distance(
        speed, braking.deceleration(force, grade), b.dead_time, 0.0
    )
    assert numbers.mean_force(speed, grade) == pytest.approx(force)
    assert numbers.mean_distance(speed, grade) == pytest.approx(expected, abs=1e-6)
    simulated = simulate_stop(bare, track, speed).distance
    assert numbers.mean_distance(speed, grade) == pytest.approx(simulated, abs=1e-6)


def test_stop_beyond_the_longest_time_is_infinite(model: Model) -> None:
    ice = changed(model, sliding_friction=0.23, dead_time=0.0)
    slide = GroundTrack.of_grade(-0.2239)
    assert math.isinf(simulate_stop(ice, slide, 4.0).distance)
    assert math.isinf(BrakeNumbers(ice, Uncertainty()).mean_distance(4.0, -0.2239))


def test_quantile_reduces_force_and_adds_dead_time(model: Model, numbers: BrakeNumbers) -> None:
    """3.09 standard deviations of m_b v + b_b; between the trained speeds their chord."""
    cov = np.array(model.braking.covariance)[2:, 2:]
    margins = []
    for speed in model.braking.speed_range:
        phi = np.array([speed, 1.0])
        margins.append(3.0902 * np.sqrt(phi @ cov @ phi))
        expected = numbers.mean_force(speed, 0.0) - margins[-1]
        assert numbers.least_force(speed, 0.0) == pytest.approx(expected, abs=1e-5)
    middle = 0.5 * sum(model.braking.speed_range)
    expected = numbers.mean_force(middle, 0.0) - 0.5 * sum(margins)
    assert numbers.least_force(middle, 0.0) == pytest.approx(expected, abs=1e-5)
    late = BrakeNumbers(changed(model, dead_time_std=0.02), Uncertainty())
    assert late.dead_time == pytest.approx(0.3 + 3.0902 * 0.02, abs=1e-5)
    longer = late.allowed_distance(3.0, 0.0) - numbers.allowed_distance(3.0, 0.0)
    assert longer == pytest.approx(3.0 * 3.0902 * 0.02, abs=1e-4)


def test_rule_is_the_model_on_level_ground_and_short_on_descents(numbers: BrakeNumbers) -> None:
    table = numbers.distance_table(np.array([1.0, 2.5, 4.0]), GRADES)
    needed = table.allowed - numbers.offset
    np.testing.assert_allclose(needed[:, 2], table.rule, atol=1e-4)
    assert (needed[:, :2] > table.rule[:, None] + 1e-3).all()
    assert (needed[:, 3:] < table.rule[:, None]).all()
    np.testing.assert_array_less(table.plain, table.rule)
    assert numbers.plain_distance(4.0) == pytest.approx(8.0 / numbers.level_deceleration(4.0))


def test_slopes_end_where_the_force_does(model: Model) -> None:
    constant = {"m_m": 0.0, "b_m": 0.0, "m_b": 0.0, "covariance": None}
    level = BrakeNumbers(changed(model, **constant), Uncertainty())
    for slope, force in (
        (level.holds(1.0), 0.4),
        (level.holds(-1.0), 0.4),
        (level.stops(-1.0), 0.4 - HOLDING),
    ):
        assert slope.law == pytest.approx(np.arcsin(force), abs=2e-3)
        assert slope.claimed == pytest.approx(0.26)
    weak = BrakeNumbers(changed(model, b_b=0.1, **constant), Uncertainty())
    assert weak.holds(1.0).claimed == pytest.approx(np.arcsin(0.1), abs=2e-3)
    assert weak.allowed_distance(2.0, -0.2) == np.inf
    icy = BrakeNumbers(changed(model, sliding_friction=0.15), Uncertainty())
    assert icy.holds(-1.0).claimed == pytest.approx(np.arctan(0.15), abs=2e-3)


def test_state_heading_and_uncertain_end_of_an_effect_lengthen_the_stop(model: Model) -> None:
    calm = BrakeNumbers(model, Uncertainty())
    wind = Effect(name="headwind", parameters={"c": 0.004, "wind": 6.0, "direction": 0.0})
    windy = BrakeNumbers(dataclasses.replace(model, effect=(wind,)), Uncertainty())
    assert windy.allowed_distance(4.0, -0.2) > calm.allowed_distance(4.0, -0.2) + 0.05
    slow = BrakeNumbers(dataclasses.replace(model, effect=(LAG,)), Uncertainty())
    later = slow.allowed_distance(4.0, 0.0) - calm.allowed_distance(4.0, 0.0)
    tau = 0.2 + 3.0902 * 0.02  # a build-up delays by it, and slows meanwhile
    assert later == pytest.approx(4.0 * tau - 0.5 * calm.level_deceleration(4.0) * tau**2, rel=0.01)
    worn = changed(model, terrain={"worn": SurfaceBraking(b_b=0.35, state_of="")})
    assert BrakeNumbers(worn, Uncertainty()).least_force(2.0, 0.0) < calm.least_force(2.0, 0) - 0.04


def test_errors_lengthen_the_stop_by_a_known_amount(model: Model) -> None:
    """Speed error and gain on the descent count from the command on; friction at its lower end."""
    fixed = {"m_b": 0.0, "b_m": 0.0, "m_m": 0.0, "b_b": 0.4, "covariance": None}
    driven = changed(model, speed_error=0.05, drive_in_dead_time="either", **fixed)
    resistance = driven.terrain.motion_resistance
    grade, g, dead = -0.2, 9.80665, driven.braking.dead_time
    begin = 3.0 + 3.0902 * 0.05 + g * (math.sin(-grade) - resistance) * dead
    expected = begin * dead + begin**2 / (2 * g * (0.4 + math.sin(grade)))
    numbers = BrakeNumbers(driven, Uncertainty())
    assert numbers.allowed_distance(3.0, grade) - numbers.offset == pytest.approx(expected, 1e-4)
    locked = dataclasses.replace(model, effect=(LOCKUP,))
    assert BrakeNumbers(locked, Uncertainty()).friction == pytest.approx(0.42 - 3.0902 * 0.02, 1e-3)


@pytest.mark.parametrize("grade", [-0.2, pytest.param(-0.1, marks=pytest.mark.nightly)])
@pytest.mark.parametrize(
    "kind", ["ugv", "atv", "speed error", "friction", "worn", "lag", "uncertain friction"]
)
def test_sheet_shows_what_plans_reserve(model: Model, kind: str, grade: float) -> None:
    """The speed bound of the stopping path on a slope, station by station."""
    subject = {
        "ugv": read_model(find_model("ugv")),
        "atv": model,
        "speed error": changed(model, dead_time_std=0.02, force_std=0.01, speed_error=0.04),
        "friction": changed(model, sliding_friction=0.35),
        "worn": changed(model, terrain={"worn": SurfaceBraking(b_b=0.35, state_of="")}),
        "lag": dataclasses.replace(model, effect=(LAG,)),
        "uncertain friction": dataclasses.replace(model, effect=(LOCKUP,)),
    }[kind]
    plan, numbers = planned_down(subject, grade), BrakeNumbers(subject, Uncertainty())
    is_stop = (plan.limiting == Limiting.STOPPING_PATH) & (plan.speed_bound > 0.5)
    check_reserves(plan, numbers, grade, is_stop)


def test_at_the_ends_of_the_training_the_sheet_is_what_plans_have(model: Model) -> None:
    """A cut drive speeds up beyond the trained speeds; known friction ends what unloads an axle."""
    grade = model.braking.grade_range[0] + 1e-4
    plan, numbers = planned_down(model, grade), BrakeNumbers(model, Uncertainty())
    check_reserves(plan, numbers, grade, (plan.speed_bound > 3.5) & (plan.speed_bound < 3.99))
    slippery = changed(model, sliding_friction=0.45)
    load = planned_down(slippery, grade).rear_load.min()
    assert BrakeNumbers(slippery, Uncertainty()).least_rear_load() == pytest.approx(load, abs=1e-3)


def planned_down(model: Model, grade: float) -> SpeedPlan:
    """A plan straight down an even slope of 53 m."""
    x = np.arange(0.0, 60.0, 0.5)
    slope = np.tile(np.tan(grade) * x, (40, 1))
    ground = ElevationMap(elevation=slope, resolution=0.5, origin=(0.0, 0.0))
    path = CandidatePath("line", np.array([[3.0, 10.0], [56.0, 10.0]]))
    planner = CandidatePlanner(model, PlannerSettings(spacing=0.05), Uncertainty())
    return planner.plan(ground, [path], clear=40.0)[0]


def check_reserves(plan: SpeedPlan, numbers: BrakeNumbers, grade: float, where: Bools) -> None:
    at = np.flatnonzero(where & (plan.station < plan.clear_distance))
    assert len(at) > 2
    for k in at[:: max(len(at) // 10, 1)]:
        reserve = plan.clear_distance - plan.station[k]
        shown = numbers.allowed_distance(float(plan.speed_bound[k]), grade)
        # Two millimetres are the solver's tightening, the rest the chord between stations.
        assert reserve - 4e-3 <= shown <= reserve + 1e-3


def test_tables_have_both_ends_and_round_numbers_between() -> None:
    speeds = round_values(1.01, 3.99, (0.25, 0.5, 1.0, 2.0, 5.0), 6)
    np.testing.assert_allclose(speeds, [1.01, 2.0, 3.0, 3.99])
    grades = round_values(-13.9, 14.7, (1.0, 2.5, 5.0, 10.0), 9)
    np.testing.assert_allclose(grades, [-13.9, -10.0, -5.0, 0.0, 5.0, 10.0, 14.7], atol=1e-9)


def of(**of_braking: object) -> BrakeNumbers:
    model = read_model(find_model("atv"))
    braking = dataclasses.replace(model.braking, **of_braking)
    return BrakeNumbers(dataclasses.replace(model, braking=braking), Uncertainty())


def with_effects(model: Model) -> Model:
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    wind = Effect(name="headwind", parameters={"c": 0.01, "wind": 5.0, "direction": 1.0})
    return dataclasses.replace(model, effect=(lag, wind))


KINDS = {
    "as shipped": of(),
    "brakes that do not hold the steepest descent": of(b_b=0.25, m_b=0.0, b_m=0.1, m_m=0.0),
    "trained on level ground only": of(grade_range=(-0.005, 0.005)),
    "trained uphill only": of(grade_range=(0.02, 0.2)),
    "nearly one speed": of(speed_range=(2.0, 2.02)),
    "surfaces and a weaker state": of(
        terrain={
            "<sand>": SurfaceBraking(b_b=0.3),
            "ice": SurfaceBraking(b_b=0.16, m_b=0.0),
            "worn": SurfaceBraking(b_b=0.35, state_of=""),
        }
    ),
    "effects": BrakeNumbers(with_effects(read_model(find_model("atv"))), Uncertainty()),
}


BY_NIGHT = ("as shipped", "trained on level ground only", "trained uphill only")
"""Kinds whose sheets are drawn by night."""


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=pytest.mark.nightly if kind in BY_NIGHT else ())
        for kind in KINDS
        if kind != "nearly one speed"
    ],
)
def test_every_kind_of_model_has_a_sheet(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "sheet.html"
    write_sheet(path, KINDS[kind], {"stops": "<b>24</b>"}, "log 0123  a.csv")
    assert b"image/" in path.read_bytes()


@pytest.mark.parametrize(("ending", "page"), [("pdf", b"/Type /Page "), ("html", b"image/")])
def test_the_same_model_has_the_same_sheet(ending: str, page: bytes, tmp_path: Path) -> None:
    first, second = (tmp_path / f"{name}.{ending}" for name in ("first", "second"))
    for path in (first, second):
        write_sheet(path, KINDS["nearly one speed"], {}, "log 0123  <b>a.csv</b>")
    assert first.read_bytes() == second.read_bytes()
    assert first.read_bytes().count(page) == 1
    assert b"<b>a.csv" not in first.read_bytes()


def test_stop_that_does_not_end_is_null() -> None:
    weak = KINDS["brakes that do not hold the steepest descent"]
    assert np.isinf(weak.sheet_table.allowed[-1, 0])
    assert "does not end" in unsafe_rule_warning(weak)
    sheet = sheet_json(weak)
    assert sheet["allowed_distance"][-1][0] is None
    assert sheet["slopes"]["stops_downhill"]["claimed"] < 0.26
    assert "+" not in slope_rows(weak)["stops uphill, downhill"].split(", ")[1]


def test_without_trained_descent_no_rule_is_called_unsafe() -> None:
    assert "unsafe" not in unsafe_rule_warning(KINDS["trained uphill only"])


def test_other_surfaces_are_listed_longest_stop_first() -> None:
    numbers = KINDS["surfaces and a weaker state"]
    rows = brake_rows(numbers)
    ice, sand = rows["longest stop on others"].split(", ")
    assert ice == "ice –"
    assert sand.startswith("<sand> ")
    assert float(sand.split()[1]) > 4.0
    assert "longest stop on others" not in brake_rows(of())


def test_another_ending_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.html or \.pdf"):
        write_sheet(tmp_path / "sheet.png", of(), {}, "")
