"""A share of the optimality benchmark: smoothed plans against IPOPT on generated problems."""

from __future__ import annotations

from itertools import islice
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from benchmarks.common.judge import smooth_excess
from benchmarks.planner import optimality
from slopewise.planner.profile.reference import JerkLimitedReference


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    return optimality.run(quick=True)


def test_smoothed_plans_are_within_a_percent_of_the_optimum(result: dict[str, Any]) -> None:
    assert result["instances"] == optimality.QUICK_INSTANCES
    assert not result["unsolved"]
    assert len(result["above"]) <= 2
    # A crest makes a dip of one station in the bounds, which a limit of jerk has to round.
    assert result["excess"]["most"] < 0.02


def test_smoothed_plans_keep_their_limits(result: dict[str, Any]) -> None:
    """Faster than the optimum is then possible only within the tolerance of IPOPT."""
    assert result["breach"] < 1e-3
    assert result["excess"]["least"] > -1e-4


def test_it_is_many_times_as_fast(result: dict[str, Any]) -> None:
    """A bound for any machine; the benchmark gives the real figure."""
    assert result["ratio"]["median"] > 10.0


def test_problems_are_the_same_for_a_seed_and_of_many_kinds() -> None:
    first, again = (list(islice(optimality.instances(12), 12)) for _ in range(2))
    assert [i.name for i in first] == [i.name for i in again]
    assert len({i.name for i in first}) == 12
    sizes = {len(i.problem.speed_sq_max) for i in first}
    assert len(sizes) > 1
    assert {i.problem.start_accel is None for i in first} == {True, False}
    assert any(i.problem.speed_sq_max[-2] <= 0.0 for i in first), "some stop before their end"
    assert any(i.problem.speed_sq_max[0] > 0.0 for i in first), "some move at their start"


def test_a_plan_that_is_slower_than_need_be_is_told() -> None:
    """The measure itself: a profile at 80 % of the optimal speed takes a quarter longer."""
    problem = next(optimality.instances(1)).problem
    optimum = JerkLimitedReference(len(problem.speed_sq_max)).solve(problem)
    assert optimum.speed_sq is not None
    assert smooth_excess(problem, optimum.speed_sq) < 1e-3
    slower = optimality.travel_time(
        np.concatenate(([0.0], np.cumsum(problem.ds))), 0.64 * optimum.speed_sq
    )
    assert slower / optimum.travel_time == pytest.approx(1.25)


def test_it_shows_what_misses(result: dict[str, Any]) -> None:
    missed = {"name": "a hill", "excess": 0.02, "reason": "a reason"}
    screen = Console(record=True, width=120)
    optimality.show({**result, "above": [missed], "unsolved": [missed]}, screen)
    text = screen.export_text()
    assert "2.00% above the optimum: a hill" in text
    assert "not solved: a hill: a reason" in text
