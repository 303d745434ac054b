"""Braking: the law is bilinear, stops are areas under the speed, and inverses are inverse.

Load lost over a crest, against free bodies written out here.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import braking
from slopewise.models.laws.crest import load_loss
from slopewise.models.laws.responsibility_sensitive_safety import rule_distance
from tests.world.vehicles import G

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
