"""Decision about effects: model form, unnamed effects and the conservative model."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from slopewise.models.discrepancy.decide import restraint
from slopewise.models.discrepancy.decide.gap import distances
from slopewise.models.discrepancy.decide.model_form import as_in_the_model
from slopewise.models.discrepancy.decide.revised import revised
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.model.hypothesis import BASE as BASE_NUMBERS
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.discrepancy.search.extent import extents
from slopewise.models.discrepancy.search.identify import ScoredExplanation
from slopewise.models.discrepancy.search.refine import (
    Fit,
    fit_base,
    fit_with_noise,
    fit_with_scatter,
    start_of,
)
from slopewise.models.parameters import Effect
from tests.world.formulas import SAMPLES
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
    before = Decision(Verdict.MISSING_EFFECT, ScoredExplanation(fit, 0.0))
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
    return Decision(verdict, ScoredExplanation(fit_with_noise(stops, hypothesis), 0.0))


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
    alternative = ScoredExplanation(replace(fit, hypothesis=weaker), 1.0)
    alone = revised(stops, decided, stops.distance, [{}], "")[0].braking.distance_offset
    revised_model = revised(
        stops, replace(decided, rivals=(alternative,)), stops.distance, [{}], ""
    )[0]
    longer = distances(stops, weaker) - distances(stops, fit.hypothesis)
    assert revised_model.braking.distance_offset > max(
        alone, 0.9 * float(np.quantile(longer, 0.97))
    )


@cache
def base() -> Fit:
    stops = table("clean")
    return fit_base(stops, start_of(stops, BASE))


def explained(score: float, *effects: Effect) -> ScoredExplanation:
    hypothesis: Hypothesis = base().hypothesis
    for effect in effects:
        hypothesis = hypothesis.plus(effect)
    return ScoredExplanation(replace(base(), hypothesis=hypothesis), score)


def named(score: float, *names: str) -> ScoredExplanation:
    return explained(score, *(Effect(name=n, parameters=SAMPLES[n]) for n in names))


def seen(axis: str, p_value: float) -> Any:
    return SimpleNamespace(axis=SimpleNamespace(name=axis), p_value=p_value)


def test_a_build_up_under_a_friction_cap_is_no_name() -> None:
    names = ["wheel_lockup", "cross_slope", "brake_lag"]
    assert restraint.build_up_under_a_cap(names) == ["brake_lag", "wheel_lockup"]
    assert restraint.build_up_under_a_cap(["wheel_lockup", "cross_slope"]) == []
    assert restraint.build_up_under_a_cap(["brake_lag", "brake_fade"]) == []


def test_two_effects_along_one_axis_are_no_name() -> None:
    stops = table("clean")
    names = restraint.along_one_axis(stops, named(0.0, "aerodynamic_drag", "viscous_resistance"))
    assert names == ["aerodynamic_drag", "viscous_resistance"]
    # A build-up is fitted in addition to all others, and is no second effect.
    assert restraint.along_one_axis(stops, named(0.0, "aerodynamic_drag", "brake_lag")) == []
    assert restraint.along_one_axis(stops, named(0.0, "aerodynamic_drag", "cross_slope")) == []


@pytest.mark.parametrize(
    ("margin", "located", "weak"),
    [
        (5.0, [seen("roll", 1e-6)], True),
        (20.0, [], True),
        (20.0, [seen("speed", 1e-6)], True),
        (20.0, [seen("roll", 0.2)], True),
        (20.0, [seen("roll", 0.01)], False),
        (60.0, [], False),
    ],
)
def test_a_name_needs_its_axis_or_much_evidence(
    margin: float, located: list[Any], weak: bool
) -> None:
    best, without = named(0.0, "cross_slope"), named(margin)
    assert restraint.weak(table("clean"), best, without, located) is weak


def test_a_patch_needs_five_stops_inside() -> None:
    stops = table("clean")
    where = {"x": float(np.median(stops.x)), "y": float(np.median(stops.y))}
    away = np.sort(np.hypot(stops.x - where["x"], stops.y - where["y"]).min(axis=1))
    place = [seen("place", 1e-5)]
    for count, weak in ((3, True), (8, False)):
        inside = where | {"delta": 0.02, "radius": float(0.5 * (away[count - 1] + away[count]))}
        best = explained(0.0, Effect(name="surface_patch", parameters=inside))
        assert restraint.weak(stops, best, named(30.0), place) is weak
