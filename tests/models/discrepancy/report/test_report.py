"""Evidence of a finding, and proposed experiments."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.report import experiment
from slopewise.models.discrepancy.report.evidence import Evidence
from slopewise.models.discrepancy.search.refine import fit_with_noise
from slopewise.models.discrepancy.workflow import investigate_with_evidence
from slopewise.models.parameters import Effect
from tests.models.discrepancy.logs import log, table
from tests.models.models_for_tests import BASE

# -------------------------------------------------------------------------------- evidence


def evidence(name: str) -> tuple[Verdict, Evidence]:
    findings, shown = investigate_with_evidence(*log(name), BASE)
    return findings.verdict, shown


@pytest.mark.parametrize("name", ["clean", "noisy"])
def test_a_model_that_stays_is_shown_as_it_is(name: str) -> None:
    verdict, shown = evidence(name)
    assert verdict in (Verdict.NONE, Verdict.TOO_NOISY)
    np.testing.assert_array_equal(shown.found, shown.configured)
    np.testing.assert_array_equal(shown.speed_after, shown.speed_before)
    assert not shown.changed


def test_new_coefficients_are_shown_by_the_stop_with_the_largest_change() -> None:
    verdict, shown = evidence("drift")
    assert verdict is Verdict.PARAMETER_DRIFT
    assert shown.changed
    change = np.abs(shown.found - shown.configured)
    largest = int(np.argmax(change))
    start_speed = shown.speed[shown.time <= 0.1].mean()
    assert shown.speed_before[-1] != shown.speed_after[-1]
    assert change[largest] > 0.05
    assert start_speed > 0.5


# ------------------------------------------------------------------------------ experiment


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
