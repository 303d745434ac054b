"""Friction: ellipse, locked wheels and holding; resistance to turning."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slopewise.models.laws import braking, holding, wheel_lockup
from slopewise.models.laws import friction_ellipse as ellipse
from slopewise.models.laws import turning_resistance as turning
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
