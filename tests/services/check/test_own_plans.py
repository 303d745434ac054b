"""No plan of ours is refused, on generated ground that neither planner nor checker was made for."""

from __future__ import annotations

import pytest

from tests.services.check.own_plans import refused, scene

SEEDS = 10_000
"""The first of those by night; what is worth keeping has one by day."""


@pytest.mark.parametrize("seed", [2123, 2307, 5, 6])
def test_no_plan_is_refused(seed: int) -> None:
    assert not list(refused(scene(seed)))


@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_few_of_many_plans_are_refused() -> None:
    """Of 600. Edges that a band only just reaches, and slopes in tight turns, remain open."""
    refusals = [
        (seed, plan.candidate, texts[0])
        for seed in range(SEEDS, SEEDS + 200)
        for plan, texts in refused(scene(seed))
    ]
    assert len(refusals) <= 4, refusals
