"""Friction shared between sides and brakes, against numbers worked out by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import friction_ellipse as ellipse
from tests.models.parity import G, check_outside, check_parity

GRADE, ROLL, MU = (-0.3, 0.3), (-0.25, 0.25), (0.4, 0.9)
CURVATURE, CREST = (0.02, 0.3), (-0.2, -0.01)


def test_a_side_slope_leaves_less_for_the_brakes() -> None:
    """15° and 0.35: of 0.338 W 0.217 W remain along the path."""
    roll = math.radians(15.0)
    side = ellipse.side_force_ratio(0.0, roll, 0.0, 0.0)
    normal = ellipse.normal_ratio(0.0, roll, 0.0, 0.0)
    assert side == pytest.approx(0.2588, abs=1e-4)
    left = ellipse.braking_left(0.35, normal, side)
    assert left == pytest.approx(math.sqrt((0.35 * 0.96593) ** 2 - 0.25882**2), abs=1e-4)
    assert ellipse.braking_left(0.2, normal, side) == 0.0


def test_a_crest_carries_what_the_circle_leaves() -> None:
    assert ellipse.normal_ratio(0.0, 0.0, -0.25, 4.0) == pytest.approx(1.0 - 1.0 / G)
    assert ellipse.normal_ratio(0.0, 0.0, -0.25, 4.0 * G + 1.0) == 0.0


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


def test_parity() -> None:
    check_parity(
        ellipse.side_force_ratio, grade=GRADE, roll=ROLL, curvature=CURVATURE, speed_sq=(1.0, 16.0)
    )
    check_parity(
        ellipse.normal_ratio,
        grade=GRADE,
        roll=ROLL,
        vertical_curvature=CREST,
        speed_sq=(1.0, 16.0),
    )
    check_parity(ellipse.braking_left, friction=MU, normal=(0.6, 1.0), side_force=(-0.2, 0.2))
    check_parity(
        ellipse.lateral_speed_sq,
        grade=GRADE,
        roll=(0.02, 0.2),
        curvature=CURVATURE,
        vertical_curvature=CREST,
        friction=MU,
        along=(0.0, 0.2),
    )


def test_ground_without_friction_below_none() -> None:
    check_outside(ellipse.braking_left, {"friction": -0.5, "normal": 1.0, "side_force": 0.1})
    check_outside(
        ellipse.lateral_speed_sq,
        {
            "grade": 0.0,
            "roll": 0.1,
            "curvature": 0.1,
            "vertical_curvature": 0.0,
            "friction": -0.5,
            "along": 0.1,
        },
    )
