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
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.braking_ground import GroundConditions
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.limiting import Limiting
from slopewise.planner.pipeline import plan_finalizer
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.profile.smoothing import Smoothed, SmoothingProblem, smooth
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import arc, ground_map, hills, plane, straight
from tests.world.plans import assert_sound, at, plan_one
from tests.world.vehicles import ATV, G, Tables, model_of, tables_with

NO_ARRAYS = ("candidate", "status", "reason", "clear_distance", "obstacle", "momentum")
ARRAYS = tuple(
    field.name
    for field in dataclasses.fields(SpeedPlan)
    if field.name not in (*NO_ARRAYS, "path_deviation")
)


def fan(count: int = 9) -> list[CandidatePath]:
    return [arc(6.0 + 0.3 * i, 0.05 * (i - 4.1), name=f"c{i}") for i in range(count)]


@pytest.mark.parametrize(
    ("path", "options", "field"),
    [
        (straight(5.0), {"start_speed": -0.1}, "speed"),
        (straight(5.0), {"start_speed": np.nan}, "speed"),
        (straight(5.0), {"start_speed": np.inf}, "speed"),
        (straight(5.0), {"clear": -1.0}, "clear"),
        (straight(5.0), {"clear": np.nan}, "clear"),
    ],
)
def test_impossible_questions_are_refused(
    path: CandidatePath, options: dict[str, float], field: str
) -> None:
    planner = CandidatePlanner(model_of(ATV))
    with pytest.raises(ParameterError) as caught:
        planner.plan(plane(), [straight(5.0), path], **options)
    assert caught.value.field == field
    assert planner.plan(plane(), []) == []


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


@pytest.mark.parametrize("speed", [1.0, 2.5, 4.0])
def test_infeasible_states_the_deficit(speed: float) -> None:
    clear = 0.25 * speed
    plan = plan_one(ATV, plane(), straight(30.0), start_speed=speed, clear=clear + 0.88)
    assert plan.status is Status.INFEASIBLE
    stop = speed * 0.3 + speed**2 / (2.0 * G * (0.40 + 0.015 * speed)) + 0.2
    assert f"even full braking from {speed:.2f} m/s takes {stop:.2f} m" in plan.reason
    assert f"{stop - clear:.2f} m beyond the clear distance of {clear:.2f} m: the" in plan.reason
    assert f"known up to {clear + 0.88:.2f} m only" in plan.reason
    assert plan.speed[0] == pytest.approx(speed)
    assert plan.stop_distance[0] == pytest.approx(stop, abs=1e-3)
    assert not plan.admissible
    # The plan is that braking, as hard as the brakes can after their dead time.
    assert np.all(np.diff(plan.speed) <= 0.0)
    assert plan.speed[-1] == 0.0
    assert 0.0 < plan.progress <= stop + 0.25


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


LEVEL_ROAD = {"limits": {"decel": 9.0, "jerk": 200.0, "accel": 3.0}}
HOT = ("brake_fade", {"k": 0.02, "tau": 100.0})


def bound_at_10_m(*effects: tuple[str, dict[str, float]], **conditions: float) -> float:
    planner = CandidatePlanner(model_of(tables_with(*effects, **LEVEL_ROAD)))
    (plan,) = planner.plan(plane(), [straight(13.0)], conditions=GroundConditions(**conditions))
    return at(plan, 10.0, plan.speed_bound)


def test_hot_brakes_fade_from_the_start_and_late_sessions_drift() -> None:
    cold = bound_at_10_m(HOT)
    assert bound_at_10_m(HOT, brake_heat=20.0) < 0.97 * cold
    # Late is the same as a lasting loss of what is gone until the vehicle has come by and stopped.
    late = bound_at_10_m(HOT, ("session_drift", {"k": -1e-4}), session_time=900.0)
    gone = 1e-4 * (900.0 + 13.0 / 0.25 + 15.0)
    assert late < 0.97 * cold
    assert late == pytest.approx(bound_at_10_m(HOT, ("step_change", {"delta": -gone})), rel=2e-3)
    # Brakes that get stronger with time count with their present force.
    assert bound_at_10_m(("session_drift", {"k": 1e-3})) == pytest.approx(bound_at_10_m(), abs=1e-9)


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
        accel, time = core.motion(plan.station, plan.speed**2)
        np.testing.assert_allclose(plan.accel, accel, atol=1e-9)
        np.testing.assert_allclose(plan.time, time, atol=1e-9)
        assert np.all(plan.speed <= plan.speed_bound)
        reached = plan.station <= plan.progress
        ends = plan.station + plan.stop_distance
        assert np.all(ends[reached] <= plan.clear_distance + 1e-6)
        assert np.all(np.diff(plan.station) > 0.0)
        assert np.all(np.diff(plan.time) >= 0.0)
        assert set(plan.limiting) <= set(Limiting)


def test_alone_or_in_a_crowd_of_more_than_one_batch_a_candidate_is_the_same() -> None:
    ground = ground_map(hills)
    paths = [arc(4.0 + 0.01 * i, 0.002 * i - 0.311, name=str(i)) for i in range(260)]
    calls: list[int] = []
    planner = CandidatePlanner(model_of(ATV))
    crowd = planner.plan(ground, paths, progress=calls.append)
    assert [p.candidate for p in crowd] == [p.name for p in paths]
    assert sum(calls) == 260
    for i in (0, 255, 256):
        (alone,) = planner.plan(ground, [paths[i]])
        assert alone.status is crowd[i].status
        np.testing.assert_allclose(alone.speed, crowd[i].speed, atol=1e-9)


SERPENTINE = np.stack([x := np.arange(0.0, 24.0, 0.15), 0.3 * np.sin(2.0 * np.pi * x / 6.0)], 1)


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
def test_nothing_is_breached_between_coarse_stations(tables: Tables, ground: ElevationMap) -> None:
    for path in (CandidatePath("serpentine", SERPENTINE), straight(22.0)):
        plan = plan_one(tables, ground, path, PlannerSettings(spacing=1.0))
        assert plan.speed.any()
        assert_sound(plan, tables, ground)


@pytest.mark.parametrize(("slow", "spacing"), [(0.3, 1.0), (1.0, 0.1), (2.0, 0.25)])
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


def mixed_paths(rng: np.random.Generator) -> list[CandidatePath]:
    """Bent lines of 1 to 30 m in the middle of a map of 60 m."""
    paths = []
    for i in range(14):
        length, heading = rng.choice([1.2, 3.0, 8.0, 20.0, 30.0]), rng.uniform(0.0, 6.28)
        u = np.linspace(0.0, 1.0, 5)[:, None]
        ahead = np.array([np.cos(heading), np.sin(heading)])
        sideways = rng.uniform(-0.1, 0.1) * length * np.sin(3.0 * u) * ahead[::-1] * [-1.0, 1.0]
        points = rng.uniform(20.0, 40.0, 2) + u * length * ahead + sideways
        paths.append(CandidatePath(f"c{i}", np.clip(points, 2.0, 57.0)))
    return paths


@pytest.mark.parametrize("seed", range(6))
def test_a_plan_depends_on_no_other_candidate(seed: int) -> None:
    """Slow and fast surfaces, early and late brakes, slopes that a cut drive runs off on."""
    rng, cell = np.random.default_rng(seed), (0.2, 0.5, 1.0)[seed % 3]
    x, y = np.meshgrid(*[cell * np.arange(round(60.0 / cell))] * 2)
    waves = rng.uniform([0.3, 4.0, 4.0], [1.2, 12.0, 12.0], (3, 3))
    mud = {"speed_range": [1.0, 6.0], "dead_time": 0.5, "b_b": 0.4}
    ground = ElevationMap(
        elevation=sum(a * np.sin(x / b) * np.cos(y / c) for a, b, c in waves),
        resolution=cell,
        origin=(0.0, 0.0),
        terrain_class=((x // 12 + y // 9) % 3).astype(np.int64),
        class_names=("", "mud", "ice"),
    )
    surfaces = {"mud": mud, "ice": mud | {"speed_range": [1.0, 2.0], "dead_time": 0.1}}
    patch = ("surface_patch", {"delta": -0.1, "x": 30.0, "y": 30.0, "radius": 6.0})
    model = model_of(tables_with(patch, braking={"terrain": surfaces}))
    planner = CandidatePlanner(model, uncertainty=Uncertainty())
    paths = mixed_paths(rng)
    together = planner.plan(ground, paths, start_speed=float(seed % 2))
    for path, plan in zip(paths, together, strict=True):
        (alone,) = planner.plan(ground, [path], start_speed=float(seed % 2))
        assert (alone.status, alone.reason) == (plan.status, plan.reason)
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(alone, name), getattr(plan, name), err_msg=name)
