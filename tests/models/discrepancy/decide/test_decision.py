"""Decision about effects: model form, unnamed effects and the conservative model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.decide.model_form import as_in_the_model
from slopewise.models.discrepancy.decide.revised import _promised_again, revised
from slopewise.models.discrepancy.decide.verdict import Decision, FittedExplanation
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.model.hypothesis import BASE as BASE_NUMBERS
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.discrepancy.search.extent import extents
from slopewise.models.discrepancy.search.refine import (
    fit_base,
    fit_with_noise,
    fit_with_scatter,
    start_of,
)
from slopewise.models.parameters import Effect
from tests.world.logs import table
from tests.world.vehicles import BASE

PLACE = Effect(
    name="surface_patch", parameters={"delta": -0.05, "x": 0.0, "y": 0.0, "radius": 15.0}
)
CAP = Effect(name="wheel_lockup", parameters={"mu": 0.4})


@pytest.mark.parametrize(
    ("effects", "forms", "expected"),
    [
        ((PLACE,), {"slips": True}, ["slippery"]),
        ((PLACE,), {"slips": True, "drifts": True}, ["slippery", "drift"]),
        ((CAP,), {"drifts": True}, ["drift"]),
        ((CAP,), {"slips": True}, []),
        ((), {"slips": True, "drifts": True}, []),
    ],
)
def test_the_model_has_the_plain_forms_and_reports_it(
    effects: tuple[Effect, ...], forms: dict[str, bool], expected: list[str]
) -> None:
    stops = table("clean")
    base = fit_base(stops, start_of(stops, BASE))
    hypothesis = replace(base.hypothesis, added=effects, **forms)  # type: ignore[arg-type]
    fit = fit_with_scatter(stops, hypothesis, base.noise, rounds=1)
    before = Decision(Verdict.MISSING_EFFECT, FittedExplanation(fit))
    after = as_in_the_model(stops, before)
    for note, part in zip(after.notes, expected, strict=True):
        assert part in note
    fitted = after.explanation.fit.hypothesis
    plain = replace(fitted, slips=False, drifts=False)
    np.testing.assert_array_equal(predict(stops, fitted), predict(stops, plain))
    assert [e.name for e in fitted.added] == [e.name for e in effects]


def decision(verdict: Verdict, *effects: Effect) -> Decision:
    stops = table("step")
    hypothesis = Hypothesis.configured(BASE)
    for effect in effects:
        hypothesis = hypothesis.plus(effect)
    return Decision(verdict, FittedExplanation(fit_with_noise(stops, hypothesis)))


STEP = Effect(name="step_change", parameters={"scale": 0.85, "run": 25.0})


def test_effects_come_with_covariance_bounds_and_source() -> None:
    stops = table("step")
    decided = decision(Verdict.MISSING_EFFECT, STEP)
    widths = extents(stops, decided.explanation.fit)
    predicted = distances(stops, decided.explanation.fit.hypothesis)
    model, added = revised(stops, decided, predicted, widths, "a log")
    assert model.effect == added
    assert added[0].source == "a log"
    covariance = np.array(added[0].covariance)
    assert covariance.shape == (2, 2)
    assert 0.0 < covariance[0, 0] < 0.02**2
    assert covariance[1, 1] > 0.0  # the run, from its extent
    assert model.braking.force_std > 0.0
    low, high = BASE.braking.speed_range
    assert low <= model.braking.speed_range[0] < model.braking.speed_range[1] <= high


def test_stops_beyond_their_prediction_make_the_offset_larger() -> None:
    stops = table("step")
    decided = decision(Verdict.PARAMETER_DRIFT)
    short = stops.distance - 0.5
    model, _ = revised(stops, decided, short, [], "")
    assert model.braking.distance_offset >= 0.5


def test_the_longest_alternative_is_in_the_offset() -> None:
    stops = table("step")
    decided = decision(Verdict.AMBIGUOUS, STEP)
    fit = decided.explanation.fit
    weaker = fit.hypothesis.moved(fit.hypothesis.free - 0.1 * np.eye(BASE_NUMBERS + 1)[3])
    alternative = FittedExplanation(replace(fit, hypothesis=weaker))
    alone = revised(stops, decided, stops.distance, [{}], "")[0].braking.distance_offset
    revised_model = revised(
        stops, replace(decided, rivals=(alternative,)), stops.distance, [{}], ""
    )[0]
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
