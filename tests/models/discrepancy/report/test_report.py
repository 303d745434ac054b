"""Evidence of a finding, and proposed experiments."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.report import experiment
from slopewise.models.discrepancy.search.refine import fit_with_noise
from slopewise.models.parameters import Effect
from tests.world.logs import investigated, table
from tests.world.vehicles import BASE


@pytest.mark.parametrize("name", ["clean", "noisy"])
def test_a_model_that_stays_is_shown_as_it_is(name: str) -> None:
    findings, shown, _ = investigated(name)
    assert findings.verdict in (Verdict.NONE, Verdict.TOO_NOISY)
    np.testing.assert_array_equal(shown.found, shown.configured)
    np.testing.assert_array_equal(shown.speed_after, shown.speed_before)
    assert not shown.changed


def test_new_coefficients_are_shown_by_the_stop_with_the_largest_change() -> None:
    findings, shown, _ = investigated("drift")
    assert findings.verdict is Verdict.PARAMETER_DRIFT
    assert shown.changed
    change = np.abs(shown.found - shown.configured)
    largest = int(np.argmax(change))
    start_speed = shown.speed[shown.time <= 0.1].mean()
    assert shown.speed_before[-1] != shown.speed_after[-1]
    assert change[largest] > 0.05
    assert start_speed > 0.5


DRAG = Effect(name="aerodynamic_drag", parameters={"c": 0.03})
VISCOUS = Effect(name="viscous_resistance", parameters={"c": 0.01})


def test_stops_are_proposed_that_distinguish_two_effects() -> None:
    stops, base = table("slow_drag"), Hypothesis.configured(BASE)
    best, alternative = (fit_with_noise(stops, base.plus(e)) for e in (DRAG, VISCOUS))
    proposed = experiment.between(stops, best, [alternative])
    speeds = [stop.speed for stop in proposed.stops]
    # c v² and c v differ most in fast stops.
    assert min(speeds) > 0.9 * stops.held.max()


def test_a_lag_is_sharpened_by_stops_that_shrink_its_error() -> None:
    stops = table("lag")
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    best = fit_with_noise(stops, Hypothesis.configured(BASE).plus(lag))
    proposed = experiment.sharpening(stops, best)
    assert len(proposed.stops) == 6
    low, high = np.quantile(stops.held, [0.0, 1.0])
    assert all(low <= stop.speed <= high for stop in proposed.stops)
