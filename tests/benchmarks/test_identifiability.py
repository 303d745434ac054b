"""Identifiability of hidden effects, and stops that distinguish alternatives."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.discrepancy import ambiguity, catalogue, designs
from benchmarks.discrepancy.catalogue import HiddenSet, SetConditions, SetSpec
from benchmarks.discrepancy.effect_plant import GRAVITY
from benchmarks.discrepancy.hidden_effects import HiddenTerm
from benchmarks.discrepancy.identifiability import (
    DISTINCT_CHI2,
    Identifiability,
    WeightedStops,
    change_beyond_base,
    identifiability,
)
from benchmarks.discrepancy.plant_physics import Physics, Stops

BASE = Physics(m_m=0.0, b_m=-0.2, m_b=0.005, b_b=0.45, dead_time=0.25)
WIND = {"wind_drag": 0.012, "wind": 6.0, "wind_direction": 0.4}
WINDY = BASE._replace(**WIND)
DRAG = BASE._replace(drag=0.03)
UPHILL = BASE._replace(asymmetry=0.4)


def scene(count: int, design: str = "mixed") -> Stops:
    return designs.draw(design, count, 0.02, np.random.default_rng(3))


def known(truth: Physics, stops: Stops, name: str, scatter: float = 0.02) -> Identifiability:
    return identifiability(truth, BASE, stops, 0.03, scatter, (name,) if name else ())


def test_effects_that_the_base_absorbs_have_no_gap() -> None:
    assert known(BASE._replace(b_b=0.47, m_m=0.01, dead_time=0.28), scene(60), "").gap < 0.1
    only_up = scene(60)._replace(grade=np.linspace(0.05, 0.2, 60))
    assert known(UPHILL, only_up, "grade_asymmetry").gap < 1.0
    seen = known(UPHILL, scene(60), "grade_asymmetry")
    assert seen.is_detectable
    assert known(UPHILL, scene(60), "grade_asymmetry", scatter=0.005).gap > 3.0 * seen.gap


def test_gap_is_the_expected_chi_square_of_drawn_noise() -> None:
    """With drawn noise, the truth fits better than the base by its expected χ² and by the chance
    gain of the fitted numbers."""
    stops = scene(40)
    gap = known(DRAG, stops, "aerodynamic_drag").gap
    calm = stops._replace(friction=np.ones(40), delay=np.zeros(40))
    weighted = WeightedStops(DRAG, calm, 0.03, 0.02)
    fitted, residual = weighted.refit(BASE)
    q = np.linalg.qr(weighted.tangents(fitted).T)[0]
    gains = []
    for seed in range(30):
        noise = np.random.default_rng(seed).standard_normal(residual.size)
        base = residual + noise
        gains.append(base @ base - (q.T @ base) @ (q.T @ base) - noise @ noise)
    std = 2.0 * np.sqrt(gap) / np.sqrt(30.0)
    assert np.mean(gains) == pytest.approx(gap - q.shape[1], abs=4.0 * std)


def test_headwind_from_one_side_is_near_viscous_resistance() -> None:
    one_way = known(WINDY, scene(60, "one-way"), "headwind", 0.005)
    assert one_way.nearest == "viscous_resistance"
    assert one_way.apart < 0.5 * one_way.gap
    assert known(WINDY, scene(60), "headwind", 0.005).has_name


def test_change_beyond_base_is_half_a_step_in_the_middle() -> None:
    spec = SetSpec("faint", ("step_change",), "medium", 3)
    conditions = SetConditions(designs=("mixed",), counts=(60,), noises=(0.01,), scatters=(0.005,))
    hidden = catalogue.make(spec, conditions)
    base, stops = hidden.base, hidden.stops
    change = change_beyond_base(hidden.truth, base, stops, 0.01, 0.005)
    half = 0.5 * abs(hidden.truth.step_scale - 1.0)
    pull = base.b_b + np.sin(stops.grade) + base.b_m * stops.grade
    expected = np.sort(stops.speed**2 / (2.0 * GRAVITY * pull) * base.b_b * half / pull)[-3]
    assert change == pytest.approx(expected, rel=0.5)
    assert change_beyond_base(base, base, stops, 0.01, 0.005) < 1e-6


@pytest.fixture(scope="module")
def windy() -> HiddenSet:
    """A headwind met from one side only, which could as well be viscous resistance."""
    stops = designs.draw("one-way", 40, 0.02, np.random.default_rng(1))
    spec, terms = SetSpec("single", ("headwind",), "medium", 3), (HiddenTerm("headwind", WIND),)
    return HiddenSet(spec, "one-way", 0.03, 0.02, {}, {}, WINDY, terms, stops)


def test_proposed_stops_are_driven_as_proposed(windy: HiddenSet) -> None:
    design = [
        {"speed": 4.0, "grade": 0.0, "heading": 3.5, "pause": 30.0, "yaw_rate": 0.2},
        {"speed": 2.0, "grade": 0.1, "heading": None},
    ]
    stops = ambiguity.planned_stops(windy, design, 5, np.random.default_rng(0))
    np.testing.assert_allclose(stops.speed, [4.0, 2.0, 4.0, 2.0, 4.0])
    np.testing.assert_allclose(stops.heading[::2], 3.5)
    assert len(set(stops.heading[1::2])) == 2
    np.testing.assert_allclose(stops.curvature[::2], 0.05)
    assert stops.clock[2] - stops.clock[1] == pytest.approx(38.0)
    together = ambiguity.joined(windy.stops, stops)
    assert len(together.speed) == 45
    assert np.all(np.diff(together.clock) > 0.0)


def test_stops_against_the_wind_distinguish_it_sooner(windy: HiddenSet) -> None:
    design = [{"speed": 4.5, "grade": 0.0, "heading": 0.4 + np.pi}]

    def back(count: int) -> Stops:
        return ambiguity.planned_stops(windy, design, count, np.random.default_rng(2))

    def chi2(more: Stops) -> float:
        return known(WINDY, ambiguity.joined(windy.stops, more), "headwind").apart

    assert ambiguity.stops_needed(windy, back) <= 12
    same = designs.draw("one-way", 24, 0.02, np.random.default_rng(2))
    assert chi2(same) < DISTINCT_CHI2 < chi2(back(24))


@pytest.mark.nightly
def test_cases_are_detectable_and_have_no_name() -> None:
    case = ambiguity.case(1)
    assert case is not None
    assert case.identifiability.is_detectable
    assert case.identifiability.apart < DISTINCT_CHI2
    assert len(case.columns["t"]) > 0
