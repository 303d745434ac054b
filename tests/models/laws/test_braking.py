import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import braking
from tests.models.parity import G, check_outside, check_parity

speeds = st.floats(0.0, 8.0)
decels = st.floats(0.2, 9.0)
delays = st.floats(0.0, 1.0)
offsets = st.floats(0.0, 1.0)
grades = st.floats(-0.4, 0.4)


def distance_by_area(speed, deceleration, dead_time):
    """Area under the speed: constant during the dead time, then a straight line to zero."""
    knots = np.array([0.0, dead_time, dead_time + speed / deceleration])
    return np.trapezoid([speed, speed, 0.0], knots)


def test_force_ratio_by_hand():
    # m = -0.02*3 - 0.1 = -0.16, b = 0.01*3 + 0.45 = 0.48, F_b/W = -0.16*(-0.2) + 0.48 = 0.512
    ratio = braking.force_ratio(-0.2, 3.0, m_m=-0.02, b_m=-0.1, m_b=0.01, b_b=0.45)
    assert ratio == pytest.approx(0.512, abs=1e-15)


@given(grades, speeds, st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
def test_force_ratio_is_bilinear(grade, speed, m_m, b_m, m_b, b_b):
    def at(theta, v):
        return braking.force_ratio(theta, v, m_m, b_m, m_b, b_b)

    assert at(0.0, 0.0) == b_b
    slope_at_rest = at(grade, 0.0) - at(0.0, 0.0)
    assert slope_at_rest == pytest.approx(b_m * grade, abs=1e-12)
    mixed = at(grade, speed) - at(grade, 0.0) - at(0.0, speed) + at(0.0, 0.0)
    assert mixed == pytest.approx(m_m * grade * speed, abs=1e-12)


def test_level_scales_the_brakes_and_leaves_the_motion_resistance():
    # F_b/W = 0.6 of which rolling is 0.1, brakes 0.5; at 40 %: 0.1 + 0.4*0.5 = 0.3
    assert braking.force_ratio_at_level(0.6, 0.1, 0.4) == pytest.approx(0.3)
    assert braking.force_ratio_at_level(0.6, 0.1, 1.0) == pytest.approx(0.6)
    assert braking.force_ratio_at_level(0.6, 0.1, 0.0) == pytest.approx(0.1)


def test_deceleration_by_hand():
    # 30 degrees: sin = 1/2. Uphill 9.80665*(0.4 + 0.5) = 8.825985, downhill 9.80665*(-0.1)
    assert braking.deceleration(0.4, np.pi / 6) == pytest.approx(8.825985, abs=1e-12)
    assert braking.deceleration(0.4, -np.pi / 6) == pytest.approx(-0.980665, abs=1e-12)


@given(st.floats(0.0, 1.2), st.floats(-1.2, 1.2))
def test_deceleration_and_its_inverse(force_ratio, grade):
    a = braking.deceleration(force_ratio, grade)
    assert braking.force_ratio_of_deceleration(a, grade) == pytest.approx(force_ratio, abs=1e-12)
    mirrored = braking.deceleration(force_ratio, -grade)
    assert (a - mirrored) * grade >= 0.0, "gravity helps uphill and hinders downhill"


def test_mean_deceleration_by_hand():
    # command at 10 s, dead time 0.3 s, at rest at 11.3 s, 3.2 m/s at onset: 3.2 m/s in 1.0 s
    assert braking.mean_deceleration(3.2, 10.3, 11.3) == pytest.approx(3.2)


@given(st.floats(0.1, 8.0), decels, delays)
def test_mean_deceleration_of_a_constant_one(speed, deceleration, dead_time):
    stop_time = braking.stopping_time(speed, deceleration, dead_time, 0.0)
    mean = braking.mean_deceleration(speed, dead_time, stop_time)
    assert mean == pytest.approx(deceleration, rel=1e-9)


def test_stopping_by_hand():
    # 4 m/s at 3.2 m/s², 0.3 s dead: 1.25 s braking, 16/6.4 = 2.5 m; 1.2 m during the dead time
    assert braking.stopping_time(4.0, 3.2, 0.3, 0.1) == pytest.approx(1.65)
    assert braking.stopping_distance(4.0, 3.2, 0.3, 0.5) == pytest.approx(4.2)
    # as printed: t_s = 1.55 s, ½*3.2*1.55² = 3.844, + 1.2 + 0.5
    assert braking.stopping_distance_as_printed(4.0, 3.2, 0.3, 0.0, 0.5) == pytest.approx(5.544)
    # with t_offset = 0.1 s: t_s = 1.65 s, ½*3.2*1.65² = 4.356
    assert braking.stopping_distance_as_printed(4.0, 3.2, 0.3, 0.1, 0.5) == pytest.approx(6.056)


@given(speeds, decels, delays)
def test_stopping_distance_is_the_area_under_the_speed(speed, deceleration, dead_time):
    expected = distance_by_area(speed, deceleration, dead_time)
    stop = braking.stopping_distance(speed, deceleration, dead_time, 0.0)
    assert stop == pytest.approx(expected, rel=1e-12, abs=1e-12)


@given(speeds, decels, delays, offsets)
def test_print_of_12_counts_the_delay_twice(speed, deceleration, dead_time, offset):
    true = braking.stopping_distance(speed, deceleration, dead_time, offset)
    printed = braking.stopping_distance_as_printed(speed, deceleration, dead_time, 0.0, offset)
    surplus = 0.5 * deceleration * dead_time**2 + speed * dead_time
    assert printed - true == pytest.approx(surplus, abs=1e-9)
    assert printed >= true - 1e-12


@given(speeds, decels, delays, offsets)
def test_speed_of_stopping_distance_inverts(speed, deceleration, dead_time, offset):
    distance = braking.stopping_distance(speed, deceleration, dead_time, offset)
    stop = braking.speed_of_stopping_distance(distance, deceleration, dead_time, offset)
    assert stop == pytest.approx(speed, rel=1e-6, abs=1e-6)


@given(st.floats(0.01, 20.0), decels, delays, offsets)
def test_no_faster_speed_stops_within_the_distance(distance, deceleration, dead_time, offset):
    speed = braking.speed_of_stopping_distance(distance, deceleration, dead_time, offset)
    available = max(distance, offset)
    assert braking.stopping_distance(speed, deceleration, dead_time, offset) <= available + 1e-9
    faster = braking.stopping_distance(speed + 1e-3, deceleration, dead_time, offset)
    assert faster > distance


def test_no_speed_within_the_offset():
    distances = np.array([-1.0, 0.0, 0.5])
    np.testing.assert_array_equal(
        braking.speed_of_stopping_distance(distances, 3.0, 0.0, 0.5), np.zeros(3)
    )
    # √(2*3*1.5) = 3 without dead time; with 0.5 s: (-1.5 + √(2.25 + 9))
    assert braking.speed_of_stopping_distance(2.0, 3.0, 0.0, 0.5) == pytest.approx(3.0)
    expected = 1.8541019662496847
    assert braking.speed_of_stopping_distance(2.0, 3.0, 0.5, 0.5) == pytest.approx(expected)


@pytest.mark.parametrize("dead_time", [0.0, 0.3])
def test_short_distances_lose_no_digits(dead_time):
    # v = d/t_delay to first order if there is a dead time, √(2 a d) exactly without it
    distance = 1e-12
    expected = distance / dead_time if dead_time else np.sqrt(2.0 * 4.0 * distance)
    stop = braking.speed_of_stopping_distance(distance, 4.0, dead_time, 0.0)
    assert stop == pytest.approx(expected, rel=1e-9)


def test_standing_stop_needs_no_braking_distance():
    assert braking.deceleration(0.5, 0.0) == pytest.approx(0.5 * G)
    assert braking.stopping_distance(0.0, 4.0, 0.3, 0.0) == 0.0


SPEED, DECEL, DELAY, OFFSET = (0.1, 5.0), (0.5, 6.0), (0.05, 0.5), (0.0, 0.5)
GRADE, COEFFICIENT, RATIO = (-0.3, 0.3), (-0.2, 0.4), (0.1, 0.9)


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (
            braking.force_ratio,
            {
                "grade": GRADE,
                "onset_speed": SPEED,
                "m_m": COEFFICIENT,
                "b_m": COEFFICIENT,
                "m_b": COEFFICIENT,
                "b_b": COEFFICIENT,
            },
        ),
        (
            braking.force_ratio_at_level,
            {"force_ratio": RATIO, "motion_resistance": (0.02, 0.3), "level": (0.1, 1.0)},
        ),
        (braking.deceleration, {"force_ratio": RATIO, "grade": GRADE}),
        (braking.force_ratio_of_deceleration, {"deceleration": DECEL, "grade": GRADE}),
        (
            braking.mean_deceleration,
            {"onset_speed": SPEED, "onset_time": (0.0, 1.0), "stop_time": (1.5, 3.0)},
        ),
        (
            braking.stopping_time,
            {"speed": SPEED, "deceleration": DECEL, "dead_time": DELAY, "time_offset": OFFSET},
        ),
        (
            braking.stopping_distance,
            {"speed": SPEED, "deceleration": DECEL, "dead_time": DELAY, "distance_offset": OFFSET},
        ),
        (
            braking.stopping_distance_as_printed,
            {
                "speed": SPEED,
                "deceleration": DECEL,
                "dead_time": DELAY,
                "time_offset": OFFSET,
                "distance_offset": OFFSET,
            },
        ),
        (
            braking.speed_of_stopping_distance,
            {
                "distance": (0.0, 6.0),
                "deceleration": DECEL,
                "dead_time": DELAY,
                "distance_offset": OFFSET,
            },
        ),
    ],
)
def test_parity(law, ranges):
    check_parity(law, **ranges)


@pytest.mark.parametrize("deceleration", [-0.5, -1e-9, np.nan])
def test_brakes_that_do_not_slow_stop_nowhere_and_at_no_time(deceleration):
    """On such ground the formulas alone give 1.2 m, −7.7 s and 2e13 m/s."""
    stop = {"speed": 4.0, "deceleration": deceleration, "dead_time": 0.3}
    offsets = {"time_offset": 0.0, "distance_offset": 0.0}
    check_outside(braking.stopping_time, {**stop, **offsets})
    check_outside(braking.stopping_distance, {**stop, **offsets})
    check_outside(braking.stopping_distance_as_printed, {**stop, **offsets})
    check_outside(braking.speed_of_stopping_distance, {**stop, **offsets, "distance": 10.0})
    # Without anything to stop within, too.
    check_outside(braking.speed_of_stopping_distance, {**stop, **offsets, "distance": 0.0})


def test_without_any_deceleration_it_rolls_for_ever():
    stop = {"speed": 4.0, "deceleration": 0.0, "dead_time": 0.3}
    offsets = {"time_offset": 0.0, "distance_offset": 0.0}
    check_outside(braking.stopping_time, {**stop, **offsets}, np.inf)
    check_outside(braking.stopping_distance, {**stop, **offsets}, np.inf)
    check_outside(braking.speed_of_stopping_distance, {**stop, **offsets, "distance": 10.0})


@pytest.mark.parametrize("stop_time", [1.0, 0.5])
def test_a_stop_has_no_negative_distance(stop_time):
    times = {"onset_speed": 3.0, "onset_time": 1.0, "stop_time": stop_time}
    check_outside(braking.mean_deceleration, times)


@given(st.floats(-50, 50), st.floats(-5, 9), st.floats(0, 1), st.floats(-2, 2))
def test_every_returned_speed_stops_in_time(distance, net, delay, offset):
    with np.errstate(all="ignore"):
        speed = braking.speed_of_stopping_distance(distance, net, delay, offset)
    assert np.isnan(speed) == (net <= 0.0)
    if net > 1e-3 and distance > offset:
        needed = braking.stopping_distance(speed, net, delay, offset)
        assert needed <= distance + 1e-6 * max(1.0, abs(distance))
