import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import motion_resistance as resistance
from slopewise.models.laws.wheel_loads import wheel_loads
from tests.models.parity import check_outside, check_parity

# Slip, Table 1: k_t = 0.044 N m/A, gear 78.71, wheel diameter 0.26 m, W = 294.3 N
HUSKY = {"torque_constant": 0.044, "gear_ratio": 78.71, "wheel_radius": 0.13}
SIDE_LOAD = 147.15


def test_the_papers_vehicle_by_hand():
    # 1 A: 78.71*0.044 = 3.46324 N m; over 0.13*147.15 = 19.1295 N m: 0.1810418
    force = resistance.motion_resistance(1.0, 0.0, side_load=SIDE_LOAD, **HUSKY)
    assert force == pytest.approx(0.18104184636294726)
    # Table 2, asphalt, f_r = 0.03: 0.03*19.1295/3.46324 = 0.1657076 A
    force = resistance.current_of_motion_resistance(0.03, 0.0, side_load=SIDE_LOAD, **HUSKY)
    assert force == pytest.approx(0.1657075455353946)


def test_idle_current_is_no_resistance():
    assert resistance.motion_resistance(0.8, 0.8, side_load=SIDE_LOAD, **HUSKY) == 0.0
    total = resistance.motion_resistance(2.0, 0.0, side_load=SIDE_LOAD, **HUSKY)
    assert resistance.motion_resistance(2.5, 0.5, side_load=SIDE_LOAD, **HUSKY) == total


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
def test_parity(law, ranges):
    check_parity(law, **ranges)


def test_wheels_in_the_air_roll_on_nothing():
    drive = {"current": 3.0, "idle_current": 0.5, "torque_constant": 0.044, "gear_ratio": 78.71}
    check_outside(resistance.motion_resistance, drive | {"wheel_radius": 0.13, "side_load": -5.0})
