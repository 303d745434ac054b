"""Resistance to motion and turning, and the slip track."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import motion_resistance as resistance
from slopewise.models.laws import slip_track as slip
from slopewise.models.laws import turning_resistance as turning
from slopewise.models.laws.wheel_loads import wheel_loads
from tests.models.parity import check_outside, check_parity

# ---------------------------------------------------------------------- turning resistance


# Slip, Table 1: B = 0.6 m, L = 0.55 m, W = 294.3 N; Table 2, asphalt: f_r = 0.03, μ_t = 0.26
HUSKY = {"weight": 294.3, "wheelbase": 0.55, "track_width": 0.6}
LEVEL = {"left_load": 147.15, "right_load": 147.15}
ASPHALT = {"motion_resistance": 0.03, "lateral_resistance": 0.26}


def printed_27(thrusts, motion_resistance, weight, wheelbase, track_width):
    return track_width / wheelbase * (sum(thrusts) / weight - motion_resistance)


def test_moment_and_thrusts_of_the_papers_vehicle_by_hand():
    # M_r = 0.26*294.3*0.55/2 = 21.04245 N m; rolling 0.03*147.15 = 4.4145 N a side;
    # M_r/B = 35.07075 N: on the spot 39.48525 N each, in a turn -30.65625 and 39.48525 N
    assert turning.turning_moment(0.26, 294.3, 0.55) == pytest.approx(21.04245)
    result = turning.side_thrusts(1.0, **ASPHALT, **LEVEL, **HUSKY)
    assert result == pytest.approx((39.48525, 39.48525))
    result = turning.side_thrusts(-1.0, **ASPHALT, **LEVEL, **HUSKY)
    assert result == pytest.approx((-30.65625, 39.48525))


def test_lateral_resistance_of_the_papers_vehicle_by_hand():
    # (0.6/0.55)*(78.9705/294.3 - 0.03) = 0.26
    result = turning.lateral_resistance_on_the_spot(39.48525, 39.48525, 0.03, **LEVEL, **HUSKY)
    assert result == pytest.approx(0.26)
    result = turning.lateral_resistance_in_a_turn(-30.65625, 39.48525, 0.03, **LEVEL, **HUSKY)
    assert result == pytest.approx(0.26)


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


@given(st.sampled_from([-1.0, 1.0]), st.floats(0.0, 0.5))
def test_thrusts_balance_moment_and_rolling(sigma, f_r):
    # signed by the direction of rolling: the left wheels roll backward on the spot, else forward
    left, right = turning.side_thrusts(sigma, f_r, 0.2, 120.0, 170.0, 300.0, 0.5, 0.6)
    rolling_left, rolling_right = -sigma * f_r * 120.0, f_r * 170.0
    net_left, net_right = -sigma * left - rolling_left, right - rolling_right
    assert net_left + net_right == pytest.approx(0.0, abs=1e-9)
    moment = 0.5 * 0.6 * (net_right - net_left)
    assert moment == pytest.approx(turning.turning_moment(0.2, 300.0, 0.5))


@pytest.mark.parametrize("mu_t", [0.1, 0.3])
def test_print_of_27_holds_on_the_spot_only(mu_t):
    ground = {"motion_resistance": 0.1, "lateral_resistance": mu_t}
    thrusts = turning.side_thrusts(1.0, **ground, **LEVEL, **HUSKY)
    assert printed_27(thrusts, 0.1, **HUSKY) == pytest.approx(mu_t)
    # in any other turn it is 0 on all ground
    thrusts = turning.side_thrusts(-1.0, **ground, **LEVEL, **HUSKY)
    assert printed_27(thrusts, 0.1, **HUSKY) == pytest.approx(0.0, abs=1e-12)


def test_drag_by_hand():
    # μ_t L |κ|/2 = 0.26*0.55*0.5/2
    assert turning.equivalent_drag_ratio(0.5, 0.26, 0.55) == pytest.approx(0.03575)


@given(st.floats(-2.0, 2.0), st.floats(0.0, 1.0), st.floats(0.3, 3.0))
def test_drag_has_the_power_of_the_moment(curvature, mu_t, wheelbase):
    weight, speed = 300.0, 1.7
    drag = weight * turning.equivalent_drag_ratio(curvature, mu_t, wheelbase)
    power = turning.turning_moment(mu_t, weight, wheelbase) * np.abs(curvature * speed)
    assert drag * speed == pytest.approx(power, abs=1e-9)


VEHICLE = {
    "left_load": (100.0, 200.0),
    "right_load": (100.0, 200.0),
    "weight": (200.0, 400.0),
    "wheelbase": (0.4, 1.2),
    "track_width": (0.4, 1.2),
}
THRUSTS = {"left_thrust": (-40.0, 40.0), "right_thrust": (10.0, 60.0)}
F_R, MU_T = (0.02, 0.3), (0.1, 0.4)


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (
            turning.turning_moment,
            {"lateral_resistance": MU_T, "weight": (200.0, 400.0), "wheelbase": (0.4, 1.2)},
        ),
        (
            turning.side_thrusts,
            {
                "sigma": (-1.0, 1.0),
                "motion_resistance": F_R,
                "lateral_resistance": MU_T,
                **VEHICLE,
            },
        ),
        (
            turning.lateral_resistance_on_the_spot,
            {"motion_resistance": F_R, **THRUSTS, **VEHICLE},
        ),
        (turning.lateral_resistance_in_a_turn, {"motion_resistance": F_R, **THRUSTS, **VEHICLE}),
        (
            turning.equivalent_drag_ratio,
            {"curvature": (-1.0, 1.0), "lateral_resistance": MU_T, "wheelbase": (0.4, 1.2)},
        ),
    ],
)
def test_parity_of_turning(law, ranges):
    check_parity(law, **ranges)


# ----------------------------------------------------------------------- motion resistance


# Slip, Table 1: k_t = 0.044 N m/A, gear 78.71, wheel diameter 0.26 m, W = 294.3 N
HUSKY_DRIVE = {"torque_constant": 0.044, "gear_ratio": 78.71, "wheel_radius": 0.13}
SIDE_LOAD = 147.15


def test_the_papers_vehicle_by_hand():
    # 1 A: 78.71*0.044 = 3.46324 N m; over 0.13*147.15 = 19.1295 N m: 0.1810418
    force = resistance.motion_resistance(1.0, 0.0, side_load=SIDE_LOAD, **HUSKY_DRIVE)
    assert force == pytest.approx(0.18104184636294726)
    # Table 2, asphalt, f_r = 0.03: 0.03*19.1295/3.46324 = 0.1657076 A
    force = resistance.current_of_motion_resistance(0.03, 0.0, side_load=SIDE_LOAD, **HUSKY_DRIVE)
    assert force == pytest.approx(0.1657075455353946)


def test_idle_current_is_no_resistance():
    assert resistance.motion_resistance(0.8, 0.8, side_load=SIDE_LOAD, **HUSKY_DRIVE) == 0.0
    total = resistance.motion_resistance(2.0, 0.0, side_load=SIDE_LOAD, **HUSKY_DRIVE)
    assert resistance.motion_resistance(2.5, 0.5, side_load=SIDE_LOAD, **HUSKY_DRIVE) == total


@given(
    st.floats(0.0, 1.0),
    st.floats(0.0, 3.0),
    st.floats(0.005, 0.5),
    st.floats(1.0, 100.0),
    st.floats(0.05, 0.5),
    st.floats(10.0, 3000.0),
)
def test_current_and_resistance_are_inverse(f_r, idle, constant, gear, radius, load):
    current = resistance.current_of_motion_resistance(f_r, idle, constant, gear, radius, load)
    assert current >= idle
    force = resistance.motion_resistance(current, idle, constant, gear, radius, load)
    assert force == pytest.approx(f_r, abs=1e-9)


@given(st.floats(0.0, 0.5), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_resistance_force_is_the_sum_over_the_wheels(f_r, grade, roll):
    loads = wheel_loads(294.3, -grade, roll, 0.0, 0.0, 0.55, 0.6, 0.3, 0.2)
    force = resistance.resistance_force(f_r, 294.3, grade, roll)
    assert force == pytest.approx(f_r * sum(loads), abs=1e-9)


def test_resistance_force_by_hand():
    # 0.1*200*0.8*0.6
    force = resistance.resistance_force(0.1, 200.0, math.asin(0.6), math.asin(0.8))
    assert force == pytest.approx(9.6)


MOTOR = {
    "idle_current": (0.1, 0.8),
    "torque_constant": (0.03, 0.06),
    "gear_ratio": (20.0, 90.0),
    "wheel_radius": (0.1, 0.3),
    "side_load": (100.0, 300.0),
}


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (resistance.motion_resistance, {"current": (1.0, 9.0), **MOTOR}),
        (resistance.current_of_motion_resistance, {"motion_resistance": (0.02, 0.4), **MOTOR}),
        (
            resistance.resistance_force,
            {
                "motion_resistance": (0.02, 0.4),
                "weight": (200.0, 600.0),
                "grade": (-0.4, 0.4),
                "roll": (-0.4, 0.4),
            },
        ),
    ],
)
def test_parity_of_motion_resistance(law, ranges):
    check_parity(law, **ranges)


def test_wheels_in_the_air_roll_on_nothing():
    drive = {"current": 3.0, "idle_current": 0.5, "torque_constant": 0.044, "gear_ratio": 78.71}
    check_outside(resistance.motion_resistance, drive | {"wheel_radius": 0.13, "side_load": -5.0})


# ------------------------------------------------------------------------------ slip track


curvatures = st.floats(-2.0, 2.0)
tracks = st.floats(0.3, 3.0)


def test_slip_track_by_hand():
    # Slip, Table 2: beach sand 1.62 m; 45 deg/s on the spot needs 1.62*π/4 = 1.272345 m/s between
    # the sides
    left, right = slip.wheel_speeds(0.0, math.pi / 4, 1.62)
    assert right - left == pytest.approx(1.2723450247038663)
    assert (left, right) == pytest.approx((-0.6361725123519332, 0.6361725123519332))
    assert slip.slip_track(0.6361725123519332, -0.6361725123519332, math.pi / 4) == pytest.approx(
        1.62
    )


def test_left_turn_speeds_up_the_right_side():
    # 2 m/s, 0.5 rad/s, 1.2 m: 2 ∓ 0.3
    assert slip.wheel_speeds(2.0, 0.5, 1.2) == pytest.approx((1.7, 2.3))


@given(st.floats(-4.0, 4.0), curvatures.filter(lambda w: abs(w) > 1e-3), tracks)
def test_wheel_speeds_give_the_slip_track_back(speed, yaw_rate, track):
    left, right = slip.wheel_speeds(speed, yaw_rate, track)
    assert slip.slip_track(right, left, yaw_rate) == pytest.approx(track, rel=1e-9)
    assert slip.slip_track(left, right, -yaw_rate) == pytest.approx(track, rel=1e-9)
    assert 0.5 * (left + right) == pytest.approx(speed, abs=1e-12)


@given(st.floats(0.1, 4.0), curvatures, tracks)
def test_outer_ratio_is_that_of_the_faster_wheel(speed, curvature, track):
    fastest = max(slip.wheel_speeds(speed, curvature * speed, track))
    assert slip.outer_wheel_speed_ratio(curvature, track) == pytest.approx(fastest / speed)


def test_outer_ratio_by_hand():
    # radius 2 m, slip track 1 m: (2 + 0.5)/2
    assert slip.outer_wheel_speed_ratio(-0.5, 1.0) == pytest.approx(1.25)


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (slip.slip_track, {"v_right": (1.0, 2.0), "v_left": (-1.0, 0.5), "yaw_rate": (0.2, 1.0)}),
        (
            slip.wheel_speeds,
            {"speed": (0.0, 3.0), "yaw_rate": (-1.0, 1.0), "slip_track": (0.6, 1.8)},
        ),
        (slip.outer_wheel_speed_ratio, {"curvature": (-1.0, 1.0), "slip_track": (0.6, 1.8)}),
    ],
)
def test_parity_of_the_slip_track(law, ranges):
    check_parity(law, **ranges)
