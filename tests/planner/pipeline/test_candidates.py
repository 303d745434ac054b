"""Plans as they leave the planner: statuses, sentences, effects, repeatability."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.planner.ground.braking_ground import GroundConditions
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline import plan_finalizer
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.plan import SpeedPlan, Status, motion_of
from slopewise.planner.profile.smoothing import Smoothed, smooth
from slopewise.planner.profile.smoothing_problem import SmoothingProblem
from slopewise.planner.profile.time_optimal import travel_cost
from slopewise.planner.settings import PlannerSettings
from tests.planner.scenes import (
    ATV,
    G,
    Tables,
    arc,
    assert_sound,
    at,
    ground_map,
    labels,
    model_of,
    plan_one,
    plane,
    straight,
    tables_with,
)

NO_ARRAYS = ("candidate", "status", "reason", "clear_distance", "obstacle", "momentum")
ARRAYS = tuple(
    field.name
    for field in dataclasses.fields(SpeedPlan)
    if field.name not in (*NO_ARRAYS, "path_deviation")
)


def hills(x: Any, y: Any) -> Any:
    return 0.5 * np.sin(x / 3.0) + 0.3 * np.cos(y / 2.0)


def fan(count: int = 9) -> list[CandidatePath]:
    return [arc(6.0 + 0.3 * i, 0.05 * (i - 4.1), name=f"c{i}") for i in range(count)]


# --------------------------------------------------------------------------------- statuses


def test_ok_reaches_the_end_and_has_nothing_to_explain() -> None:
    plan = plan_one(ATV, plane(), straight(30.0))
    assert plan.status is Status.OK
    assert plan.reason == ""
    # Offset and guard are kept from the end of the path.
    assert plan.clear_distance == pytest.approx(30.0)
    assert 30.0 - 0.2 - 0.55 <= plan.progress <= 30.0 - 0.2
    assert plan.speed.max() == pytest.approx(4.0, abs=0.01)
    assert_sound(plan, ATV, plane())


def test_what_the_error_of_a_map_keeps_free_before_the_end_blocks_nothing() -> None:
    planner = CandidatePlanner(model_of(ATV), uncertainty=Uncertainty())
    ground = dataclasses.replace(plane(rise=-0.1), height_std=0.1)
    (plan,) = planner.plan(ground, [straight(20.0)])
    # More than the offset of 0.2 m, and than the metre that any plan may rest early.
    assert plan.progress < plan.station[-1] - 1.2
    assert (plan.status, plan.reason) == (Status.OK, "")


def test_blocked_has_place_and_reason_and_is_as_sound() -> None:
    ground = plane(unknown=lambda x, y: x > 20.0)
    plan = plan_one(ATV, ground, straight(30.0))
    assert plan.status is Status.BLOCKED
    match = re.fullmatch(
        r"stops at (\d+\.\d) m of 30\.0 m: ahead at (\d+\.\d\d) m unknown ground under the body "
        r"at x 20\.25 m, y -?\d\.\d\d m",
        plan.reason,
    )
    assert match
    assert match[1] == f"{plan.progress:.1f}"
    assert plan.clear_distance < float(match[2]) <= plan.clear_distance + 0.5
    # The body 0.88 m ahead, and half of the first unknown cell.
    assert 20.125 - 0.88 - 0.25 <= plan.clear_distance <= 20.125 - 0.88
    assert plan.progress <= plan.clear_distance
    assert_sound(plan, ATV, ground)


def test_blocked_at_the_start_stays_where_it_is() -> None:
    plan = plan_one(ATV, plane(unknown=lambda x, y: x > 0.5), straight(30.0))
    assert plan.status is Status.BLOCKED
    assert plan.clear_distance == 0.0
    assert not plan.speed.any()
    assert plan.travel_time == 0.0
    assert not plan.admissible


def test_the_brakes_that_do_not_hold_a_slope_block_it_with_their_sentence() -> None:
    tables = tables_with(braking={"b_b": 0.15, "b_m": 0.0})
    slope = ground_map(lambda x, y: -0.2 * np.maximum(x - 15.0, 0.0))
    plan = plan_one(tables, slope, straight(30.0))
    assert plan.status is Status.BLOCKED
    assert "the brakes do not hold on grade -" in plan.reason
    assert_sound(plan, tables, slope)


@pytest.mark.parametrize("speed", [1.0, 2.5, 4.0])
def test_infeasible_states_the_deficit(speed: float) -> None:
    clear = 0.25 * speed
    plan = plan_one(ATV, plane(), straight(30.0), start_speed=speed, clear=clear + 0.88)
    assert plan.status is Status.INFEASIBLE
    stop = speed * 0.3 + speed**2 / (2.0 * G * (0.40 + 0.015 * speed)) + 0.2
    assert f"even full braking from {speed:.2f} m/s takes {stop:.2f} m" in plan.reason
    assert f"{stop - clear:.2f} m beyond the clear distance of {clear:.2f} m" in plan.reason
    assert plan.speed[0] == pytest.approx(speed)
    assert plan.stop_distance[0] == pytest.approx(stop, abs=1e-3)
    assert not plan.admissible
    # The plan is that braking, as hard as the brakes can after their dead time.
    assert np.all(np.diff(plan.speed) <= 0.0)
    assert plan.speed[-1] == 0.0
    assert 0.0 < plan.progress <= stop + 0.25


@pytest.mark.parametrize("dead_time", [0.0, 0.5])
@pytest.mark.parametrize("speed", np.linspace(1.0, 6.0, 11))
def test_starts_too_fast_for_a_short_path_are_distinguished(speed: float, dead_time: float) -> None:
    """Sharp waves, and stops that run off their end: finite numbers and a sentence that is true."""
    tables = tables_with(braking={"dead_time": dead_time, "grade_range": [-0.5, 0.5]})
    sharp = ground_map(lambda x, y: 0.1 * np.sin(5.0 * x), resolution=0.2)
    plan = plan_one(tables, sharp, straight(2.0), start_speed=float(speed))
    for name in ARRAYS:
        assert np.isfinite(getattr(plan, name)).all(), name
    assert plan.speed[0] == pytest.approx(speed)
    if plan.status is Status.INFEASIBLE:
        match = re.search(r"takes (\d+\.\d\d) m, (\d+\.\d\d) m beyond", plan.reason)
        if match:
            assert float(match[2]) > 0.0
            assert plan.stop_distance[0] > plan.clear_distance
        else:
            # So tight that to begin a stop any later would be too late.
            assert "only full braking at once stops in time" in plan.reason  # words: ok
            assert 0.0 <= plan.clear_distance - plan.stop_distance[0] < 0.25
    else:
        assert plan.speed[-1] == 0.0
        moving = plan.speed > 0.0
        assert np.all((plan.station + plan.stop_distance)[moving] <= plan.clear_distance + 1e-6)


def test_infeasible_by_load_says_so() -> None:
    """Fast on ground where full braking from that speed lifts the rear axle."""
    tables = tables_with(
        vehicle={"cg_z": 0.72},
        braking={"m_b": 0.08, "b_b": 0.42, "m_m": 0.0, "b_m": 0.0, "speed_range": [0.5, 6.0]},
        limits={"min_load": 0.2, "speed": 6.0},
    )
    plan = plan_one(tables, plane(rise=-0.2, x=(-3.0, 70.0)), straight(60.0), start_speed=4.5)
    assert plan.status is Status.INFEASIBLE
    assert "leaves an axle or side" in plan.reason
    assert plan.rear_load[0] < 0.2


def test_a_start_too_fast_for_service_braking_brakes_harder_but_only_as_long_as_it_must() -> None:
    plan = plan_one(ATV, plane(), straight(30.0), start_speed=3.5, clear=4.0)
    assert plan.status is Status.DEGRADED
    assert "starts at 3.50 m/s" in plan.reason
    assert "brakes at" in plan.reason
    hard = np.flatnonzero(plan.accel < -1.5 - 1e-6)
    assert hard[0] == 0
    assert np.all(np.diff(hard) == 1)
    # Never faster than at the start, and back within comfort in the end.
    assert np.all(np.diff(plan.speed) <= 1e-9)
    assert plan.progress <= 4.0
    moving = plan.speed > 0.0
    assert np.all((plan.station + plan.stop_distance)[moving] <= plan.clear_distance + 1e-6)
    # Nothing but its deceleration exceeds a limit.
    strong = tables_with(limits={"decel": 9.0})
    assert_sound(plan, strong, plane())


def test_a_start_above_the_speed_limit_slows_down_and_reports_it() -> None:
    tables = tables_with(limits={"speed": 2.0})
    plan = plan_one(tables, plane(), straight(30.0), start_speed=3.0)
    assert plan.status is Status.DEGRADED
    assert "above 2.00 m/s (speed_limit)" in plan.reason
    assert plan.speed[0] == pytest.approx(3.0)
    later = plan.station > 2.0
    assert plan.speed[later].max() <= 2.0 + 1e-9
    assert np.all(np.diff(plan.speed[plan.station < 1.0]) < 0.0)


@pytest.mark.parametrize("speed", [0.0, 0.5, 2.0, 3.9])
def test_plans_begin_at_the_speed_there_is(speed: float) -> None:
    plan = plan_one(ATV, plane(), straight(30.0), start_speed=speed)
    assert plan.status is Status.OK
    assert plan.speed[0] == pytest.approx(speed, abs=1e-9)
    assert_sound(plan, ATV, plane())


@pytest.mark.parametrize("slow", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("spacing", [0.1, 0.25, 1.0])
def test_a_slow_stretch_is_driven_slowly_and_not_given_up(slow: float, spacing: float) -> None:
    points = np.stack([np.linspace(0.0, 30.0, 31), np.zeros(31)], axis=1)
    limit = np.where(np.abs(points[:, 0] - 15.0) < 3.5, slow, 9.0)
    path = CandidatePath("p", points, speed_limit=limit)
    plan = plan_one(ATV, plane(), path, PlannerSettings(spacing=spacing))
    assert plan.status is Status.OK
    assert plan.progress > 30.0 - 0.2 - 4.0 * spacing
    inside = np.abs(plan.station - 15.0) < 3.0
    assert plan.speed[inside].max() <= slow + 1e-9
    assert plan.speed[inside].min() > 0.8 * slow
    assert plan.speed.max() > 2.5
    assert_sound(plan, ATV, plane())


@pytest.mark.parametrize("lateral", [0.2, 0.5])
def test_a_sharp_corner_is_driven_slowly_and_not_given_up(lateral: float) -> None:
    corner = CandidatePath("corner", np.array([(0.0, 0.0), (12.0, 0.0), (16.0, 4.0)]))
    tables = tables_with(limits={"lateral_accel": lateral})
    plan = plan_one(tables, plane(), corner)
    assert plan.status is Status.OK
    assert plan.progress > plan.station[-1] - 0.2 - 1.0
    assert_sound(plan, tables, plane())


def test_a_stop_line_on_the_path_is_stopped_at_and_left_again_or_blocks() -> None:
    """A path's limit of zero at one point: in any case ok means that it arrives."""
    points = np.stack([np.linspace(0.0, 20.0, 21), np.zeros(21)], axis=1)
    limit = np.where(np.arange(21) == 10, 0.0, 3.0)
    plan = plan_one(ATV, plane(), CandidatePath("p", points, speed_limit=limit))
    assert plan.progress > 5.0
    if plan.status is Status.OK:
        assert plan.progress > 18.0
    else:
        assert plan.status is Status.BLOCKED
        assert "speed" in plan.reason
    assert_sound(plan, ATV, plane())


def test_an_undrivable_candidate_does_not_spoil_its_neighbours() -> None:
    ground = plane(unknown=lambda x, y: y > 3.0)
    trained, turned = straight(20.0, name="good"), straight(20.0, 0.4, name="bad")
    plans = CandidatePlanner(model_of(ATV)).plan(ground, [trained, turned, trained])
    assert [p.status for p in plans] == [Status.OK, Status.BLOCKED, Status.OK]
    assert [p.candidate for p in plans] == ["good", "bad", "good"]
    np.testing.assert_array_equal(plans[0].speed, plans[2].speed)


# -------------------------------------------------------------------------------- fallbacks


def lazy(problem: SmoothingProblem, _: str) -> Smoothed:
    """Never gets there."""
    return dataclasses.replace(smooth(problem), speed_sq=None, reason="too late")


def reckless(problem: SmoothingProblem, _: str) -> Smoothed:
    """Returns something faster than anything allowed."""
    return dataclasses.replace(smooth(problem), speed_sq=4.0 * problem.speed_sq_max)


@pytest.mark.parametrize("broken", [lazy, reckless])
@pytest.mark.parametrize("ends", [15.0, 99.0])
def test_a_failed_smoother_degrades_the_plan_but_not_its_safety(
    monkeypatch: pytest.MonkeyPatch, broken: Any, ends: float
) -> None:
    monkeypatch.setattr(plan_finalizer, "smooth", broken)
    ground = ground_map(hills, unknown=lambda x, y: x > ends)
    plan = plan_one(ATV, ground, straight(25.0))
    assert plan.status is Status.DEGRADED
    assert "not smoothed" in plan.reason
    assert_sound(plan, ATV, ground)
    rough = plan_one(ATV, ground, straight(25.0), PlannerSettings(smooth=False))
    np.testing.assert_array_equal(plan.speed, rough.speed)
    assert plan.admissible


@pytest.mark.parametrize("solver", ["osqp", "ipopt"])
def test_plans_of_another_solver_are_as_safe_and_as_fast(solver: Any) -> None:
    ground = ground_map(hills)
    default = plan_one(ATV, ground, straight(25.0))
    plan = plan_one(ATV, ground, straight(25.0), PlannerSettings(solver=solver))
    assert plan.status is Status.OK
    assert_sound(plan, ATV, ground, jerk=True)
    assert not np.array_equal(plan.speed, default.speed)
    assert plan.travel_time == pytest.approx(default.travel_time, rel=0.02)


def test_where_the_verifier_rejects_the_chosen_solver_the_default_one_is_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def too_fast(problem: SmoothingProblem, solver: str) -> Smoothed:
        return reckless(problem, solver) if solver == "osqp" else smooth(problem)

    monkeypatch.setattr(plan_finalizer, "smooth", too_fast)
    ground = ground_map(hills)
    plan = plan_one(ATV, ground, straight(25.0), PlannerSettings(solver="osqp"))
    assert plan.status is Status.OK
    np.testing.assert_array_equal(plan.speed, plan_one(ATV, ground, straight(25.0)).speed)


def test_a_solver_that_there_is_none_of_is_refused() -> None:
    with pytest.raises(ParameterError, match="interior_point, osqp, ipopt"):
        PlannerSettings(solver="simplex")  # type: ignore[arg-type]


def test_without_smoothing_plans_are_faster_rougher_and_as_safe() -> None:
    ground, path = ground_map(hills), straight(25.0)
    rough = plan_one(ATV, ground, path, PlannerSettings(smooth=False))
    smooth = plan_one(ATV, ground, path)
    assert rough.status is smooth.status is Status.OK
    assert rough.travel_time < smooth.travel_time
    assert "jerk" not in labels(rough)
    assert "jerk" in labels(smooth)
    assert_sound(rough, ATV, ground, jerk=False)
    assert_sound(smooth, ATV, ground, jerk=True)


# ---------------------------------------------------------------------------------- effects

LEVEL_ROAD = {"limits": {"decel": 9.0, "jerk": 200.0, "accel": 3.0}}
EFFECTS: dict[str, tuple[str, dict[str, float], int, dict[str, float]]] = {
    # what, parameters, sign of its change of the bound, and slope of the ground (rise, cross)
    "drag": ("aerodynamic_drag", {"c": 0.05}, +1, {}),
    "headwind": ("headwind", {"c": 0.02, "wind": 8.0, "direction": 0.0}, +1, {}),
    "tailwind": ("headwind", {"c": 0.02, "wind": -8.0, "direction": 0.0}, -1, {}),
    "tailwind by direction": ("headwind", {"c": 0.02, "wind": 8.0, "direction": np.pi}, -1, {}),
    "viscous": ("viscous_resistance", {"c": 0.03}, +1, {}),
    "lag": ("brake_lag", {"tau": 0.3}, -1, {}),
    "fade": ("brake_fade", {"k": 0.05, "tau": 100.0}, -1, {}),
    "lockup": ("wheel_lockup", {"mu": 0.3}, -1, {}),
    "asymmetry, weaker uphill": ("grade_asymmetry", {"k": -0.4}, -1, {"rise": 0.15}),
    "asymmetry, stronger uphill": ("grade_asymmetry", {"k": 0.4}, +1, {"rise": 0.15}),
    "nonlinearity downhill": ("grade_nonlinearity", {"k": 2.0}, -1, {"rise": -0.15}),
    "nonlinearity uphill": ("grade_nonlinearity", {"k": 2.0}, +1, {"rise": 0.15}),
    "cross slope": ("cross_slope", {"k": -0.4}, -1, {"cross": 0.15}),
    "patch of ice": (
        "surface_patch",
        {"delta": -0.25, "x": 11.0, "y": 0.0, "radius": 3.0},
        -1,
        {},
    ),
    "patch of rubber": (
        "surface_patch",
        {"delta": 0.25, "x": 11.0, "y": 0.0, "radius": 3.0},
        +1,
        {},
    ),
    "along the furrows": ("directional_surface", {"k": -0.1, "direction": 0.0}, -1, {}),
    "across the furrows": ("directional_surface", {"k": -0.1, "direction": np.pi / 2}, +1, {}),
    "worn brakes": ("step_change", {"scale": 0.75}, -1, {}),
    "lasting loss": ("step_change", {"delta": -0.1}, -1, {}),
    "new brakes": ("step_change", {"scale": 1.25, "delta": 0.05}, +1, {}),
}


def stop_bound(plan: SpeedPlan) -> np.ndarray:
    """Speed bounds where a stop decides them."""
    limited = plan.limiting == Limiting.STOPPING_PATH
    return np.where(limited, plan.speed_bound, np.nan)


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_change_the_stopping_bound_in_their_direction(name: str) -> None:
    effect, parameters, sign, slope = EFFECTS[name]
    tables = tables_with((effect, parameters), **LEVEL_ROAD)
    ground, path = plane(**slope), straight(13.0)
    plain = plan_one(tables_with(**LEVEL_ROAD), ground, path)
    plan = plan_one(tables, ground, path)
    assert plan.status is Status.OK, plan.reason
    # 2 m before the end nothing but the stop matters.
    k = int(np.argmin(np.abs(plain.station - (plain.station[-1] - 2.0))))
    change = plan.speed_bound[k] / plain.speed_bound[k] - 1.0
    assert sign * change > 0.01, change
    assert_sound(plan, tables, ground)


def test_turning_resistance_helps_to_stop_in_turns_only() -> None:
    tables = tables_with(("turning_resistance", {"k": 0.3}), **LEVEL_ROAD)
    plain = tables_with(**LEVEL_ROAD)
    for path, helps in ((arc(7.0, 0.3), True), (straight(7.0), False)):
        with_it, without = plan_one(tables, plane(), path), plan_one(plain, plane(), path)
        k = int(np.argmin(np.abs(without.station - (without.station[-1] - 1.0))))
        gain = with_it.speed_bound[k] - without.speed_bound[k]
        assert gain > 0.01 if helps else gain == pytest.approx(0.0, abs=5e-3)
        assert_sound(with_it, tables, plane())


def test_hot_brakes_fade_from_the_start_and_late_sessions_drift() -> None:
    tables = tables_with(
        ("brake_fade", {"k": 0.02, "tau": 100.0}), ("session_drift", {"k": -1e-4}), **LEVEL_ROAD
    )
    planner = CandidatePlanner(model_of(tables))

    def bound(conditions: GroundConditions) -> float:
        (plan,) = planner.plan(plane(), [straight(13.0)], conditions=conditions)
        return at(plan, 10.0, plan.speed_bound)

    cold = bound(GroundConditions())
    assert bound(GroundConditions(brake_heat=20.0)) < 0.97 * cold
    assert bound(GroundConditions(session_time=900.0)) < 0.97 * cold

    def lasting(delta: float) -> float:
        tables = tables_with(
            ("brake_fade", {"k": 0.02, "tau": 100.0}),
            ("step_change", {"delta": delta}),
            **LEVEL_ROAD,
        )
        plan = plan_one(tables, plane(), straight(13.0))
        return at(plan, 10.0, plan.speed_bound)

    # Late is the same as a lasting loss of what is gone until the vehicle has come by and stopped.
    late = bound(GroundConditions(session_time=900.0))
    assert late < lasting(-1e-4 * 910.0)
    assert late == pytest.approx(lasting(-1e-4 * (900.0 + 13.0 / 0.25 + 15.0)), rel=2e-3)


def test_brakes_that_get_stronger_with_time_count_as_they_are_now() -> None:
    plain, drifting = (
        plan_one(tables_with(*effects, **LEVEL_ROAD), plane(), straight(13.0))
        for effects in ((), [("session_drift", {"k": 1e-3})])
    )
    np.testing.assert_allclose(drifting.speed_bound, plain.speed_bound, atol=1e-9)


# ------------------------------------------------------------------------------- bookkeeping


def test_plans_are_finite_and_their_motion_adds_up() -> None:
    ground = ground_map(hills, unknown=lambda x, y: x > 7.0)
    plans = CandidatePlanner(model_of(ATV)).plan(ground, fan())
    assert {p.status for p in plans} >= {Status.OK, Status.BLOCKED}
    for plan in plans:
        n = len(plan.station)
        for name in ARRAYS:
            array = getattr(plan, name)
            assert array.shape == (n,), name
            assert np.isfinite(array).all(), name
        accel, time = motion_of(plan.station, plan.speed**2)
        np.testing.assert_allclose(plan.accel, accel, atol=1e-9)
        np.testing.assert_allclose(plan.time, time, atol=1e-9)
        assert np.all(plan.speed <= plan.speed_bound)
        reached = plan.station <= plan.progress
        ends = plan.station + plan.stop_distance
        assert np.all(ends[reached] <= plan.clear_distance + 1e-6)
        assert np.all(np.diff(plan.station) > 0.0)
        assert np.all(np.diff(plan.time) >= 0.0)
        assert set(plan.limiting) <= set(Limiting)


def test_the_same_question_has_the_same_answer() -> None:
    ground, paths = ground_map(hills), fan()
    planner = CandidatePlanner(model_of(ATV))
    first = planner.plan(ground, paths, start_speed=0.5)
    # Also after other requests, from the same planner and from a new one.
    planner.plan(ground, paths[::-1], start_speed=1.0, clear=4.0)
    for again in (
        planner.plan(ground, paths, start_speed=0.5),
        CandidatePlanner(model_of(ATV)).plan(ground, paths, start_speed=0.5),
    ):
        for a, b in zip(first, again, strict=True):
            assert (a.candidate, a.status, a.reason) == (b.candidate, b.status, b.reason)
            for name in ARRAYS:
                np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def test_alone_or_in_a_crowd_of_more_than_one_batch_a_candidate_is_the_same() -> None:
    ground = ground_map(hills)
    paths = [arc(4.0 + 0.01 * i, 0.002 * i - 0.311, name=str(i)) for i in range(300)]
    calls: list[int] = []
    planner = CandidatePlanner(model_of(ATV))
    crowd = planner.plan(ground, paths, progress=calls.append)
    assert [p.candidate for p in crowd] == [p.name for p in paths]
    assert sum(calls) == 300
    for i in (0, 255, 256, 299):
        (alone,) = planner.plan(ground, [paths[i]])
        assert alone.status is crowd[i].status
        np.testing.assert_allclose(alone.speed, crowd[i].speed, atol=1e-9)


def test_no_candidates_no_plans() -> None:
    assert CandidatePlanner(model_of(ATV)).plan(plane(), []) == []


def test_malformed_paths_are_named() -> None:
    cusp = CandidatePath("there and back", np.array([(0.0, 0.0), (5.0, 0.0), (0.0, 0.3)]))
    with pytest.raises(ParameterError) as caught:
        CandidatePlanner(model_of(ATV)).plan(plane(), [straight(5.0), cusp])
    assert caught.value.field == "there and back.points[1]"


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"start_speed": -0.1}, "speed"),
        ({"start_speed": np.nan}, "speed"),
        ({"start_speed": np.inf}, "speed"),
        ({"clear": -1.0}, "clear"),
        ({"clear": np.nan}, "clear"),
    ],
)
def test_impossible_questions_are_refused(options: dict[str, float], field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        CandidatePlanner(model_of(ATV)).plan(plane(), [straight(5.0)], **options)
    assert caught.value.field == field


# ---------------------------------------------------------------------------------- ranking


def test_ranking_is_travel_time_plus_a_charge_for_what_is_not_reached() -> None:
    station = np.stack([np.arange(5.0)] * 2, axis=1)
    speed_sq = np.array([(4.0, 4.0), (4.0, 4.0), (4.0, 0.0), (4.0, 0.0), (4.0, 0.0)])
    cost = travel_cost(station, speed_sq, 3.0)
    np.testing.assert_allclose(cost, [4 / 2.0, 1 / 2.0 + 2.0 / 2.0 + 3.0 * 2.0])


def test_a_blocked_candidate_costs_more_than_a_detour() -> None:
    ground = plane(y=(-6.0, 15.0), unknown=lambda x, y: (x > 9.0) & (y < 1.0))
    ahead, around = straight(16.0, name="ahead"), arc(16.0, 0.12, name="around")
    part = batch([ahead, around], 0.25)
    solved = time_optimal_batch(ground, part, model_of(ATV))
    assert solved.cost[0] > solved.cost[1]
    plans = CandidatePlanner(model_of(ATV)).plan(ground, [ahead, around])
    assert [p.status for p in plans] == [Status.BLOCKED, Status.OK]


def test_the_batch_is_what_plans_are_made_from() -> None:
    ground, paths = ground_map(hills), fan()
    part = batch(paths, 0.25)
    model = model_of(ATV)
    solved = time_optimal_batch(ground, part, model, start_speed=0.7, clear=5.0)
    rough = CandidatePlanner(model, PlannerSettings(smooth=False)).plan(
        ground, paths, start_speed=0.7, clear=5.0 + 0.88
    )
    for j, plan in enumerate(rough):
        n = len(plan.station)
        # Time-optimal profiles are faster at most by the reduction of the verifier.
        assert np.all(plan.speed <= np.sqrt(solved.speed_sq[:n, j]) + 1e-9)
        assert plan.travel_time >= solved.cost[j] - 2.0 * 16.0
        assert np.mean(np.abs(plan.speed - np.sqrt(solved.speed_sq[:n, j])) < 1e-9) > 0.8


# --------------------------------------------------------------------------- between stations


def serpentine(amplitude: float, wavelength: float, length: float = 24.0) -> CandidatePath:
    x = np.arange(0.0, length, wavelength / 40.0)
    return CandidatePath("s", np.stack([x, amplitude * np.sin(2.0 * np.pi * x / wavelength)], 1))


@pytest.mark.parametrize("spacing", [0.1, 0.5, 1.0])
@pytest.mark.parametrize(
    ("tables", "ground"),
    [
        (tables_with(limits={"lateral_accel": 0.6}), plane()),
        (
            tables_with(vehicle={"cg_z": 0.6}, limits={"lateral_accel": 20.0, "min_load": 0.25}),
            ground_map(lambda x, y: 0.12 * np.sin(x / 1.5) + 0.05 * y),
        ),
        (
            tables_with(limits={"decel": 9.0, "jerk": 50.0}),
            ground_map(lambda x, y: 0.25 * np.sin(x / 1.2), unknown=lambda x, y: x > 18.0),
        ),
    ],
    ids=["lateral", "loads", "stops"],
)
def test_nothing_is_breached_between_coarse_stations(
    tables: Tables, ground: ElevationMap, spacing: float
) -> None:
    settings = PlannerSettings(spacing=spacing)
    for path in (serpentine(0.3, 6.0), straight(22.0)):
        plan = plan_one(tables, ground, path, settings)
        assert plan.speed.any()
        assert_sound(plan, tables, ground)


def test_a_spike_of_curvature_is_passed_slowly_between_stations_too() -> None:
    corner = CandidatePath("corner", np.array([(0.0, 0.0), (10.0, 0.0), (14.0, 4.0)]))
    tables = tables_with(limits={"lateral_accel": 0.3})
    plan = plan_one(tables, plane(), corner, PlannerSettings(spacing=1.0))
    assert np.abs(plan.curvature).max() > 0.2
    assert "lateral" in labels(plan)
    assert_sound(plan, tables, plane())
