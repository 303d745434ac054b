"""Plans of ours are not refused, on ground that was generated for other plans."""

from __future__ import annotations

import pytest

from tests.services.check.own_plans import checked, scene

SEEDS = range(10_000, 10_200)
"""Scenes of three plans by night; what is worth keeping has a scene by day."""


@pytest.mark.parametrize("seed", [2123, 2307])
def test_plans_that_were_refused_are_not(seed: int) -> None:
    texts = [text for _, text in checked(scene(seed))]
    assert texts == [[]] * len(texts) != []


@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_few_of_many_plans_are_refused() -> None:
    """Edges that a band only just reaches, and slopes in tight turns, remain open."""
    verdicts = [(seed, *verdict) for seed in SEEDS for verdict in checked(scene(seed))]
    refusals = [(seed, plan.candidate, texts[0]) for seed, plan, texts in verdicts if texts]
    assert len(verdicts) > 400
    assert len(refusals) <= 4, refusals
