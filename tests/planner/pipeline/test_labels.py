"""Labels of limiting bounds, the ranking of plans, and what an emergency stop keeps.

Hills that thrust alone cannot climb: the reported speed, against an integrator in time.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage
from scipy.integrate import solve_ivp

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Model
from slopewise.planner.compiled_core import core
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import HorizonSettings, PlanarState
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.candidate_column import CandidateColumn
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.plan_finalizer import Unfinished, finish
from slopewise.planner.pipeline.ranking import rank, ranking_cost, travel_cost
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.plan import Momentum, SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from slopewise.services.jobs.plan import PlanResult
from slopewise.services.jobs.plan_summary import summarise
from tests.world.ground import arc, ground_map, plane, straight
from tests.world.plans import plan_one
from tests.world.vehicles import ATV, G, Tables, model_of, tables_with


@pytest.mark.parametrize(
    ("speed_sq", "accel", "smoothed", "expected"),
    [
        (4.0, 0.0, True, Limiting.LATERAL),  # at the bound
        (1.0, 1.0, True, Limiting.ACCEL),
        (1.0, -1.5, True, Limiting.DECEL),
        (1.0, 0.3, True, Limiting.JERK),
        (1.0, 0.3, False, Limiting.ACCEL),
        (1.0, -0.3, True, Limiting.JERK),
    ],
)
def test_each_label(speed_sq: float, accel: float, smoothed: bool, expected: Limiting) -> None:
    names = core.labels(
        np.full(3, speed_sq),
        np.full(3, accel),
        np.full(3, 4.0),
        np.full(3, int(Limiting.LATERAL)),
        np.full(2, 1.0),
        np.full(2, 1.5),
        1.0,
        smoothed,
    )
    assert set(names) == {int(expected)}


PATHS = [straight(11.9, name="short"), straight(12.0, name="wide")]
"""The longer one has stations a little farther apart, so more is left behind its last stop."""

DEAR = PlannerSettings(margin_weight=100.0)


def two(settings: PlannerSettings) -> list[SpeedPlan]:
    return CandidatePlanner(model_of(tables_with()), settings).plan(plane(), PATHS)


def test_cost_is_time_plus_missed_distance_less_margin() -> None:
    plan, _ = two(PlannerSettings())
    settings = PlannerSettings(horizon_penalty=3.0, margin_weight=0.7, margin_enough=100.0)
    missed = plan.station[-1] - plan.progress
    cost = plan.travel_time + 3.0 * missed
    assert travel_cost(plan, settings) == pytest.approx(cost)
    assert ranking_cost(plan, settings) == pytest.approx(cost - 0.7 * plan.least_margin)
    enough = replace(settings, margin_enough=0.1)
    assert ranking_cost(plan, enough) == pytest.approx(cost - 0.07)
    assert ranking_cost(plan, PlannerSettings()) == travel_cost(plan, PlannerSettings())


@pytest.mark.parametrize(
    ("settings", "best"), [(PlannerSettings(), "short"), (DEAR, "wide")], ids=["time", "margin"]
)
def test_plan_and_horizon_choose_by_the_same_weights(settings: PlannerSettings, best: str) -> None:
    plans = two(settings)
    assert plans[1].least_margin > plans[0].least_margin
    assert rank(plans, settings)[0].candidate == best
    horizon = Horizon(model_of(tables_with()), HorizonSettings(budget=60.0), settings)
    answer = horizon.step(PlanarState(x=0.0, y=0.0, heading=0.0, speed=0.0), PATHS, plane())
    assert answer.chosen.candidate == best


FOOT, TOP, RISE = 12.0, 16.0, 0.24
FORCE, POWER, RESISTANCE = 1200.0, 6000.0, 0.13


def hill(x: np.ndarray, _: np.ndarray) -> np.ndarray:
    """Level, a slope with rounded ends, level."""
    height: np.ndarray = RISE * (_ramp(x - FOOT) - _ramp(x - TOP))
    return height


def _ramp(u: np.ndarray) -> np.ndarray:
    """max(u, 0), rounded over 1.5 m to either side."""
    r = 1.5
    rounded = (u + r) ** 2 / (4.0 * r)
    return np.where(u < -r, 0.0, np.where(u > r, u, rounded))


def weak(**vehicle: float) -> Tables:
    of_drive = {"max_drive_force": FORCE, "max_drive_power": POWER, **vehicle}
    return tables_with(vehicle=of_drive, braking={"extrapolate": True})


def planned(tables: Tables, length: float = 30.0, **more: float) -> SpeedPlan:
    return plan_one(tables, ground_map(hill), straight(length), **more)


def min_speed_on(plan: SpeedPlan, start: float, speed: float, power: float) -> float:
    """v² at its least between a station and the top, driven at full thrust; 0 if it stalls."""
    weight = 500.0 * G

    def rates(_: float, state: np.ndarray) -> list[float]:
        s, v = state
        grade = np.interp(s, plan.station, plan.grade)
        thrust = min(FORCE, power / max(v, 1e-3)) / weight
        return [v, G * (thrust - np.sin(grade) - RESISTANCE * np.cos(grade))]

    def stalled(_: float, state: np.ndarray) -> float:
        return float(state[1]) - 1e-3

    def over(_: float, state: np.ndarray) -> float:
        return float(state[0]) - 20.0

    stalled.terminal = over.terminal = True  # type: ignore[attr-defined]
    stalled.direction = -1.0  # type: ignore[attr-defined]
    solution = solve_ivp(
        rates,
        (0.0, 60.0),
        [start, speed],
        events=(stalled, over),
        rtol=1e-8,
        atol=1e-10,
        max_step=0.05,
    )
    assert solution.status == 1
    return float(solution.y[1].min()) if len(solution.t_events[1]) else 0.0


def reported_by(plan: SpeedPlan) -> Momentum:
    assert plan.momentum is not None
    return plan.momentum


@pytest.mark.parametrize("power", [POWER, 2500.0])
def test_the_speed_at_the_foot_just_does(power: float) -> None:
    plan = planned(weak(max_drive_power=power))
    solution = reported_by(plan)
    assert FOOT - 2.0 < solution.station < FOOT + 1.0
    assert TOP - 1.0 < solution.until < TOP + 2.0
    assert min_speed_on(plan, solution.station, 1.01 * solution.speed, power) > 0.0
    assert min_speed_on(plan, solution.station, 0.99 * solution.speed, power) == 0.0


def test_a_plan_never_counts_on_it() -> None:
    """The plan rests before the hill, at no speed above its bound, and says why and what lacks."""
    plan = planned(weak())
    solution = reported_by(plan)
    assert plan.status is Status.BLOCKED
    assert solution.allowed
    for message in (
        "needs",
        "the drive has 1200 N: thrust alone cannot climb it",
        "no plan counts on",
        f"at {solution.station:.2f} m to get past {solution.until:.2f} m",
    ):
        assert message in plan.reason
    assert (plan.speed <= plan.speed_bound + 1e-9).all()
    assert plan.progress <= plan.clear_distance <= solution.station + 1e-9
    beyond = plan.station > plan.clear_distance
    assert (plan.speed[beyond] == 0.0).all()


def test_where_the_hill_continues_into_the_unknown_no_speed_is_reported() -> None:
    def ends(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(x < 15.0, hill(x, y), np.nan)

    plan = plan_one(weak(), ground_map(ends), straight(30.0))
    assert plan.momentum is None
    assert plan.reason.endswith("thrust alone cannot climb it")


def test_a_turn_that_thrust_cannot_make_on_level_ground_is_no_climb() -> None:
    there = np.stack([np.arange(0.0, 8.0, 0.1), np.zeros(80)], axis=1)
    hairpin = np.concatenate([there, there[::-1] + np.array([0.0, 0.3])])
    plan = plan_one(weak(), ground_map(lambda x, y: 0.0 * x), CandidatePath("turn", hairpin))
    assert plan.status is Status.BLOCKED
    assert re.search(r"the turn of radius 0\.\d\d m ahead at .* the drive has 1200 N$", plan.reason)


def test_json_holds_it() -> None:
    tables = weak()
    plan = planned(tables)
    result = PlanResult([plan], ground_map(hill), model_of(tables), 0.0)
    row = json.loads(json.dumps(summarise(result).plans[0], allow_nan=False))
    solution = reported_by(plan)
    assert row["momentum"]["speed"] == solution.speed
    assert len(row["momentum"]["stations"]) == len(row["momentum"]["least_speed"]) > 8
    strong = replace(result, plans=[planned(weak(max_drive_force=4000.0))])
    assert "momentum" not in summarise(strong).plans[0]


def test_an_emergency_stop_keeps_its_label_where_there_is_no_time_to_smooth() -> None:
    """In a moving horizon its command is a full stop; that of a plan without smoothing is not."""
    model = model_of(ATV)
    ahead = batch([straight(25.0)], 0.25)
    solved = time_optimal_batch(
        averaged_map(plane(), model.vehicle.wheel_radius),
        ahead,
        model,
        start_speed=3.0,
        clear=np.array([1.0]),
        settings=PlannerSettings(),
    )
    column, given = CandidateColumn(solved, 0, solved.start_sq), Unfinished(solved.profile_of(0))
    plan = finish(column, "a", given, smoothed=False, unsmoothed="late")
    assert plan.status is Status.INFEASIBLE
    assert "full braking" in plan.reason


QUANTILE, LATERAL = 0.9, 0.2  # [1]; [m] of the band
STD = LATERAL / 1.6448536  # the normal quantile of 0.95: a band has two sides
CELL = 0.1  # [m]


def tracked(model: Model, std: float = STD) -> Model:
    return replace(model, tracking=Tracking(cross_track_std=std))


def trough(model: Model, share: float) -> ElevationMap:
    """Two planes that meet along the x axis, y = 0: level across on it alone.

    The wheels stand at |lateral ± width/2| from the fold: their heights differ by twice that
    distance times the slope, which is a share of the trained roll.
    """
    roll, width = share * model.braking.trained_roll[1], model.vehicle.track_width
    y, _ = np.mgrid[-6.0:6.0:CELL, -4.0:30.0:CELL]
    heights = 0.5 * width / LATERAL * math.tan(roll) * np.abs(y)
    return ElevationMap(elevation=heights, resolution=CELL, origin=(-4.0, -6.0))


def plan_on(
    ground: ElevationMap, model: Model, start_speed: float = 0.0, length: float = 20.0
) -> SpeedPlan:
    planner = CandidatePlanner(model, uncertainty=Uncertainty(quantile=QUANTILE))
    return planner.plan(ground, [straight(length)], start_speed=start_speed)[0]


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_roll_at_the_side_of_the_path_counts_as_one_on_it(share: float) -> None:
    model = model_of(ATV)
    ground = trough(model, share)
    exact, band = plan_on(ground, model), plan_on(ground, tracked(model))
    assert abs(exact.roll).max() < 1e-6
    assert exact.status is Status.OK
    if share < 1.0:
        assert band.status is Status.OK
    else:
        assert band.progress == 0.0
        assert band.status is Status.BLOCKED
        assert "next to the path, within the band of tracking errors" in band.reason


def test_a_plan_short_of_its_end_for_ground_next_to_it_is_blocked() -> None:
    """However near the end: a plan that is ok rests for nothing but its stop."""
    model = model_of(ATV)
    ground = trough(model, 1.1)
    x = ground.origin[0] + CELL * np.arange(ground.elevation.shape[1])
    rising = replace(ground, elevation=ground.elevation * np.clip((x - 17.5) / 2.2, 0.0, 1.0))
    plan = plan_on(rising, tracked(model))
    assert 0.3 < plan.station[-1] - plan.progress < 1.1
    assert plan.status is Status.BLOCKED
    assert "next to the path, within the band of tracking errors" in plan.reason


def test_a_vehicle_too_fast_for_ground_next_to_its_path_brakes() -> None:
    model = model_of(ATV)
    plan = plan_on(trough(model, 1.1), tracked(model), start_speed=2.0)
    assert plan.status is Status.INFEASIBLE  # it cannot stop before that ground
    assert "next to the path, within the band of tracking errors" in plan.reason
    assert np.all(np.diff(plan.speed) <= 0.0)


def test_only_ground_next_to_the_path_is_named_as_such() -> None:
    """A wall across the path ends it on the line and at both sides alike."""
    flat = ground_map(lambda x, y: np.where(x > 1.5, 1.0, 0.0), x=(-4.0, 30.0), y=(-6.0, 6.0))
    plan = plan_on(flat, tracked(model_of(ATV)), start_speed=3.0)
    assert plan.status is Status.INFEASIBLE
    assert "ahead at" in plan.reason
    assert "next to the path" not in plan.reason


def rough(seed: int) -> ElevationMap:
    """Smooth ground at random, with slopes of some 8°."""
    heights = np.random.default_rng(seed).standard_normal((120, 340))
    heights = ndimage.gaussian_filter(heights, 10.0)
    return ElevationMap(
        elevation=heights * (0.2 / heights.std()), resolution=CELL, origin=(-4.0, -6.0)
    )


def test_a_band_never_makes_a_plan_faster() -> None:
    model = model_of(ATV)
    slower = 0
    for seed in range(6):
        ground = rough(seed)
        exact, narrow, wide = (
            plan_on(ground, m, length=8.0) for m in (model, tracked(model, 1e-4), tracked(model))
        )
        speed = np.interp(exact.station, wide.station, wide.speed)
        assert np.all(speed <= exact.speed + 1e-6)
        assert narrow.speed == pytest.approx(exact.speed, abs=0.02)
        slower += bool(np.any(speed < exact.speed - 1e-3))
    assert slower > 0


def test_a_repaired_plan_names_what_lowered_it() -> None:
    """Bounds of a turn are raised and called roughness; the verifier finds its lateral limit."""
    model = model_of(ATV)
    solved = time_optimal_batch(plane(), batch([arc(15.0, 0.35)], 0.25), model, start_speed=0.0)
    given = Unfinished(solved.profile_of(0))
    sound = finish(CandidateColumn(solved, 0, solved.start_sq), "a", given, smoothed=False)
    column, turns = CandidateColumn(solved, 0, solved.start_sq), slice(13, 18)
    column.speed_sq_max = column.speed_sq_max.copy()
    column.bound[turns] *= 1.3
    column.speed_sq_max[turns], column.label[turns] = column.bound[turns], Limiting.ROUGHNESS
    plan = finish(column, "a", Unfinished(column.fastest()[0]), smoothed=False)
    assert set(sound.limiting[turns]) == {Limiting.LATERAL}
    assert set(plan.limiting[turns]) == {Limiting.LATERAL}
    assert np.all(plan.speed[turns] <= 1.001 * sound.speed_bound[turns])
    assert np.all(plan.speed_bound[turns] <= 1.001 * sound.speed_bound[turns])
