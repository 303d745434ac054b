"""Probabilities of an answer, from weights of its explanations."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from slopewise.models.discrepancy.likelihood.answer import answered
from slopewise.models.discrepancy.likelihood.weigh import Explanation

_FIT: Any = SimpleNamespace(noise=np.zeros(8))
_COMPANIONS = ("", "brake_fade", "grade_asymmetry", "step_change", "turning_resistance")


def _explanation(weight: float, *names: str) -> Explanation:
    return Explanation(frozenset(filter(None, names)), frozenset(), weight, _FIT, 0)


def test_a_name_in_all_that_is_likely_has_a_probability_of_at_most_one() -> None:
    rng, probabilities = np.random.default_rng(1), []
    for _ in range(200):
        weights = np.sort(rng.uniform(-8.0, 0.0, len(_COMPANIONS)))[::-1]
        every = [
            _explanation(w, "brake_lag", name) for w, name in zip(weights, _COMPANIONS, strict=True)
        ]
        answer = answered([*every, _explanation(-800.0)])
        assert answer.leader.names >= {"brake_lag"}
        probabilities.append(answer.of_names["brake_lag"])
    assert max(probabilities) == 1.0
    assert min(probabilities) > 1.0 - 1e-12
