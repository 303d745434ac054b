"""Loads of axles, sides and wheels, and the limits that follow from them, against free bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from slopewise.models.laws import braking, drive, rollover, tip_over
from slopewise.models.laws import wheel_loads as loads
from slopewise.models.laws.wheel_loads import (
    front_load_share,
    left_load_share,
    rear_load_share,
    right_load_share,
)
from tests.world.vehicles import G

angles = st.floats(-0.7, 0.7)
accels = st.floats(-8.0, 8.0)
wheelbases = st.floats(0.3, 4.0)
widths = st.floats(0.3, 3.0)
heights = st.floats(0.05, 1.5)
positions = st.floats(0.1, 0.9)  # cg_x / L


def wheel_free_body(pitch, roll, accel, wheelbase, track_width, cg_x, cg_z):
    """Wheel loads/W from six-component vectors: gravity through Slip (14), r x F about the cg."""
    c, s = np.cos, np.sin
    body_to_world = np.array(
        [[c(pitch), 0, s(pitch)], [0, 1, 0], [-s(pitch), 0, c(pitch)]]
    ) @ np.array([[1, 0, 0], [0, c(roll), -s(roll)], [0, s(roll), c(roll)]])
    gravity = body_to_world.T @ np.array([0.0, 0.0, -1.0])
    ground = np.array([accel[0], accel[1], 0.0]) / G - gravity  # sum of the contact forces over W
    half = 0.5 * track_width
    contacts = np.array(
        [
            [wheelbase - cg_x, half, -cg_z],
            [-cg_x, half, -cg_z],
            [wheelbase - cg_x, -half, -cg_z],
            [-cg_x, -half, -cg_z],
        ]
    )
    tangential = np.cross([0.0, 0.0, -cg_z], [ground[0], ground[1], 0.0])  # all at one height
    normals = np.cross(contacts, [0.0, 0.0, 1.0])
    ahead = cg_x / wheelbase
    matrix = np.array(
        [
            np.ones(4),
            normals[:, 0],
            normals[:, 1],
            [1.0 - ahead, -ahead, -(1.0 - ahead), ahead],  # lateral transfer as the static split
        ]
    )
    return np.linalg.solve(matrix, [ground[2], -tangential[0], -tangential[1], 0.0])


@given(angles, angles, accels, accels, wheelbases, widths, positions, heights)
def test_wheels_match_the_free_body_and_the_shares(
    pitch, roll, accel_x, accel_y, wheelbase, track_width, position, cg_z
):
    weight = 500.0
    cg_x = position * wheelbase
    result = np.array(
        loads.wheel_loads(weight, pitch, roll, accel_x, accel_y, wheelbase, track_width, cg_x, cg_z)
    )
    expected = wheel_free_body(pitch, roll, (accel_x, accel_y), wheelbase, track_width, cg_x, cg_z)
    np.testing.assert_allclose(result, weight * expected, rtol=1e-8, atol=1e-6)
    total = weight * np.cos(roll) * np.cos(pitch)
    assert result.sum() == pytest.approx(total)
    sums = [
        result[0] + result[2],
        result[1] + result[3],
        result[0] + result[1],
        result[2] + result[3],
    ]
    axle = (-pitch, roll, -accel_x, wheelbase, cg_x, cg_z)
    side = (-pitch, roll, accel_y, track_width, cg_z)
    shares = [
        loads.front_load_share(*axle) * position,
        loads.rear_load_share(*axle) * (1.0 - position),
        loads.left_load_share(*side) / 2.0,
        loads.right_load_share(*side) / 2.0,
    ]
    np.testing.assert_allclose(sums, weight * np.array(shares), rtol=1e-9, atol=1e-6)


shares = st.floats(0.01, 0.5)


@given(st.floats(-3.0, 5.0), wheelbases, positions, heights, shares)
def test_grade_limit_is_the_root_of_the_rear_load(deceleration, wheelbase, position, cg_z, share):
    cg_x = position * wheelbase

    def spare(grade):
        return rear_load_share(grade, 0.0, deceleration, wheelbase, cg_x, cg_z) - share

    low = -math.pi / 2
    best = minimize_scalar(
        lambda grade: -spare(grade), bounds=(low, -low), method="bounded", options={"xatol": 1e-9}
    ).x
    assume(abs(spare(best)) > 1e-3)
    assume(abs(spare(low)) > 1e-6)
    limit = tip_over.grade_limit(deceleration, wheelbase, cg_x, cg_z, share)
    if spare(best) < 0.0:
        assert limit == -low
    elif spare(low) > 0.0:
        assert limit == low
    else:
        assert limit == pytest.approx(brentq(spare, low, best, xtol=1e-13), abs=1e-6)


@given(
    st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(0.0, 1.0), wheelbases, positions, heights
)
def test_slope_terms_cancel_under_the_braking_model(
    grade, roll, force_ratio, wheelbase, position, cg_z
):
    cg_x = position * wheelbase
    deceleration = braking.deceleration(force_ratio, grade)
    limit = tip_over.rear_share_under_braking(grade, roll, force_ratio, wheelbase, cg_x, cg_z)
    expected = rear_load_share(grade, roll, deceleration, wheelbase, cg_x, cg_z)
    assert limit == pytest.approx(expected, abs=1e-9)


@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), wheelbases, positions, heights, shares)
def test_at_the_drive_limit_the_front_keeps_just_its_share(
    grade, roll, wheelbase, position, cg_z, share
):
    cg_x = position * wheelbase
    limit = tip_over.drive_accel_limit(grade, roll, cg_x, cg_z, share)
    at_limit = front_load_share(grade, roll, -limit, wheelbase, cg_x, cg_z)
    assert at_limit == pytest.approx(share, abs=1e-9)
    assert front_load_share(grade, roll, -limit - 0.1, wheelbase, cg_x, cg_z) < at_limit


@given(angles, angles, widths, heights, shares)
def test_at_each_limit_one_side_keeps_just_its_share(grade, roll, track_width, cg_z, share):
    low, high = rollover.lateral_accel_limits(grade, roll, track_width, cg_z, share)
    left = left_load_share(grade, roll, high, track_width, cg_z)
    right = right_load_share(grade, roll, low, track_width, cg_z)
    assert (left, right) == pytest.approx((share, share), abs=1e-9)
    assert left_load_share(grade, roll, high + 0.1, track_width, cg_z) < left
    assert right_load_share(grade, roll, low - 0.1, track_width, cg_z) < right


def test_no_limit_pair_where_tilt_alone_exceeds_the_share():
    # cos 1.2 = 0.362 < 0.5: neither side can keep half its load
    low, high = rollover.lateral_accel_limits(1.2, 0.0, 0.6, 0.3, 0.5)
    assert low > high


@given(
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(-math.pi, math.pi),
    st.floats(0.05, 0.5),
    st.sampled_from([-1.0, 1.0]),
)
def test_path_on_a_plane_by_differentiation(slope_x, slope_y, heading, curvature, turn):
    """Drive a plan-view circle on a plane and take the acceleration along the body's left axis."""
    radius, step = 1.0 / curvature, 1e-4
    angle = heading + turn * np.array([-1.0, 0.0, 1.0]) * step
    x, y = turn * radius * np.sin(angle), -turn * radius * np.cos(angle)
    points = np.stack([x, y, slope_x * x + slope_y * y], axis=-1)
    # derivatives by the angle, then by arc length at constant speed 1 m/s in space
    first = (points[2] - points[0]) / (2.0 * step)
    second = (points[2] - 2.0 * points[1] + points[0]) / step**2
    rate = np.linalg.norm(first)
    forward = first / rate
    normal = np.array([-slope_x, -slope_y, 1.0]) / math.hypot(slope_x, slope_y, 1.0)
    left = np.cross(normal, forward)
    measured = second @ left / rate**2
    grade = math.asin(forward[2])
    roll = math.asin(left[2] / math.cos(grade))

    acceleration = rollover.path_lateral_accel(1.0, turn * curvature, roll)
    assert acceleration * math.cos(grade) ** 2 == pytest.approx(measured, rel=1e-5, abs=1e-7)
    assert abs(acceleration) >= abs(measured) - 1e-7


grades = st.floats(-0.6, 0.6)


@given(grades, st.floats(0.01, 0.4))
def test_at_the_sustained_speed_nothing_is_left_for_acceleration(grade, resistance):
    speed = drive.sustained_speed(grade, 30.0, 300.0, resistance)
    if math.sin(grade) + resistance * math.cos(grade) < 1e-6:
        assert speed > 1e5
        return
    left = drive.powered_accel_limit(speed, grade, 0.0, 30.0, 1e9, 300.0, resistance)
    assert left == pytest.approx(0.0, abs=1e-9)
