"""Standing still on a slope, against free bodies by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import holding
from tests.models.parity import check_parity


def test_brakes_hold_uphill_as_downhill() -> None:
    assert holding.brakes_hold(0.4, math.radians(30.0)) == pytest.approx(-0.1)
    assert holding.brakes_hold(0.4, math.radians(-20.0)) == pytest.approx(0.4 - 0.34202, abs=1e-5)


def test_friction_holds_up_to_its_angle_along_and_across() -> None:
    limit = math.atan(0.5)
    assert holding.friction_holds(0.5, limit, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert holding.friction_holds(0.5, 0.0, -limit) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(0.1, 1.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_the_slope_is_that_of_the_plane(friction: float, grade: float, roll: float) -> None:
    """Of the plane's normal only the angle to the vertical counts."""
    steepest = math.acos(math.cos(grade) * math.cos(roll))
    expected = friction * math.cos(steepest) - math.sin(steepest)
    assert holding.friction_holds(friction, grade, roll) == pytest.approx(expected, abs=1e-9)


def test_parity() -> None:
    check_parity(holding.brakes_hold, force_ratio=(0.1, 0.6), grade=(-0.3, 0.3))
    check_parity(holding.friction_holds, friction=(0.2, 0.9), grade=(-0.3, 0.3), roll=(-0.3, 0.3))
