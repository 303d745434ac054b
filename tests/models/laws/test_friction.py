"""Friction, axles that lock up, and stops on planes and round hills."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slopewise.models.laws import braking, holding, wheel_lockup
from slopewise.models.laws import friction_ellipse as ellipse
from slopewise.models.laws import turning_resistance as turning
from slopewise.models.laws.crest import load_loss
from slopewise.models.laws.responsibility_sensitive_safety import rule_distance
from slopewise.models.laws.wheel_loads import front_load_share, rear_load_share
from tests.world.vehicles import G

GRADE, ROLL, MU = (-0.3, 0.3), (-0.25, 0.25), (0.4, 0.9)
CURVATURE, CREST = (0.02, 0.3), (-0.2, -0.01)


@given(
    st.floats(*GRADE), st.floats(*ROLL), st.floats(-0.3, 0.3), st.floats(-0.2, 0.2), st.floats(*MU)
)
def test_at_the_returned_speed_a_turn_uses_its_share(
    grade: float, roll: float, curvature: float, crest: float, friction: float
) -> None:
    along = 0.3 * friction
    speed_sq = ellipse.lateral_speed_sq(grade, roll, curvature, crest, friction, along)
    upright = math.cos(grade) * math.cos(roll)
    bank = math.sin(roll) * math.cos(grade)
    taken = abs(bank) / upright
    # Halfway between the longitudinal demand and all of the friction remains for it.
    share = min(0.8 * friction + 0.2 * taken, friction * math.sqrt(1.0 - 0.65**2))
    share = max(share, taken)
    if speed_sq == 0.0:
        assert share * upright <= math.copysign(bank, bank * curvature) + 1e-12
        return
    if speed_sq > 1e6:
        assert abs(curvature) < 1e-3
        return
    normal = upright + min(crest, 0.0) * speed_sq / G
    outward = (
        abs(curvature) * speed_sq / G + (math.copysign(1.0, curvature) if curvature else 0.0) * bank
    )
    assert outward <= share * normal + 1e-9
    if crest >= 0.0:
        assert outward == pytest.approx(share * normal, abs=1e-9)
    assert 0.475 * friction * upright <= 0.65 * friction * normal + 1e-9


angles = st.floats(-0.6, 0.6)
splits = st.floats(0.0, 1.0)
frictions = st.floats(0.1, 1.2)
wheelbases = st.floats(0.5, 4.0)
positions = st.floats(0.1, 0.9)  # cg_x / L
heights = st.floats(0.05, 1.0)


@given(angles, angles, splits, frictions, wheelbases, positions, heights)
def test_at_lockup_the_axle_force_equals_its_friction(
    grade, roll, split, friction, wheelbase, position, cg_z
):
    assume(abs(split * wheelbase - friction * cg_z) > 1e-3)
    cg_x = position * wheelbase
    arguments = (grade, roll, split, friction, wheelbase, cg_x, cg_z)
    front, rear = wheel_lockup.lockup_force_ratios(*arguments)
    axle = (wheelbase, cg_x, cg_z)
    load = rear_load_share(grade, roll, braking.deceleration(rear, grade), *axle) * (1 - position)
    assert (1.0 - split) * rear == pytest.approx(friction * load, abs=1e-9)

    if split * wheelbase > friction * cg_z:
        load = front_load_share(grade, roll, braking.deceleration(front, grade), *axle) * position
        assert split * front == pytest.approx(friction * load, rel=1e-9, abs=1e-9)
    else:
        assert front > 1e6


@given(angles, angles, splits, frictions, wheelbases, positions, heights)
def test_lockup_is_never_above_the_cap(grade, roll, split, friction, wheelbase, position, cg_z):
    cg_x = position * wheelbase
    cap = wheel_lockup.friction_cap(grade, roll, friction)
    axle = (wheelbase, cg_x, cg_z)
    first = min(wheel_lockup.lockup_force_ratios(grade, roll, split, friction, *axle))
    assert first <= cap * (1.0 + 1e-12)
    ideal = (cg_x + friction * cg_z) / wheelbase
    if ideal <= 1.0:
        first = min(wheel_lockup.lockup_force_ratios(grade, roll, ideal, friction, *axle))
        assert first == pytest.approx(cap)


@given(st.floats(0.1, 1.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_the_slope_is_that_of_the_plane(friction: float, grade: float, roll: float) -> None:
    """Of the plane's normal only the angle to the vertical counts."""
    steepest = math.acos(math.cos(grade) * math.cos(roll))
    expected = friction * math.cos(steepest) - math.sin(steepest)
    assert holding.friction_holds(friction, grade, roll) == pytest.approx(expected, abs=1e-9)


@given(
    st.floats(0.0, 0.5),
    st.floats(0.0, 1.0),
    st.floats(50.0, 400.0),
    st.floats(50.0, 400.0),
    st.floats(0.3, 3.0),
    st.floats(0.3, 3.0),
)
def test_each_form_recovers_the_lateral_resistance(f_r, mu_t, left_load, right_load, L, B):
    weight = 1.1 * (left_load + right_load)  # tilted: the loads sum to less than the weight
    vehicle = (left_load, right_load, weight, L, B)
    thrusts = turning.side_thrusts(1.0, f_r, mu_t, *vehicle)
    result = turning.lateral_resistance_on_the_spot(*thrusts, f_r, *vehicle)
    assert result == pytest.approx(mu_t, abs=1e-9)
    thrusts = turning.side_thrusts(-1.0, f_r, mu_t, *vehicle)
    result = turning.lateral_resistance_in_a_turn(*thrusts, f_r, *vehicle)
    assert result == pytest.approx(mu_t, abs=1e-9)


speeds = st.floats(0.0, 8.0)
decels = st.floats(0.2, 9.0)
delays = st.floats(0.0, 1.0)
offsets = st.floats(0.0, 1.0)
grades = st.floats(-0.4, 0.4)


def distance_by_area(speed, deceleration, dead_time):
    """Area under the speed: constant during the dead time, then a straight line to zero."""
    knots = np.array([0.0, dead_time, dead_time + speed / deceleration])
    return np.trapezoid([speed, speed, 0.0], knots)


@given(st.floats(0.0, 1.2), st.floats(-1.2, 1.2))
def test_deceleration_and_its_inverse(force_ratio, grade):
    a = braking.deceleration(force_ratio, grade)
    assert braking.force_ratio_of_deceleration(a, grade) == pytest.approx(force_ratio, abs=1e-12)
    mirrored = braking.deceleration(force_ratio, -grade)
    assert (a - mirrored) * grade >= 0.0, "gravity helps uphill and hinders downhill"


@given(st.floats(0.1, 8.0), decels, delays)
def test_mean_deceleration_of_a_constant_one(speed, deceleration, dead_time):
    stop_time = braking.stopping_time(speed, deceleration, dead_time, 0.0)
    mean = braking.mean_deceleration(speed, dead_time, stop_time)
    assert mean == pytest.approx(deceleration, rel=1e-9)


@given(speeds, decels, delays)
def test_stopping_distance_is_the_area_under_the_speed(speed, deceleration, dead_time):
    expected = distance_by_area(speed, deceleration, dead_time)
    stop = braking.stopping_distance(speed, deceleration, dead_time, 0.0)
    assert stop == pytest.approx(expected, rel=1e-12, abs=1e-12)
    # Responsibility-sensitive safety without acceleration is the same rule.
    assert rule_distance(speed, dead_time, 0.0, deceleration) == pytest.approx(stop, abs=1e-12)


@given(speeds, decels, delays, offsets)
def test_print_of_12_counts_the_delay_twice(speed, deceleration, dead_time, offset):
    true = braking.stopping_distance(speed, deceleration, dead_time, offset)
    printed = braking.stopping_distance_as_printed(speed, deceleration, dead_time, 0.0, offset)
    surplus = 0.5 * deceleration * dead_time**2 + speed * dead_time
    assert printed - true == pytest.approx(surplus, abs=1e-9)
    assert printed >= true - 1e-12


@given(st.floats(0.01, 20.0), decels, delays, offsets)
def test_no_faster_speed_stops_within_the_distance(distance, deceleration, dead_time, offset):
    speed = braking.speed_of_stopping_distance(distance, deceleration, dead_time, offset)
    available = max(distance, offset)
    assert braking.stopping_distance(speed, deceleration, dead_time, offset) <= available + 1e-9
    faster = braking.stopping_distance(speed + 1e-3, deceleration, dead_time, offset)
    assert faster > distance


@given(st.floats(-50, 50), st.floats(-5, 9), st.floats(0, 1), st.floats(-2, 2))
def test_every_returned_speed_stops_in_time(distance, net, delay, offset):
    with np.errstate(all="ignore"):
        speed = braking.speed_of_stopping_distance(distance, net, delay, offset)
    assert np.isnan(speed) == (net <= 0.0)
    if net > 1e-3 and distance > offset:
        needed = braking.stopping_distance(speed, net, delay, offset)
        assert needed <= distance + 1e-6 * max(1.0, abs(distance))


@given(radius=st.floats(5.0, 100.0), speed=st.floats(0.5, 6.0))
def test_on_a_round_hill_the_load_loss_is_the_centripetal_force(
    radius: float, speed: float
) -> None:
    """A point that slides over the top of a circle: acceleration by differences."""
    dt = 1e-4
    angle = speed * np.array([-dt, 0.0, dt]) / radius
    height = radius * np.cos(angle)
    falling = (height[0] - 2.0 * height[1] + height[2]) / dt**2
    pressing = (G + falling) / G
    assert 1.0 - load_loss(speed, -1.0 / radius) == pytest.approx(pressing, abs=1e-4)
