import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from slopewise.models.laws import braking, tip_over
from slopewise.models.laws.wheel_loads import front_load_share, rear_load_share
from tests.models.parity import G, check_outside, check_parity

wheelbases = st.floats(0.3, 4.0)
heights = st.floats(0.05, 1.5)
positions = st.floats(0.1, 0.9)  # cg_x / L
shares = st.floats(0.01, 0.5)


def test_at_rest_the_body_tips_when_gravity_points_at_the_front_contact():
    # tan θ = -(L - cg_x)/cg_z: a cube at 45 degrees; 3 : 4 at atan(3/4) = 36.8699 degrees
    assert tip_over.grade_limit(0.0, 1.0, 0.5, 0.5, 0.0) == pytest.approx(-math.pi / 4)
    limit = tip_over.grade_limit(0.0, 1.0, 0.7, 0.4, 0.0)
    assert math.degrees(limit) == pytest.approx(-36.86989764584402)


def test_grade_limit_by_hand():
    # A = 0.4, B = 0.3, R = 0.5, ψ = 36.8699°; C = 0.25*0.4 + 0.3*0.5 = 0.25, arccos(1/2) = 60°
    limit = tip_over.grade_limit(0.5 * G, 1.0, 0.6, 0.3, 0.25)
    assert math.degrees(limit) == pytest.approx(36.86989764584402 - 60.0)


def test_on_level_ground_the_limit_is_the_lever_ratio():
    # the rear lifts on level ground at a_x/g = (L - cg_x)/cg_z
    assert tip_over.grade_limit(0.8 * G, 1.0, 0.6, 0.5, 0.0) == pytest.approx(0.0, abs=1e-12)


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


def test_grade_limit_without_a_root():
    # braking with 3 g lifts the rear of a cube on every grade, pushing with 3 g on none
    assert tip_over.grade_limit(3.0 * G, 1.0, 0.5, 0.5, 0.05) == math.pi / 2
    assert tip_over.grade_limit(-3.0 * G, 1.0, 0.5, 0.5, 0.05) == -math.pi / 2


@given(st.floats(0.0, 3.0), st.floats(0.01, 1.0), shares)
def test_harder_braking_and_more_margin_allow_less(deceleration, more, share):
    vehicle = {"wheelbase": 1.0, "cg_x": 0.4, "cg_z": 0.3}
    base = tip_over.grade_limit(deceleration, min_rear_share=share, **vehicle)
    assert tip_over.grade_limit(deceleration + more, min_rear_share=share, **vehicle) > base
    wider = tip_over.grade_limit(deceleration, min_rear_share=share + 0.1 * more, **vehicle)
    assert wider > base


def test_rear_share_under_braking_by_hand():
    # cos θ = 0.8, cos φ = 1; 0.8 - 0.3/0.6*0.5 = 0.55
    limit = tip_over.rear_share_under_braking(math.asin(-0.6), 0.0, 0.5, 1.0, 0.4, 0.3)
    assert limit == pytest.approx(0.55)


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


def test_downhill_limit_of_a_constant_force_by_hand():
    # m = 0: cos θ = share + cg_z/(L - cg_x) b = 0.1 + 0.5*0.8 = 0.5
    limit = tip_over.downhill_limit_under_braking(
        0.0, 0.8, wheelbase=1.0, cg_x=0.4, cg_z=0.3, min_rear_share=0.1
    )
    assert math.degrees(limit) == pytest.approx(-60.0)


@given(
    st.floats(0.0, 5.0),
    st.floats(-0.1, 0.1),
    st.floats(-0.5, 0.5),
    st.floats(0.0, 0.05),
    st.floats(0.2, 0.7),
    st.floats(0.3, 1.5),
    shares,
)
def test_downhill_limit_separates_enough_from_too_little(speed, m_m, b_m, m_b, b_b, lever, share):
    wheelbase, cg_x = 1.0, 0.5
    cg_z = lever * (wheelbase - cg_x)
    coefficients = (m_m, b_m, m_b, b_b)

    def spare(grade):
        ratio = braking.force_ratio(grade, speed, *coefficients)
        return tip_over.rear_share_under_braking(grade, 0.0, ratio, wheelbase, cg_x, cg_z) - share

    limit = tip_over.downhill_limit_under_braking(
        m_m * speed + b_m, m_b * speed + b_b, wheelbase, cg_x, cg_z, share
    )
    grades = np.linspace(-math.pi / 2, math.pi / 2, 721)
    enough = spare(grades) >= 0.0
    if not np.any(enough):
        assume(np.max(spare(grades)) < -1e-4)
        assert limit == math.pi / 2
        return
    first = grades[np.argmax(enough)]
    assert first - (grades[1] - grades[0]) - 1e-9 <= limit <= first + 1e-9
    if limit > -math.pi / 2:
        assert spare(limit) == pytest.approx(0.0, abs=1e-9)


def test_downhill_limit_without_a_root():
    vehicle = {"wheelbase": 1.0, "cg_x": 0.5, "cg_z": 0.5, "min_rear_share": 0.1}
    never = tip_over.downhill_limit_under_braking(0.0, 1.2, **vehicle)
    assert never == math.pi / 2
    # a force that vanishes quickly downhill, m = 1: at -π/2 the model gives 0.5 - 1.57 < 0
    always = tip_over.downhill_limit_under_braking(1.0, 0.5, **vehicle)
    assert always == -math.pi / 2


def test_downhill_limit_where_the_slope_term_outweighs_the_cosine():
    # cg_z = L - cg_x and |m| > 1: the load is monotone in θ. cos θ + 1.5 θ = 0.9 + 0.1 at θ = 0;
    # cos θ - 1.5 θ = 3.1 nowhere above -π/2, where it is 2.356
    vehicle = {"wheelbase": 1.0, "cg_x": 0.5, "cg_z": 0.5, "min_rear_share": 0.1}
    rising = tip_over.downhill_limit_under_braking(-1.5, 0.9, **vehicle)
    assert rising == pytest.approx(0.0, abs=1e-9)
    falling = tip_over.downhill_limit_under_braking(1.5, 3.0, **vehicle)
    assert falling == math.pi / 2


def test_tall_body_may_only_stop_uphill_if_the_force_falls_there():
    # cg_z = L - cg_x: level needs b <= 0.9; b = 0.95 with m = -0.5 suffices on a climb only
    limit = tip_over.downhill_limit_under_braking(-0.5, 0.95, 1.0, 0.5, 0.5, 0.1)
    assert 0.0 < limit < 0.3


def test_drive_accel_limit_by_hand():
    # sin θ = 0.6: 0.4*(0.8 - 0.05)/0.3 - 0.6 = 0.4 of g
    limit = tip_over.drive_accel_limit(math.asin(0.6), 0.0, 0.4, 0.3, 0.05)
    assert limit == pytest.approx(0.4 * G)
    # a cube tips backwards at 45 degrees
    assert tip_over.drive_accel_limit(math.pi / 4, 0.0, 0.5, 0.5, 0.0) == pytest.approx(0.0)


@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), wheelbases, positions, heights, shares)
def test_at_the_drive_limit_the_front_keeps_just_its_share(
    grade, roll, wheelbase, position, cg_z, share
):
    cg_x = position * wheelbase
    limit = tip_over.drive_accel_limit(grade, roll, cg_x, cg_z, share)
    at_limit = front_load_share(grade, roll, -limit, wheelbase, cg_x, cg_z)
    assert at_limit == pytest.approx(share, abs=1e-9)
    assert front_load_share(grade, roll, -limit - 0.1, wheelbase, cg_x, cg_z) < at_limit


ANGLE = (-0.4, 0.4)
VEHICLE = {"wheelbase": (0.8, 2.0), "cg_x": (0.3, 0.6), "cg_z": (0.2, 0.6)}


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (
            tip_over.grade_limit,
            {"deceleration": (-2.0, 3.0), "min_rear_share": (0.05, 0.3), **VEHICLE},
        ),
        (
            tip_over.rear_share_under_braking,
            {"grade": ANGLE, "roll": ANGLE, "onset_force_ratio": (0.2, 0.8), **VEHICLE},
        ),
        (
            tip_over.drive_accel_limit,
            {
                "grade": ANGLE,
                "roll": ANGLE,
                "cg_x": (0.3, 0.6),
                "cg_z": (0.2, 0.6),
                "min_front_share": (0.05, 0.3),
            },
        ),
    ],
)
def test_parity(law, ranges):
    check_parity(law, **ranges)


def test_a_load_ahead_of_the_front_axle_has_no_limit():
    axles = {"wheelbase": 1.0, "cg_x": 1.2, "cg_z": 0.5}
    check_outside(tip_over.grade_limit, {"deceleration": 2.0, "min_rear_share": 0.1, **axles})
    check_outside(
        tip_over.rear_share_under_braking,
        {"grade": 0.0, "roll": 0.0, "onset_force_ratio": 0.4, **axles},
    )
    assert math.isnan(tip_over.downhill_limit_under_braking(-0.3, 0.4, 1.0, 1.2, 0.5, 0.1))
    assert math.isnan(tip_over.downhill_limit_under_braking(math.nan, 0.4, 1.0, 0.6, 0.5, 0.1))
