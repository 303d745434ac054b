"""A share of the optimality benchmark: smoothed plans against IPOPT on generated problems."""

from __future__ import annotations

from itertools import islice
from typing import Any

import pytest
from rich.console import Console

from benchmarks.common.campaign import BenchmarkRequest, no_progress
from benchmarks.common.profile_quality import smooth_excess, stations_of, travel_time
from benchmarks.planner import optimality
from slopewise.planner.profile.reference import JerkLimitedReference


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    return optimality.run(BenchmarkRequest(quick=True), no_progress)


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


def test_planner_is_many_times_as_fast(result: dict[str, Any]) -> None:
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


def test_slower_profile_needs_more_time() -> None:
    """The measure itself: a profile at 80 % of the optimal speed takes a quarter longer."""
    problem = next(optimality.instances(1)).problem
    optimum = JerkLimitedReference(len(problem.speed_sq_max)).solve(problem)
    assert optimum.speed_sq is not None
    assert smooth_excess(problem, optimum.speed_sq) < 1e-3
    slower = travel_time(stations_of(problem), 0.64 * optimum.speed_sq)
    assert slower / optimum.travel_time == pytest.approx(1.25)


def test_show_lists_missed_targets(result: dict[str, Any]) -> None:
    missed = {"name": "a hill", "excess": 0.02, "reason": "a reason"}
    screen = Console(record=True, width=120)
    optimality.show({**result, "above": [missed], "unsolved": [missed]}, screen)
    text = screen.export_text()
    assert "2.00% above the optimum: a hill" in text
    assert "not solved: a hill: a reason" in text
