"""Time-optimal profiles against closed forms, an optimiser, and their own constraints."""

from __future__ import annotations

import dataclasses
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import drive
from slopewise.planner.kernels.limits import PlanningLimits, planning_limits
from slopewise.planner.profile.time_optimal import ProfileProblem, time_optimal_profile
from tests.planner.scenes import G, model_of, tables_with

BIG = 1e9


@dataclasses.dataclass
class Road:
    """One candidate as the profile sees it: level and strong in everything by default."""

    station: np.ndarray
    bound: np.ndarray
    sin_grade: np.ndarray
    lower_slope: np.ndarray
    lower_intercept: np.ndarray
    slowest: np.ndarray
    accel_max: np.ndarray
    demand: np.ndarray
    scalars: PlanningLimits
    start: float = 0.0

    def solve(self, **options: Any) -> tuple[np.ndarray, float]:
        columns = [
            np.ascontiguousarray(c[:, None])
            for c in (
                self.station,
                self.bound**2,
                self.sin_grade,
                self.lower_slope,
                self.lower_intercept,
                self.slowest,
                self.accel_max,
                self.demand,
            )
        ]
        limits = self.scalars
        problem = ProfileProblem(
            *columns, np.array([self.start**2]), limits.decel, limits.specific_power
        )
        speed_sq, reachable = time_optimal_profile(problem._replace(**options))
        return speed_sq[:, 0], float(reachable[0])

    def braking(self, k: int, v: float) -> float:
        """Deceleration of the brakes at a station for a speed at onset."""
        force = max(v, self.slowest[k]) * self.lower_slope[k] + self.lower_intercept[k]
        return float(G * (force + self.sin_grade[k]))


def road(n: int = 101, ds: float = 0.1, **changes: Any) -> Road:
    fill = {
        "bound": 50.0,
        "sin_grade": 0.0,
        "lower_slope": 0.0,
        "lower_intercept": 2.0,
        "slowest": 0.0,
        "accel_max": 1.0,
        "demand": 0.0,
    }
    scalars = planning_limits(model_of(tables_with(vehicle={"max_drive_power": BIG})))
    columns = {
        name: np.broadcast_to(np.asarray(changes.pop(name, value), float), (n,)).copy()
        for name, value in fill.items()
    }
    columns["bound"][-1] = min(columns["bound"][-1], changes.pop("end", 0.0))
    model_changes = changes.pop("scalars", {})
    return Road(np.arange(n) * ds, **columns, scalars=scalars._replace(**model_changes), **changes)


def test_a_level_road_is_accelerate_hold_brake() -> None:
    r = road(401, bound=3.0)
    speed_sq, _ = r.solve()
    s, end = r.station, r.station[-1]
    exact = np.minimum(np.minimum(2.0 * 1.0 * s, 9.0), 2.0 * 1.5 * (end - s))
    np.testing.assert_allclose(speed_sq, exact, atol=1e-9)


def test_a_faster_start_keeps_its_speed_and_has_the_reachable_stations() -> None:
    r = road(101, start=4.0)
    speed_sq, reachable = r.solve()
    assert speed_sq[0] == pytest.approx(16.0)
    assert reachable == pytest.approx(2.0 * 1.5 * 10.0)
    r = road(101, start=9.0)
    speed_sq, reachable = r.solve()
    assert reachable == pytest.approx(30.0)
    assert reachable < r.start**2
    assert speed_sq[0] == pytest.approx(reachable)


def test_a_dip_of_the_bound_is_braked_for_and_accelerated_from() -> None:
    bound = np.full(201, 3.0)
    bound[100] = 1.0
    r = road(201, bound=bound)
    speed_sq, _ = r.solve()
    s = r.station
    inside = np.abs(s - 10.0) < 2.5
    exact = np.where(s < 10.0, 1.0 + 3.0 * (10.0 - s), 1.0 + 2.0 * (s - 10.0))
    np.testing.assert_allclose(speed_sq[inside], exact[inside], atol=1e-9)


def test_brakes_weaker_than_service_braking_decide_downhill() -> None:
    r = road(201, bound=3.0, lower_intercept=0.25, sin_grade=-0.15)
    speed_sq, _ = r.solve()
    accel = np.diff(speed_sq) / 0.2
    assert accel.min() == pytest.approx(-G * 0.1)
    # On the level the same brakes are stronger than service braking.
    speed_sq, _ = road(201, bound=3.0, lower_intercept=0.25).solve()
    assert (np.diff(speed_sq) / 0.2).min() == pytest.approx(-1.5)


@pytest.mark.parametrize("lower_slope", [-0.05, 0.05])
def test_brakes_that_change_with_the_speed_at_onset_are_taken_at_their_weakest(
    lower_slope: float,
) -> None:
    r = road(
        201,
        bound=4.0,
        lower_intercept=0.30,
        lower_slope=lower_slope,
        slowest=0.5,
        scalars={"decel": BIG},
    )
    speed_sq, _ = r.solve()
    speed, accel = np.sqrt(speed_sq), np.diff(speed_sq) / 0.2
    slowing = np.flatnonzero(accel < -1e-6)
    assert len(slowing) > 10
    for k in slowing:
        weakest = min(r.braking(k, speed[k]), r.braking(k, speed[k + 1]))
        assert -accel[k] <= weakest + 1e-9
    # Braking begins somewhere inside its first segment, and is full from the next one on.
    for k in slowing[1:]:
        weakest = min(r.braking(k, speed[k]), r.braking(k, speed[k + 1]))
        assert -accel[k] == pytest.approx(weakest, rel=1e-6)


def test_power_limits_the_acceleration_and_the_top_speed() -> None:
    vehicle = model_of(tables_with()).vehicle
    power = 0.5 * vehicle.max_drive_power
    r = road(
        4001,
        0.05,
        demand=0.13,
        accel_max=1.5,
        scalars={"specific_power": power / (vehicle.mass * G)},
        end=50.0,
    )
    speed_sq, _ = r.solve()
    speed, accel = np.sqrt(speed_sq), np.diff(speed_sq) / 0.1
    top = drive.sustained_speed(0.0, vehicle.mass, power, 0.13)
    assert speed[-1] == pytest.approx(top, rel=5e-3)
    assert speed.max() <= top
    for k in range(10, 4000, 400):
        limit = drive.powered_accel_limit(speed[k + 1], 0.0, 0.0, vehicle.mass, BIG, power, 0.13)
        assert accel[k] <= limit + 1e-9
        # Taken at the bound of the segment's end: first order in the spacing.
        assert accel[k] >= min(1.5, limit) - 0.05
    assert accel[0] == pytest.approx(1.5)


def test_a_hill_too_steep_to_accelerate_is_held_at_speed_not_stopped_on() -> None:
    r = road(101, bound=2.0, accel_max=0.0, start=1.0, end=2.0)
    speed_sq, _ = r.solve()
    np.testing.assert_allclose(speed_sq, 1.0)


def test_nothing_moves_behind_a_bound_of_zero_at_the_start() -> None:
    bound = np.full(50, 2.0)
    bound[0] = 0.0
    speed_sq, reachable = road(50, bound=bound, start=1.0).solve()
    assert reachable == 0.0
    assert speed_sq[0] == 0.0


@st.composite
def roads(draw: st.DrawFn) -> Road:
    n = draw(st.integers(3, 40))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    wavy = rng.uniform(0.2, 4.0, n)
    if draw(st.booleans()):
        wavy[rng.integers(0, n)] = 0.0
    r = road(
        n,
        draw(st.sampled_from([0.05, 0.25, 1.0])),
        bound=wavy,
        sin_grade=rng.uniform(-0.2, 0.2, n),
        lower_intercept=rng.uniform(0.3, 0.8, n),
        lower_slope=rng.uniform(-0.04, 0.04, n),
        slowest=draw(st.sampled_from([0.0, 1.0])),
        accel_max=rng.uniform(0.0, 1.5, n),
        demand=rng.uniform(-0.1, 0.3, n),
        start=draw(st.floats(0.0, 3.0)),
        end=draw(st.sampled_from([0.0, 2.0])),
        scalars={"decel": draw(st.floats(0.3, 5.0))},
    )
    return r


@given(r=roads())
def test_no_constraint_is_breached_on_any_segment(r: Road) -> None:
    speed_sq, reachable = r.solve()
    assert np.all(speed_sq <= r.bound**2 + 1e-12)
    assert np.all(speed_sq >= 0.0)
    assert speed_sq[0] == pytest.approx(min(r.start**2, reachable))
    accel = np.diff(speed_sq) / (2.0 * np.diff(r.station))
    speed = np.sqrt(speed_sq)
    for k, a in enumerate(accel):
        assert a <= min(r.accel_max[k], r.accel_max[k + 1]) + 1e-9
        ends = [r.braking(m, v) for m in (k, k + 1) for v in (speed[k], speed[k + 1])]
        assert -a <= min(r.scalars.decel, *ends) + 1e-9 or speed_sq[k] == 0.0


@given(r=roads(), share=st.floats(0.3, 1.0), where=st.integers(0, 100))
def test_lowering_any_bound_never_makes_any_station_faster(
    r: Road, share: float, where: int
) -> None:
    before, _ = r.solve()
    lower = dataclasses.replace(r, bound=r.bound.copy())
    lower.bound[where % len(lower.bound)] *= share
    after, _ = lower.solve()
    assert np.all(after <= before + 1e-9)


@given(r=roads())
def test_columns_of_a_batch_do_not_mix(r: Road) -> None:
    alone, _ = r.solve()
    lower_bound = dataclasses.replace(r, bound=0.5 * r.bound)
    stacked = [
        np.stack([getattr(x, f) for x in (lower_bound, r, lower_bound)], axis=1)
        for f in (
            "station",
            "bound",
            "sin_grade",
            "lower_slope",
            "lower_intercept",
            "slowest",
            "accel_max",
            "demand",
        )
    ]
    stacked[1] = stacked[1] ** 2
    start_sq = np.full(3, r.start**2)
    speed_sq, _ = time_optimal_profile(
        ProfileProblem(*stacked, start_sq, r.scalars.decel, r.scalars.specific_power)
    )
    np.testing.assert_array_equal(speed_sq[:, 1], alone)


def optimum(r: Road) -> float:
    """Travel time of the best profile under the same constraints, by an interior point method."""
    n, ds = len(r.station), np.diff(r.station)
    problem = ca.Opti()
    y = problem.variable(n)
    v = ca.sqrt(y + 1e-12)
    accel = (y[1:] - y[:-1]) / (2.0 * ds)
    time = ca.sum1(2.0 * ds / (v[1:] + v[:-1]))
    problem.minimize(time)
    problem.subject_to(problem.bounded(0.0, y, r.bound**2))
    problem.subject_to(y[0] == r.start**2)
    problem.subject_to(accel <= np.minimum(r.accel_max[:-1], r.accel_max[1:]))
    problem.subject_to(accel >= -r.scalars.decel)
    for m in (slice(None, -1), slice(1, None)):
        rest = G * (r.lower_intercept[m] + r.sin_grade[m])
        for speed in (v[:-1], v[1:]):
            force = G * r.lower_slope[m] * ca.fmax(speed, r.slowest[m])
            problem.subject_to(-accel <= rest + force)
    hold = G * np.maximum(r.demand[:-1], r.demand[1:])
    problem.subject_to(accel <= ca.fmax(G * r.scalars.specific_power / v[1:] - hold, 0.0))
    problem.set_initial(y, 0.3)
    problem.solver("ipopt", {"print_time": 0}, {"print_level": 0, "sb": "yes", "tol": 1e-9})
    return float(problem.solve().value(time))


@pytest.mark.parametrize("seed", range(4))
def test_no_optimiser_finds_a_faster_profile(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 81
    s = np.linspace(0.0, 20.0, n)
    r = road(
        n,
        0.25,
        bound=2.5 + np.sin(s / rng.uniform(1.5, 3.0) + rng.uniform(0.0, 6.0)),
        sin_grade=0.15 * np.sin(s / 3.0 + rng.uniform(0.0, 6.0)),
        lower_intercept=0.35 + 0.05 * np.cos(s),
        lower_slope=rng.uniform(-0.02, 0.02),
        accel_max=1.0,
        start=1.0,
        end=0.5,
    )
    speed_sq, _ = r.solve()
    v = np.sqrt(speed_sq)
    time = float((2.0 * np.diff(r.station) / (v[1:] + v[:-1])).sum())
    best = optimum(r)
    assert time == pytest.approx(best, rel=1e-3)
    assert time >= best * (1.0 - 1e-6)
