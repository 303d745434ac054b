import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import rollover
from slopewise.models.laws.wheel_loads import left_load_share, right_load_share
from tests.models.parity import G, check_outside, check_parity

angles = st.floats(-0.6, 0.6)
widths = st.floats(0.3, 3.0)
heights = st.floats(0.1, 1.5)
shares = st.floats(0.0, 0.5)


def test_on_level_ground_the_limit_is_the_static_stability_factor():
    # T/(2H), the factor of vehicle safety ratings: a track of 1.5 m and a height of 0.5 m give 1.5
    low, high = rollover.lateral_accel_limits(0.0, 0.0, 1.5, 0.5, 0.0)
    assert (low, high) == pytest.approx((-1.5 * G, 1.5 * G))


def test_on_a_tilt_table_the_limit_is_reached_at_rest():
    # left side raised to tan φ = B/(2h) = 3/4: standing still is just possible, no left turn is
    roll = math.atan(0.75)
    low, high = rollover.lateral_accel_limits(0.0, roll, 0.6, 0.4, 0.0)
    assert high == pytest.approx(0.0, abs=1e-12)
    # sin = 0.6, cos = 0.8: lowest -(0.75*0.8 + 0.6) g
    assert low == pytest.approx(-1.2 * G)


@given(angles, angles, widths, heights, shares)
def test_at_each_limit_one_side_keeps_just_its_share(grade, roll, track_width, cg_z, share):
    low, high = rollover.lateral_accel_limits(grade, roll, track_width, cg_z, share)
    left = left_load_share(grade, roll, high, track_width, cg_z)
    right = right_load_share(grade, roll, low, track_width, cg_z)
    assert (left, right) == pytest.approx((share, share), abs=1e-9)
    assert left_load_share(grade, roll, high + 0.1, track_width, cg_z) < left
    assert right_load_share(grade, roll, low - 0.1, track_width, cg_z) < right


@given(angles, angles, widths, heights, shares)
def test_limits_mirror_with_the_cross_slope(grade, roll, track_width, cg_z, share):
    low, high = rollover.lateral_accel_limits(grade, roll, track_width, cg_z, share)
    mirrored = rollover.lateral_accel_limits(grade, -roll, track_width, cg_z, share)
    assert mirrored == pytest.approx((-high, -low), abs=1e-9)


def test_raised_left_side_leaves_less_for_left_turns():
    low, high = rollover.lateral_accel_limits(0.0, 0.2, 0.6, 0.3, 0.1)
    assert high < -low


def test_no_limit_pair_where_tilt_alone_exceeds_the_share():
    # cos 1.2 = 0.362 < 0.5: neither side can keep half its load
    low, high = rollover.lateral_accel_limits(1.2, 0.0, 0.6, 0.3, 0.5)
    assert low > high


def test_path_lateral_accel_by_hand():
    # 3 m/s on a radius of 4 m: 9/4; with cos φ = 0.8, 9/4/0.8 = 2.8125; right turn negative
    assert rollover.path_lateral_accel(9.0, 0.25, 0.0) == pytest.approx(2.25)
    assert rollover.path_lateral_accel(9.0, -0.25, math.asin(0.6)) == pytest.approx(-2.8125)


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


def test_parity():
    angle = (-0.4, 0.4)
    check_parity(
        rollover.lateral_accel_limits,
        grade=angle,
        roll=angle,
        track_width=(0.5, 1.5),
        cg_z=(0.2, 0.6),
        min_side_share=(0.05, 0.3),
    )
    check_parity(
        rollover.path_lateral_accel, speed_sq=(0.0, 20.0), curvature=(-0.5, 0.5), roll=angle
    )


def test_a_vehicle_on_its_roof_follows_no_path():
    check_outside(rollover.path_lateral_accel, {"speed_sq": 4.0, "curvature": 0.2, "roll": 2.0})
