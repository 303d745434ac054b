"""Probabilities of an answer, from weights of its explanations."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.likelihood.answer import answered
from slopewise.models.discrepancy.likelihood.weigh import Explanation

_FIT: Any = SimpleNamespace(noise=np.zeros(8))
_SETS = (
    ("brake_lag", "brake_fade", "step_change"),
    ("brake_lag", "brake_fade"),
    ("brake_lag", "step_change"),
    ("brake_lag",),
)


def _explanation(weight: float, *names: str) -> Explanation:
    return Explanation(frozenset(names), frozenset(), weight, _FIT, 0)


def test_a_name_in_all_that_is_likely_has_a_probability_of_at_most_one() -> None:
    rng, probabilities = np.random.default_rng(1), []
    for _ in range(200):
        weights = [0.0, *np.sort(rng.uniform(-8.0, -2.0, len(_SETS) - 1))[::-1]]
        every = [_explanation(w, *names) for w, names in zip(weights, _SETS, strict=True)]
        answer = answered([*every, _explanation(-800.0)])
        assert answer.leader.names == set(_SETS[0])
        probabilities.append(answer.of_names["brake_lag"])
    assert max(probabilities) == 1.0
    assert min(probabilities) > 1.0 - 1e-12


def test_a_name_is_as_certain_as_that_nothing_is_missing_next_to_it() -> None:
    pair = ("brake_fade", "grade_asymmetry")
    for share in (0.3, 0.8):
        weights = np.log([1.0 - share, share])
        every = [_explanation(weights[0], pair[1]), _explanation(weights[1], *pair)]
        answer = answered([*every, _explanation(-800.0)])
        assert answer.verdict is Verdict.MISSING_EFFECT
        assert answer.leader.names == ({pair[1]} if share < 0.5 else {*pair})
        assert min(answer.of_names[n] for n in answer.leader.names) == pytest.approx(
            max(share, 1.0 - share)
        )
