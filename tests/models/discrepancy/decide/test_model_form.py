"""The model keeps the plain form of effects that fit best in a finer one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.decide.model_form import as_in_the_model
from slopewise.models.discrepancy.decide.verdict import Decision
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.discrepancy.search.identify import ScoredExplanation
from slopewise.models.discrepancy.search.refine import fit_base, fit_with_scatter, start_of
from slopewise.models.parameters import Effect
from tests.models.discrepancy.logs import table
from tests.models.models_for_tests import BASE

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
