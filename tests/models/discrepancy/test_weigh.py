"""Explanations compared at one onset."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from slopewise.models.discrepancy.likelihood import weigh


def _fit(effect: float, onset: float, *, settled: bool) -> Any:
    weight = effect + onset
    return SimpleNamespace(
        trace=None, chosen=effect, onset=onset, log_prior=0.0, log_weight=weight, settled=settled
    )


def test_a_better_onset_that_one_explanation_finds_serves_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def settled(_: Any, __: Any, effect: float, ___: float, starts: tuple[Any, ...]) -> Any:
        optimum = 9.0 if effect == 2.0 else 0.0  # that alone comes to the best maximum
        return _fit(effect, max(optimum, *(s.onset for s in starts)), settled=True)

    def quick(_: Any, effect: float, __: float, near: Any) -> Any:
        return _fit(effect, near.onset, settled=False)

    monkeypatch.setattr(weigh, "fit", settled)
    monkeypatch.setattr(weigh, "quick_fit", quick)
    effects = {"": 1.0, "drag": 2.0, "lag": 3.0, "fade": 0.5, "patch": 0.1}
    known = {
        frozenset(filter(None, [name])): _fit(effect, 0.0, settled=name == "lag")
        for name, effect in effects.items()
    }
    weigh._at_one_onset(known, None)  # type: ignore[arg-type]
    assert {fit.onset for fit in known.values()} == {9.0}
    assert max(known, key=lambda names: known[names].log_weight) == {"lag"}
