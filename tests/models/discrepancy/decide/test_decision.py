"""The conservative model that a decision writes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.decide.revised import _promised_again, revised
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.model.hypothesis import BASE as BASE_NUMBERS
from slopewise.models.parameters import Effect
from tests.world.logs import refit_of, table
from tests.world.vehicles import BASE


def decision(verdict: Verdict, *effects: Effect) -> Decision:
    return Decision(verdict, refit_of(table("step"), *effects))


STEP = Effect(name="step_change", parameters={"scale": 0.85, "run": 25.0})


def test_effects_come_with_covariance_bounds_and_source() -> None:
    stops = table("step")
    decided = decision(Verdict.MISSING_EFFECT, STEP)
    fit = replace(decided.explanation, extents=({"run": 0.7},))
    predicted = distances(stops, fit.hypothesis)
    model, added = revised(stops, replace(decided, explanation=fit), predicted, "a log")
    assert model.effect == added
    assert added[0].source == "a log"
    covariance = np.array(added[0].covariance)
    assert covariance.shape == (2, 2)
    assert 0.0 < covariance[0, 0] < 0.02**2
    assert covariance[1, 1] == pytest.approx(0.7**2)  # the run, from its extent
    assert model.braking.force_std > 0.0
    low, high = BASE.braking.speed_range
    assert low <= model.braking.speed_range[0] < model.braking.speed_range[1] <= high


def test_stops_beyond_their_prediction_make_the_offset_larger() -> None:
    stops = table("step")
    decided = decision(Verdict.PARAMETER_DRIFT)
    short = stops.distance - 0.5
    model, _ = revised(stops, decided, short, "")
    assert model.braking.distance_offset >= 0.5


def test_the_longest_alternative_is_in_the_offset() -> None:
    stops = table("step")
    decided = decision(Verdict.AMBIGUOUS, STEP)
    fit = decided.explanation
    weaker = fit.hypothesis.moved(fit.hypothesis.free - 0.1 * np.eye(BASE_NUMBERS + 1)[3])
    alternative = replace(fit, hypothesis=weaker)
    alone = revised(stops, decided, stops.distance, "")[0].braking.distance_offset
    decided_with = replace(decided, alternatives=(alternative,))
    revised_model = revised(stops, decided_with, stops.distance, "")[0]
    longer = distances(stops, weaker) - distances(stops, fit.hypothesis)
    assert revised_model.braking.distance_offset > max(
        alone, 0.9 * float(np.quantile(longer, 0.97))
    )


def test_a_promise_is_learned_where_only_some_stops_could_be_compared() -> None:
    stops = table("step")
    late = stops.take(np.arange(5, len(stops)))  # of later runs only
    assert late.run.max() >= len(late)
    predicted = late.distance * np.linspace(0.98, 1.02, len(late))
    promise = _promised_again(late, BASE.braking, predicted)
    assert promise is not None
