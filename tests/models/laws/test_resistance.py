"""Resistance to motion and turning, and the slip track."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import motion_resistance as resistance
from slopewise.models.laws import slip_track as slip
from slopewise.models.laws import turning_resistance as turning
from slopewise.models.laws.wheel_loads import wheel_loads


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


curvatures = st.floats(-2.0, 2.0)
tracks = st.floats(0.3, 3.0)


@given(st.floats(-4.0, 4.0), curvatures.filter(lambda w: abs(w) > 1e-3), tracks)
def test_wheel_speeds_give_the_slip_track_back(speed, yaw_rate, track):
    left, right = slip.wheel_speeds(speed, yaw_rate, track)
    assert slip.slip_track(right, left, yaw_rate) == pytest.approx(track, rel=1e-9)
    assert slip.slip_track(left, right, -yaw_rate) == pytest.approx(track, rel=1e-9)
    assert 0.5 * (left + right) == pytest.approx(speed, abs=1e-12)
