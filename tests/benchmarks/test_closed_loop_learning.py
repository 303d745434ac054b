"""Learned braking models: against a law written out here, and against stops that were held out."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra sim is not installed")

from benchmarks.closed_loop.calibration import stops_of_drive
from benchmarks.closed_loop.learning import dead_time_of, fit, residuals
from benchmarks.closed_loop.stop_sample import StopSample
from slopewise.models.errors import ParameterError
from slopewise.models.stops.simulation import GroundTrack, simulate_stop

G = 9.80665
DEAD_TIME = 0.2


def made_up(count: int, scatter: float = 0.0) -> list[StopSample]:
    """Stops of F_b/W = (−0.02 v − 0.1) θ + (0.01 v + 0.45) − 0.1 |φ| after a pure dead time."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(count):
        v, theta, phi = rng.uniform(0.8, 4.0), rng.uniform(-0.35, 0.35), rng.uniform(-0.2, 0.2)
        force = (-0.02 * v - 0.1) * theta + 0.01 * v + 0.45 - 0.1 * abs(phi)
        force *= 1.0 + scatter * rng.standard_normal()
        a = G * (force + np.sin(theta))
        one, zero = np.ones(2), np.zeros(2)
        track = GroundTrack(np.array([-1.0, 15.0]), theta * one, phi * one, zero, zero, zero, zero)
        found.append(
            StopSample("firm", v, v * DEAD_TIME + v * v / (2 * a), DEAD_TIME + v / a, track, theta)
        )
    return found


def test_an_exact_law_is_found_again() -> None:
    samples = made_up(60)
    model = fit(samples, "made up")
    b = model.braking.on("firm")
    assert dead_time_of(samples) == pytest.approx(DEAD_TIME, abs=1e-9)
    assert (b.m_m, b.b_m, b.m_b, b.b_b) == pytest.approx((-0.02, -0.1, 0.01, 0.45), abs=1e-6)
    assert model.effect[0].parameters["k"] == pytest.approx(-0.1, abs=1e-6)
    assert model.effect[1].parameters["k"] == pytest.approx(0.0, abs=1e-9)
    assert b.distance_offset < 1e-3


def test_scatter_is_covered_and_no_more_than_needed() -> None:
    samples = made_up(150, scatter=0.02)
    model = fit(samples, "made up")
    b = model.braking.on("firm")
    beyond = residuals(samples, b, *(effect.parameters["k"] for effect in model.effect))
    assert beyond.max() <= b.distance_offset + 1e-9
    assert 0.0 < b.distance_offset - beyond.mean() < 0.3


def test_too_few_stops_are_refused() -> None:
    with pytest.raises(ParameterError, match="stops on firm"):
        fit(made_up(10), "made up")


def test_stops_that_were_held_out_are_covered() -> None:
    learned = [s for seed in range(9) for s in stops_of_drive(seed, False, surface=0)]
    held_out = [s for seed in range(50, 52) for s in stops_of_drive(seed, False, surface=0)]
    model = fit(learned, "firm only")
    on = model.braking.on("firm")
    assert len(held_out) >= 4
    excess = np.array(
        [
            simulate_stop(model, s.track, s.speed, surface="firm").distance
            + on.distance_offset
            - s.distance
            for s in held_out
        ]
    )
    # Some two dozen stops do not give a quantile of one in a thousand.
    assert excess.min() > -0.05
    assert excess.mean() < 0.4


def test_body_pitch_would_make_the_ground_steeper_downhill() -> None:
    stops = [s for seed in (1, 2) for s in stops_of_drive(seed, True, surface=0)]
    dive = np.array([s.grade - s.body_grade for s in stops])
    assert len(dive) >= 3
    assert np.median(dive) > np.deg2rad(0.4)
