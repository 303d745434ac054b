"""Evidence of a finding, and proposed experiments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Gap, Verdict
from slopewise.models.discrepancy.likelihood.axes import Axis
from slopewise.models.discrepancy.likelihood.residual_axes import ResidualAxis, mainly_along
from slopewise.models.discrepancy.report import experiment
from slopewise.models.discrepancy.report.summary import located_axes, summary
from slopewise.models.parameters import Effect
from tests.world.logs import findings_of, refit_of, table


@pytest.mark.parametrize("name", ["clean", "noisy"])
def test_a_model_that_stays_is_shown_as_it_is(name: str) -> None:
    findings = findings_of(name)
    shown = findings.evidence
    assert findings.verdict in (Verdict.NONE, Verdict.TOO_NOISY)
    np.testing.assert_array_equal(shown.found, shown.configured)
    np.testing.assert_array_equal(shown.speed_after, shown.speed_before)
    assert not shown.changed


def test_new_coefficients_are_shown_by_the_stop_with_the_largest_change() -> None:
    findings = findings_of("drift")
    shown = findings.evidence
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
    stops = table("slow_drag")
    best, alternative = (refit_of(stops, e) for e in (DRAG, VISCOUS))
    proposed = experiment.between(stops, best, [alternative])
    speeds = [stop.speed for stop in proposed.stops]
    # c v² and c v differ at both ends of a range of speeds, once each is fitted to it.
    assert max(speeds) > 0.9 * stops.held.max()
    assert all(abs(speed - np.median(stops.held)) > 0.5 for speed in speeds)


def test_a_lag_is_sharpened_by_stops_that_shrink_its_error() -> None:
    stops = table("lag")
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    best = refit_of(stops, lag)
    proposed = experiment.sharpening(stops, best)
    assert len(proposed.stops) == 6
    low, high = np.quantile(stops.held, [0.0, 1.0])
    assert all(low <= stop.speed <= high for stop in proposed.stops)


def test_nothing_is_needed_only_where_stops_end_as_predicted() -> None:
    stops = table("lag")
    lag = Effect(name="brake_lag", parameters={"tau": 0.2})
    best = refit_of(stops, lag)
    known = replace(best, covariance=1e-8 * best.covariance)
    assert experiment.sharpening(stops, known).text.startswith("nothing is needed")
    late = experiment.sharpening(stops, known, 1.2).text
    assert "nothing is needed" not in late
    assert "1.20 m beyond" in late


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((-0.41, 1.76), "up to 1.76 m longer and up to 0.41 m shorter"),
        ((0.1, 0.3), "up to 0.30 m longer than"),
        ((-0.3, -0.1), "up to 0.30 m shorter than"),
    ],
)
def test_the_longest_stop_is_reported_whatever_the_mean(
    ends: tuple[float, float], text: str
) -> None:
    stops = table("clean")
    decision = _decision(Verdict.PARAMETER_DRIFT)
    gap = Gap("stopping distance, rms", "m", 0.5, 0.1, 0.1, 0.1, None, None)
    assert f"Stops of this log are {text}" in summary(stops, decision, {}, gap, ends)


def test_the_axis_with_the_largest_share_leads_and_calm_logs_list_none() -> None:
    onset, heading = _followed("time_since_onset", 9.0, 0.1), _followed("heading", 5.0, 1.0)
    chance = _followed("grade", 1.0, 2.0, p_value=0.4)
    assert mainly_along([onset, heading, chance]) is heading
    assert mainly_along([chance]) is None
    weak = _followed("onset_speed", 3.0, 1.0, p_value=0.0095)
    drift, none = _decision(Verdict.PARAMETER_DRIFT), _decision(Verdict.NONE)
    assert [a.axis for a in located_axes(drift, [weak], 1.0, 0.002)] == ["onset_speed"]
    assert located_axes(none, [weak], 1.0, 0.002) == ()


def _decision(verdict: Verdict) -> Decision:
    return Decision(verdict, refit_of(table("clean")))


def _followed(name: str, strength: float, removed: float, p_value: float = 1e-4) -> ResidualAxis:
    values = np.linspace(0.0, 1.0, 20)[:, None] * np.ones((20, 3))
    return ResidualAxis(Axis(name, "1", values, ()), p_value, strength, values, removed)
