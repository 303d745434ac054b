"""The rule against hand sums, against the library of its authors, and against Braking (12)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import braking
from slopewise.models.laws.responsibility_sensitive_safety import rule_distance
from tests.models.parity import check_outside, check_parity

# PyPI ad-rss 5.0.0 (Intel), rss.structured.calculateLongitudinalDistanceOffsetAfterStatedBraking-
# Pattern: speed, response time, acceleration, deceleration -> distance.
OF_THE_LIBRARY = (
    (
        2.1885908128635383,
        1.2864072317121258,
        2.3149463950321807,
        1.384390277532958,
        14.371665810049318,
    ),
    (11.462244184706119, 0.7611433410065632, 0.0, 1.2039469008067618, 63.28788105939941),
    (0.6195426525256934, 1.2700711454878175, 0.0, 5.718746500763326, 0.8204224448996698),
)


def test_by_hand() -> None:
    # 4 m/s held for 0.5 s, then 16/(2*4); with 2 m/s² through it 2.25 m, then 25/8
    assert rule_distance(4.0, 0.5, 0.0, 4.0) == pytest.approx(4.0)
    assert rule_distance(4.0, 0.5, 2.0, 4.0) == pytest.approx(2.25 + 25.0 / 8.0)


@pytest.mark.parametrize("case", OF_THE_LIBRARY)
def test_as_recorded_from_the_library_of_its_authors(case: tuple[float, ...]) -> None:
    assert rule_distance(*case[:4]) == pytest.approx(case[4], rel=1e-12)


@given(
    st.floats(0.2, 15.0),
    st.floats(0.1, 1.5),
    st.one_of(st.just(0.0), st.floats(0.1, 3.0)),
    st.floats(0.5, 8.0),
)
def test_equals_the_library_where_it_is_installed(
    speed: float, response: float, acceleration: float, deceleration: float
) -> None:
    library = pytest.importorskip("ad_rss", reason="PyPI ad-rss is not installed")
    physics, distance = library.physics, library.physics.Distance()
    of = library.rss.structured.calculateLongitudinalDistanceOffsetAfterStatedBrakingPattern
    assert of(
        physics.Speed(speed),
        physics.Speed(100.0),
        physics.Duration(response),
        physics.Acceleration(acceleration),
        physics.Acceleration(-deceleration),
        distance,
    )
    expected = rule_distance(speed, response, acceleration, deceleration)
    assert float(distance.mDistance) == pytest.approx(expected, rel=1e-9)


@given(st.floats(0.0, 5.0), st.floats(0.0, 1.0), st.floats(0.1, 6.0))
def test_on_level_ground_without_acceleration_it_is_the_braking_model(
    speed: float, response: float, deceleration: float
) -> None:
    model = braking.stopping_distance(speed, deceleration, response, 0.0)
    assert rule_distance(speed, response, 0.0, deceleration) == pytest.approx(model, abs=1e-12)


def test_parity() -> None:
    check_parity(
        rule_distance,
        speed=(0.5, 5.0),
        response_time=(0.1, 1.0),
        acceleration=(0.0, 2.0),
        deceleration=(1.0, 6.0),
    )


def test_nothing_stops_without_deceleration() -> None:
    check_outside(
        rule_distance,
        {"speed": 2.0, "response_time": 0.3, "acceleration": 0.0, "deceleration": -1.0},
    )
    assert math.isfinite(rule_distance(0.0, 0.3, 0.0, 1.0))
