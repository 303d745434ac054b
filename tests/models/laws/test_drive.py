import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import drive
from tests.models.parity import G, check_outside, check_parity

grades = st.floats(-0.6, 0.6)
ROVER = {"mass": 30.0, "max_drive_force": 150.0, "max_drive_power": 300.0}


def test_accel_limit_by_hand():
    # below 2 m/s the force of 150 N holds: 5 m/s²; at 4 m/s 300/4/30 = 2.5 m/s²; rolling 0.1 g
    assert drive.powered_accel_limit(1.0, 0.0, 0.0, resistance_ratio=0.1, **ROVER) == pytest.approx(
        5.0 - 0.980665
    )
    assert drive.powered_accel_limit(4.0, 0.0, 0.0, resistance_ratio=0.1, **ROVER) == pytest.approx(
        2.5 - 0.980665
    )
    # sin θ = 0.6, cos φ = 0.5, f = 0.25: (0.6 + 0.25*0.8*0.5) g = 0.7 g
    limits = drive.powered_accel_limit(
        1.0, math.asin(0.6), math.pi / 3, resistance_ratio=0.25, **ROVER
    )
    assert limits == pytest.approx(5.0 - 0.7 * G)


def test_at_rest_the_force_limits():
    assert drive.powered_accel_limit(0.0, 0.0, 0.0, resistance_ratio=0.0, **ROVER) == 5.0


@given(grades, st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(0.0, 0.4))
def test_faster_or_steeper_leaves_less(grade, speed, faster, resistance):
    base = drive.powered_accel_limit(speed, grade, 0.0, resistance_ratio=resistance, **ROVER)
    more = drive.powered_accel_limit(
        speed + faster, grade, 0.0, resistance_ratio=resistance, **ROVER
    )
    assert more <= base
    downhill = drive.powered_accel_limit(
        speed, -abs(grade), 0.0, resistance_ratio=resistance, **ROVER
    )
    assert downhill >= base


@given(grades, st.floats(0.01, 0.4))
def test_at_the_sustained_speed_nothing_is_left_for_acceleration(grade, resistance):
    speed = drive.sustained_speed(grade, 30.0, 300.0, resistance)
    if math.sin(grade) + resistance * math.cos(grade) < 1e-6:
        assert speed > 1e5
        return
    left = drive.powered_accel_limit(speed, grade, 0.0, 30.0, 1e9, 300.0, resistance)
    assert left == pytest.approx(0.0, abs=1e-9)


def test_sustained_speed_by_hand():
    # W = 30*9.80665 = 294.1995 N, sin θ + f cos θ = 0.6 + 0.25*0.8 = 0.8: 300/235.3596
    limits = drive.sustained_speed(math.asin(0.6), 30.0, 300.0, 0.25)
    assert limits == pytest.approx(1.2746452662224104)


def test_parity():
    common = {
        "grade": (0.05, 0.4),
        "mass": (20.0, 60.0),
        "max_drive_power": (200.0, 600.0),
        "resistance_ratio": (0.05, 0.3),
    }
    check_parity(drive.sustained_speed, **common)
    check_parity(
        drive.powered_accel_limit,
        speed=(0.0, 4.0),
        roll=(-0.4, 0.4),
        max_drive_force=(100.0, 300.0),
        **common,
    )


def test_ground_does_not_push():
    check_outside(
        drive.sustained_speed,
        {"grade": 0.2, "mass": 30.0, "max_drive_power": 300.0, "resistance_ratio": -0.1},
    )
