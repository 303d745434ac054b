"""Identifiability of hidden effects."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.discrepancy.identifiability import Identifiability, WeightedStops, identifiability
from benchmarks.discrepancy.plant_physics import Physics, Stops, draw

BASE = Physics(m_m=0.0, b_m=-0.2, m_b=0.005, b_b=0.45, dead_time=0.25)
WINDY = BASE._replace(wind_drag=0.012, wind=6.0, wind_direction=0.4)
DRAG = BASE._replace(drag=0.03)
UPHILL = BASE._replace(asymmetry=0.4)


def scene(count: int, design: str = "mixed") -> Stops:
    return draw(design, count, 0.02, np.random.default_rng(3))


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
