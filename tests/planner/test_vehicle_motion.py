"""Steering and the lateral band in plans, against separate kinematics and geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.interpolate import CubicSpline

import slopewise
from benchmarks.tracking.passes import poses_on, strikes, wheels_beyond
from benchmarks.tracking.tracking_benchmark import TRACKING, arc_scene, circle, pass_scene
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import Tracking, input_errors, lateral_band
from slopewise.models.parameters import Model
from slopewise.models.steering import Steering
from slopewise.planner.limiting import Limiting
from slopewise.planner.path import batch
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.verify.verifier import Violations, screen
from tests.world.hazards import rough_ground

ATV = slopewise.read_model("atv")
ACKERMANN = replace(ATV, vehicle=replace(ATV.vehicle, drive="ackermann"))
FLAT = ElevationMap(elevation=np.zeros((300, 400)), resolution=0.1, origin=(-10.0, -10.0))


def planned(
    model: Model, ground: ElevationMap, path: CandidatePath, quantile: float = 0.999
) -> SpeedPlan:
    return slopewise.plan(model, ground, [path], quantile=quantile)[0]


def test_zeros_change_no_bit_of_a_plan() -> None:
    zeros = replace(ATV, steering=Steering(kind="skid_steer"), tracking=Tracking())
    for seed in range(4):
        ground = rough_ground(seed, 0.1, 0.28)
        path = CandidatePath("drawn", np.array([[2.0, 2.0], [6.0, 3.5], [10.0, 2.5]]))
        plan, same = (planned(model, ground, path) for model in (ATV, zeros))
        assert (plan.reason, plan.clear_distance) == (same.reason, same.clear_distance)
        for name in ("speed", "stop_distance", "speed_bound", "limiting", "rear_load"):
            np.testing.assert_array_equal(getattr(plan, name), getattr(same, name), strict=True)


def test_an_ackermann_vehicle_strikes_no_wall_on_arcs() -> None:
    """Lines planned as if the body had the heading of the path do strike."""
    rng, struck, ignorant, driven = np.random.default_rng(5), 0, 0, 0
    for _ in range(14):
        path, ground = arc_scene(ACKERMANN, rng)
        for model in (ACKERMANN, ATV):
            plan = planned(model, ground, path)
            stop = int(np.argmax(plan.station >= plan.progress)) + 1
            if stop < 4:
                continue
            hit = strikes(poses_on(plan.x[:stop], plan.y[:stop], ACKERMANN), ACKERMANN, ground)
            driven += model is ACKERMANN
            struck += model is ACKERMANN and bool(hit.any())
            ignorant += model is ATV and bool(hit.any())
    assert driven >= 8
    assert struck == 0
    assert ignorant > 0


@pytest.mark.parametrize("radius", [0.5, 1.0, 1.8, 2.0])
def test_no_turn_is_tighter_than_the_min_radius(radius: float) -> None:
    """The least radius is 1.853 m: hypot(1.2 / tan 0.6, 0.6)."""
    path = circle(radius, 4.0, lead=2.0)
    plan = planned(ACKERMANN, FLAT, path)
    if radius > 1.853:
        assert plan.status.value == "ok", plan.reason
        return
    assert plan.status.value == "blocked"
    assert "turns tighter than the vehicle can" in plan.reason
    assert "at least 1.85 m" in plan.reason
    assert Limiting.STEERING in plan.limiting
    # The steering is not turned too far before the body has turned into the circle.
    assert plan.progress > 1.5
    assert planned(ATV, FLAT, path).status.value == "ok"


def test_the_steering_rate_limits_speed_where_curvature_changes() -> None:
    """Angle of the front wheels from the planned line alone, by the bicycle's own equation."""
    x = np.linspace(0.0, 20.0, 81)
    path = CandidatePath("slalom", np.column_stack([x, 0.6 * np.cos(2.0 * np.pi * x / 9.0)]))
    quick = planned(ACKERMANN, FLAT, path)
    rate = 0.3
    limited = replace(ACKERMANN, steering=Steering(kind="ackermann", max_rate=rate))
    plan = planned(limited, FLAT, path)
    assert plan.status.value == "ok", plan.reason
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(plan.x), np.diff(plan.y)))))
    line = CubicSpline(arc, np.column_stack([plan.x, plan.y]))
    s = np.linspace(0.0, arc[-1], 2000)
    first, second = line(s, 1), line(s, 2)
    curvature = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    rod = 0.5 * ATV.vehicle.wheelbase
    beta = solve_ivp(
        lambda at, b: np.interp(at, s, curvature) - np.sin(b) / rod,
        (0.0, arc[-1]),
        [0.0],
        t_eval=s,
        max_step=0.05,
    ).y[0]
    angle = np.arctan(2.0 * np.tan(beta))
    settled = (s > 3.0) & (s < arc[-1] - 1.0)

    def fastest_rate(driven: SpeedPlan) -> float:
        speed = np.sqrt(np.interp(s, arc, driven.speed**2))
        return float((speed * np.abs(np.gradient(angle, s)))[settled].max())

    assert fastest_rate(quick) > 1.5 * rate
    assert 0.8 * rate < fastest_rate(plan) < 1.06 * rate
    assert Limiting.STEERING in plan.limiting
    assert cumulative_trapezoid(plan.speed, arc)[-1] > 0.0


def test_the_verifier_objects_to_turns_that_the_steering_cannot_make() -> None:
    x = np.linspace(0.0, 20.0, 81)
    slalom = CandidatePath("slalom", np.column_stack([x, 0.6 * np.cos(2.0 * np.pi * x / 9.0)]))
    paths = batch([slalom, circle(1.5, 3.0, lead=2.0)], 0.1)
    loose = replace(ACKERMANN, steering=Steering(kind="ackermann", min_radius=0.7))
    strict = replace(ACKERMANN, steering=Steering(kind="ackermann", max_angle=0.6, max_rate=0.3))
    solved = time_optimal_batch(FLAT, paths, loose)
    stages = (solved.profile, solved.ground, solved.bounds, solved.speed_sq)
    index = [Violations._fields.index(name) for name in ("turning", "steering_rate")]
    assert screen(*stages, loose)[:, index].max() == 0.0
    worst = screen(*stages, strict)[:, index]
    assert worst[0, 1] > 0.3
    assert worst[1, 0] > 0.05
    slower = time_optimal_batch(FLAT, paths, strict)
    verified = screen(slower.profile, slower.ground, slower.bounds, slower.speed_sq, strict)
    assert verified[:, index].max() == 0.0


def test_a_late_stop_ends_within_the_clear_distance() -> None:
    path = CandidatePath("straight", np.array([[0.0, 0.0], [14.0, 0.0]]))
    late = Tracking(along_track_std=0.1, latency=0.2, latency_std=0.05)
    plan = planned(replace(ATV, tracking=late), FLAT, path)
    z = 3.0902323
    begun = plan.station + z * 0.1 + plan.speed * (0.2 + z * 0.05)
    moving = plan.speed > 0.0
    left = plan.clear_distance - (begun + plan.stop_distance)[moving]
    assert left.min() >= -1e-6
    # Braking grows slightly weaker with speed: what the brakes' own margin leaves is no more.
    assert left.min() < 0.25
    assert planned(ATV, FLAT, path).travel_time < plan.travel_time


@pytest.mark.parametrize(
    "kind", ["wall", *(pytest.param(k, marks=pytest.mark.nightly) for k in ("post", "cliff"))]
)
def test_passes_with_errors_touch_no_more_often_than_promised(kind: str) -> None:
    """Free widths around the band, 4,000 draws; plans without it touch far more often."""
    rng, quantile, count = np.random.default_rng(2), 0.9, 250
    tracked = replace(ATV, tracking=TRACKING)
    band = lateral_band(input_errors(TRACKING, quantile), ATV.vehicle.shape.front)
    contact = wheels_beyond if kind == "cliff" else strikes
    touched, draws, ignorant, blocked = 0, 0, 0, 0
    for n in range(16):
        spare = band * (0.4 if n % 4 == 0 else 1.0 + 0.1 * n)
        path, ground = pass_scene(kind, ATV, spare, rng)
        plan, careless = (planned(m, ground, path, quantile) for m in (tracked, ATV))
        errors = rng.standard_normal((count, 2))
        errors *= [TRACKING.cross_track_std, TRACKING.heading_std]
        poses = poses_on(plan.x, plan.y, ATV)
        third = len(poses.x) // 3
        poses = type(poses)(*(part[third : 2 * third : 2] for part in poses))
        hits = int(contact(poses, ATV, ground, errors).sum())
        ignorant += hits if careless.status.value == "ok" else 0
        if plan.status.value == "ok":
            touched, draws = touched + hits, draws + count
        else:
            blocked += n % 4 == 0
    assert blocked == 4  # narrower than the band
    assert draws >= 9 * count
    assert touched <= (1.0 - quantile) * draws
    assert ignorant > 2 * touched + 50


def test_off_a_line_over_a_plane_the_ground_is_as_on_it() -> None:
    """However the band varies with curvature: the body stays parallel to its line."""
    x, y = np.meshgrid(np.arange(-5.0, 26.0, 0.25), np.arange(-5.0, 6.0, 0.25))
    ground = ElevationMap(elevation=0.08 * x + 0.15 * y, resolution=0.25, origin=(-5.0, -5.0))
    s = np.linspace(0.0, 20.0, 81)
    path = CandidatePath("winding", np.column_stack((s, 0.25 * np.sin(2.0 * s))))
    band = Tracking(cross_track_std=0.1, cross_track_per_curvature=0.1)
    exact, wide = (
        planned(replace(ATV, tracking=tracking), ground, path) for tracking in (None, band)
    )
    assert exact.progress > 15.0
    assert wide.speed == pytest.approx(exact.speed, abs=1e-3)
