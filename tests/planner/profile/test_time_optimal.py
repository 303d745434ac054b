"""Time-optimal profiles against closed forms, an optimiser, and their own constraints."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.laws import drive
from tests.world.roads import BIG, Road, road
from tests.world.vehicles import G, model_of, tables_with


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


@settings(max_examples=60)
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
