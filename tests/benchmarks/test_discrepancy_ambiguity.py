"""Stops that are proposed are driven as proposed, and counted against any others."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.discovery import ambiguity, catalogue, designs, physics
from benchmarks.discovery.hidden import HiddenTerm
from benchmarks.discovery.worth import TOLD_APART, Worth, worth

BASE = physics.Physics(m_m=0.0, b_m=-0.2, m_b=0.005, b_b=0.45, dead_time=0.25)
WIND = {"wind_drag": 0.012, "wind": 6.0, "wind_direction": 0.4}


@pytest.fixture(scope="module")
def windy() -> catalogue.HiddenSet:
    """A head wind, met from one side only: it could as well be viscous resistance."""
    stops = designs.draw("one-way", 40, 0.02, np.random.default_rng(1))
    return catalogue.HiddenSet(
        catalogue.Order("single", ("headwind",), "medium", 3),
        "one-way",
        0.03,
        0.02,
        {},
        {},
        BASE._replace(**WIND),
        (HiddenTerm("headwind", WIND),),
        stops,
        Worth(0.0, "", 0.0),
    )


def test_proposed_stops_are_driven_as_proposed(windy: catalogue.HiddenSet) -> None:
    design = [
        {"speed": 4.0, "grade": 0.0, "heading": 3.5, "pause": 30.0, "yaw_rate": 0.2},
        {"speed": 2.0, "grade": 0.1, "heading": None},
    ]
    found = ambiguity.planned(windy, design, 5, np.random.default_rng(0))
    np.testing.assert_allclose(found.speed, [4.0, 2.0, 4.0, 2.0, 4.0])
    np.testing.assert_allclose(found.heading[::2], 3.5)
    assert len(set(found.heading[1::2])) == 2
    np.testing.assert_allclose(found.curvature[::2], 0.05)
    assert found.clock[2] - found.clock[1] == pytest.approx(38.0)
    together = ambiguity.joined(windy.stops, found)
    assert len(together.speed) == 45
    assert np.all(np.diff(together.clock) > 0.0)


def test_the_other_way_tells_a_wind_sooner(windy: catalogue.HiddenSet) -> None:
    against = [{"speed": 4.5, "grade": 0.0, "heading": 0.4 + np.pi}]

    def back(count: int) -> physics.Stops:
        return ambiguity.planned(windy, against, count, np.random.default_rng(2))

    def same(count: int) -> physics.Stops:
        return designs.draw("one-way", count, 0.02, np.random.default_rng(2))

    def apart(more: physics.Stops) -> float:
        stops = ambiguity.joined(windy.stops, more)
        return worth(windy.truth, BASE, stops, 0.03, 0.02, ("headwind",)).apart

    assert ambiguity._needed(windy, back) <= 12
    assert apart(same(24)) < TOLD_APART < apart(back(24))


@pytest.mark.nightly
def test_cases_show_and_cannot_be_named() -> None:
    hidden = ambiguity.case(1)
    assert hidden is not None
    assert hidden.worth.seen
    assert hidden.worth.apart < TOLD_APART
    assert len(hidden.columns["t"]) > 0
    assert hidden.order.kind == "single"
