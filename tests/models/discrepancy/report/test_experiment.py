"""Proposed stops against random stops, by their true information."""

from __future__ import annotations

import numpy as np

from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.report import experiment
from slopewise.models.discrepancy.search.refine import fit_with_noise
from slopewise.models.parameters import Effect
from tests.models.discrepancy.logs import table
from tests.models.models_for_tests import BASE

DRAG = Effect(name="aerodynamic_drag", parameters={"c": 0.03})
VISCOUS = Effect(name="viscous_resistance", parameters={"c": 0.01})


def test_the_design_has_twice_the_information_of_random_stops() -> None:
    stops = table("slow_drag")
    base = Hypothesis.configured(BASE)
    best, alternative = (fit_with_noise(stops, base.plus(e)) for e in (DRAG, VISCOUS))
    plans, sheet, white = experiment._possible(stops, best)
    proposed = experiment.between(stops, best, [alternative])
    assert proposed.stops
    gain = experiment._Gain(sheet, white, best, alternative)
    for stop in proposed.stops:
        gain.add(plans.index(stop))
    at_random = []
    rng = np.random.default_rng(1)
    for _ in range(30):
        random_gain = experiment._Gain(sheet, white, best, alternative)
        for pick in rng.integers(0, len(plans), len(proposed.stops)):
            random_gain.add(int(pick))
        at_random.append(random_gain.total)
    assert gain.total > 2.0 * np.mean(at_random)


def test_a_lag_is_sharpened_by_stops_that_shrink_its_error() -> None:
    stops = table("lag")
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    best = fit_with_noise(stops, Hypothesis.configured(BASE).plus(lag))
    proposed = experiment.sharpening(stops, best)
    assert len(proposed.stops) == 6
    low, high = np.quantile(stops.held, [0.0, 1.0])
    assert all(low <= stop.speed <= high for stop in proposed.stops)
